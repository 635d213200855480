"""A way in a fixed number of footsteps: what the mixed-integer programs and SL1M have in common.

Feet take turns and keep the heading of the way, as in the paper's simplified baseline; places are points in convex
regions. What a step may be is a box around the standing foot: that of the planner's own table of steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.contacts.transition_model import TransitionModel, steps_60
from toolkit.errors import PlanningError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.search.costs.edge_cost import arrival_radius
from toolkit.search.moves.limits import climb
from toolkit.search.planner import ContactPlanner
from toolkit.world.timing import Timing
from toolkit.world.world import World
from validation.rivals.linear import Builder
from validation.rivals.regions import Region, regions_of, sole_turn

_ROUNDING = 1e-6  # m; added to the box of the places


@dataclass(frozen=True)
class Footsteps:
    """The task: from a stance to the goal in `count` steps.

    Attributes:
        start: The stance in which the robot starts.
        goal: (2,) m; middle of the goal.
        radius: m; half the width of the square in which the mean of the feet has to end.
        regions: Where soles may be.
        heading: rad; of all soles.
        lower, upper: (3,) m; box of a left foot beside the right one, along the heading, to the left and up.
        count: Number of steps; the left foot begins.
        timing: Of every step.
        com_height: m; of the CoM above the feet at home.
    """

    start: Stance
    goal: np.ndarray
    radius: float
    regions: tuple[Region, ...]
    heading: float
    lower: np.ndarray
    upper: np.ndarray
    count: int
    timing: Timing
    com_height: float

    @property
    def axes(self) -> np.ndarray:
        """(3, 3); rows are the heading, the left and up."""
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """(count + 2,) feet of the places: those of the start, then those of the steps."""
        return tuple(FEET[index % 2] for index in range(self.count + 2))

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,), (3,) m; corners of the space in which places are."""
        points = np.array([contact.pose.position for contact in self.start.feet])
        corners = [points.min(0), points.max(0)]
        for region in self.regions:
            low, high = extent(region)
            corners += [low, high]
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def sequence(self, places: np.ndarray, chosen: np.ndarray) -> ContactSequence:
        """The contacts of places (count, 3) m in the regions with these indices (count,)."""
        transitions = []
        for limb, place, number in zip(self.limbs[2:], places, chosen, strict=True):
            region = self.regions[int(number)]
            on_plane = place - (region.normal @ place - region.height) * region.normal
            pose = Pose(sole_turn(region.normal, self.heading), on_plane)
            contact = Contact(limb, pose, region.friction, region.surface)
            transitions.append(ContactTransition(limb, contact, self.timing))
        return ContactSequence(self.start, tuple(transitions))


def extent(region: Region) -> tuple[np.ndarray, np.ndarray]:
    """(3,), (3,) m; corners of the box around a region, from its vertices."""
    points = []
    for index, side in enumerate(region.sides):
        for other in range(index):
            system = np.stack([side, region.sides[other], region.normal])
            if abs(np.linalg.det(system)) > 1e-6:
                point = np.linalg.solve(system, [region.bounds[index], region.bounds[other], region.height])
                if (region.sides @ point <= region.bounds + 1e-9).all():
                    points.append(point)
    return np.min(points, axis=0), np.max(points, axis=0)


def footsteps_of(
    robot: RobotModel, world: World, planner: ContactPlanner, count: int, *, points: bool = False
) -> Footsteps:
    """The task of a robot in a world.

    Args:
        robot: The robot.
        world: The world.
        planner: For the start stance and the timing, which are the same for all planners.
        count: Number of steps.
        points: Whether feet are points, for which a region need not hold a whole sole.

    Raises:
        PlanningError: No region holds a sole.
    """
    start = planner.ground.start_stance()
    way = world.goal.position[:2] - start.mean_feet.position[:2]
    heading = float(np.arctan2(way[1], way[0]))
    half = np.zeros(2) if points else robot.half_sizes[Limb.LEFT_FOOT]
    regions = regions_of(world.surfaces, half, heading)
    if not regions:
        raise PlanningError(f"{world.path}: no surface holds a sole with the heading of the way")
    table, rise = TransitionModel.of(robot, steps_60()).steps, climb(robot)
    return Footsteps(
        start=start,
        goal=world.goal.position[:2],
        radius=arrival_radius(world.goal, robot.scale) / np.sqrt(2.0),
        regions=tuple(regions),
        heading=heading,
        lower=np.append(table[:, :2].min(0), -rise),
        upper=np.append(table[:, :2].max(0), rise),
        count=count,
        timing=planner.timings()[0],
        com_height=robot.com_height,
    )


def add_places(builder: Builder, task: Footsteps) -> np.ndarray:
    """Add the places of all feet with the limits of steps and the goal: their indices (count + 2, 3).

    The first two are those of the start. Also adds the rows that tie a step to the standing foot.
    """
    low, high = task.box
    places = builder.variables((task.count + 2, 3), low - _ROUNDING, high + _ROUNDING)
    for index, contact in enumerate(task.start.feet):
        for axis, value in enumerate(contact.pose.position):
            builder.row((1.0, places[index, axis]), low=float(value), high=float(value))
    for index in range(2, task.count + 2):
        side = 1.0 if task.limbs[index].is_left else -1.0
        for axis, along in enumerate(task.axes):
            lower, upper = task.lower[axis], task.upper[axis]
            if axis == 1 and side < 0:
                lower, upper = -upper, -lower
            builder.row((along, places[index]), (-along, places[index - 1]), low=float(lower), high=float(upper))
    for axis in range(2):
        middle, last = float(task.goal[axis]), places[-2:, axis]
        builder.row((0.5, last), low=middle - task.radius, high=middle + task.radius)
    return places


def add_choice(builder: Builder, task: Footsteps, places: np.ndarray) -> np.ndarray:
    """Put every step into exactly one region: the binary variables (count, regions) that choose it."""
    low, high = task.box
    chosen = builder.variables((task.count, len(task.regions)), 0.0, 1.0, integer=True)
    for place, choice in zip(places[2:], chosen, strict=True):
        builder.row((1.0, choice), low=1.0, high=1.0)
        for region, switch in zip(task.regions, choice, strict=True):
            rows = np.vstack([region.sides, region.normal, -region.normal])
            bounds = np.append(region.bounds, [region.height, -region.height])
            for row, bound in zip(rows, bounds, strict=True):
                most = float(np.maximum(row * low, row * high).sum() - bound)
                builder.row((row, place), (most, switch), high=float(bound) + most)
    return chosen
