"""Grid distances over a world's terrain, and messages on what blocks the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolkit.centroidal.problem import GRAVITY
from toolkit.contacts.footholds import Footholds
from toolkit.contacts.projection import Projector
from toolkit.geometry.pose import Pose, steepness
from toolkit.robot.model import RobotModel
from toolkit.search.costs.heuristic import GridBody, GridDistance, Mesh
from toolkit.search.costs.impossible import Proof
from toolkit.search.moves.limits import climb, drops
from toolkit.search.moves.occupancy import BodyBox, Occupancy
from toolkit.world.surface import Surface
from toolkit.world.world import World

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_DETOURS = (2.0, 8.0)  # m around start and goal that the grid covers; the larger where the smaller has no way
_BENT = 0.3  # m by which a m of way with bent knees seems longer
_AROUND, _BEYOND = 0.3, 0.5  # m around start, goal and ground that the grid covers; beyond it, what a body may hit
_USED = 0.9  # part of the friction that motions use where feet slide; the rest steers them
_TURN = 1e-4  # m; cost of one layer of yaw, only there to prefer straight ways
_WIDE, _CELL = Mesh(cell=0.1, yaws=8), 0.05  # and the edge in m of the cells that a body may hit
# Where no way is wide enough for these: narrow places that bodies pass sideways. A quarter turn takes about six steps,
# and steps to the side lead half as far as others. The places where a body fits may lie between those of the grid, so
# it is tried at several around each: thirds of a cell and of a layer of yaw, where the body fits but for `_BETWEEN`.
_NARROW, _FINE = Mesh(cell=0.05, yaws=24), 0.025
_QUARTER, _SIDEWAYS, _BETWEEN = 1.0, 1.0, 0.04  # m of a quarter turn, m added to a m of way to the side, m


def resting_surfaces(surfaces: Sequence[Surface], friction: float | None) -> tuple[Surface, ...]:
    """Surfaces, of which those that are too steep for a foot to rest on no longer serve feet.

    A foot may use the part `friction` of the friction coefficients; None: nothing changes.
    """
    if friction is None:
        return tuple(surfaces)
    return tuple(
        replace(
            surface,
            serves_foot=surface.serves_foot and bool(steepness(surface.normal[2]) <= friction * surface.friction),
        )
        for surface in surfaces
    )


class TerrainDistance:
    """Builds grid distances for one robot in one world.

    Attributes:
        box: The body.
        occupancy: Cells that the body can hit, around start and goal; finer where the way is narrow.
    """

    def __init__(self, robot: RobotModel, world: World, projector: Projector, footholds: Footholds):
        self._robot, self._world, self._projector, self._footholds = robot, world, projector, footholds
        self._climb, self._scale = climb(robot), robot.scale.length
        self.box, self._drops = BodyBox.of(robot), drops(robot)
        table = projector.table
        first, last = table.edge_start[:-1], table.edge_start[1:]
        owner = np.repeat(np.arange(len(first)), last - first)
        points = table.origin[owner] + np.einsum("nij,nj->ni", table.rotation[owner][:, :, :2], table.edges[:, :2])
        lower = np.minimum.reduceat(points, first)[table.foot]
        upper = np.maximum.reduceat(points, first)[table.foot]
        self._ground = lower, upper  # corners of the boxes around foot surfaces
        self._bounds = [self._around(self._scale * detour) for detour in _DETOURS]
        self._detour, self._cell = 0, self._scale * _CELL
        self.occupancy = self._occupy(self._bounds[0], self._cell)

    def _around(self, detour: float) -> tuple[float, float, float, float]:
        """Bounds in XY around start and goal, no larger than the ground."""
        ends = np.stack([self._world.start.position[:2], self._world.goal.position[:2]])
        (lower, upper), around = self._ground, self._scale * _AROUND
        low = np.maximum(ends.min(0) - detour, np.minimum(lower[:, :2].min(0), ends.min(0)) - around)
        high = np.minimum(ends.max(0) + detour, np.maximum(upper[:, :2].max(0), ends.max(0)) + around)
        return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))

    def _occupy(self, bounds: tuple[float, float, float, float], cell: float) -> Occupancy:
        around, beyond = self._scale * _AROUND, self._scale * _BEYOND
        low, high = np.array(bounds[:2]) - beyond, np.array(bounds[2:]) + beyond
        lower, upper = self._ground
        near = (upper[:, :2] >= low).all(1) & (lower[:, :2] <= high).all(1)
        heights = np.append(np.concatenate([lower[near, 2], upper[near, 2]]), self._world.start.position[2])
        bottom, top = heights.min() + self.box.bottom - around, heights.max() + self.box.top + around
        return Occupancy.of(self._world.mujoco_model, np.array([*low, bottom]), np.array([*high, top]), cell)

    def distance(self, start: Pose, stride: float, *, narrow: bool = False) -> GridDistance | None:
        """Distance to the goal with steps of at most `stride` m; None where no way leads there from `start`.

        Where narrow places count, the grid is finer and knows that they are passed sideways.
        """
        cell = self._scale * (_FINE if narrow else _CELL)
        for detour in range(0 if narrow else self._detour, len(_DETOURS)):
            if detour > 0 and self._bounds[detour] == self._bounds[detour - 1]:
                continue
            if (detour, cell) != (self._detour, self._cell):
                self.occupancy = self._occupy(self._bounds[detour], cell)
                self._detour, self._cell = detour, cell
            grid = self._narrow(stride) if narrow else self._grid(self.occupancy, stride)
            if np.isfinite(self._at(grid, start)):
                return grid
        return None

    def _grid(self, occupancy: Occupancy, stride: float) -> GridDistance:
        body = GridBody(self.box, self.box, np.zeros((0, 3)), self._drops, self._scale * _TURN, 0.0, _BENT)
        return self._distance(occupancy, body, _WIDE.scaled(self._scale), stride)

    def _narrow(self, stride: float) -> GridDistance:
        depth, width = (half - self._scale * _BETWEEN for half in (self.box.half_depth, self.box.half_width))
        core, mesh = self.box._replace(half_depth=depth, half_width=width), _NARROW.scaled(self._scale)
        thirds = [np.array([0.0, -1.0, 1.0]) * step / 3 for step in (mesh.cell, mesh.cell, np.pi / mesh.yaws)]
        places = np.stack(np.meshgrid(*thirds, indexing="ij"), axis=-1).reshape(-1, 3)[1:]  # the first is the node
        turn = self._scale * 2 * _QUARTER / mesh.yaws
        body = GridBody(self.box, core, places, self._drops, turn, _SIDEWAYS, _BENT)
        return self._distance(self.occupancy, body, mesh, stride)

    def _distance(self, occupancy: Occupancy, body: GridBody, mesh: Mesh, stride: float) -> GridDistance:
        bounds, goal = self._bounds[self._detour], self._world.goal
        return GridDistance(self._projector, occupancy, body, mesh, goal, bounds, stride, self._climb, self._footholds)

    @staticmethod
    def _at(grid: GridDistance, start: Pose) -> float:
        return float(grid(start.position[None], np.array([start.yaw]))[0])

    def obstacle(self, start: Pose, longest: float, usual: float, surfaces: Sequence[Surface]) -> str | None:
        """One line on what keeps the robot from the goal; None where no proof says that something does.

        Steps are at most `longest` m long and lead over the surfaces alone; `usual` ones are shorter.
        """
        found = self._proof(start, longest, surfaces)
        if found is None:
            return None
        if found[0] == "body":  # where usual steps do not even lead there, it is the ground
            plain = self._proof(start, usual, surfaces)
            found = found if plain is None else plain
        what, (x, y) = found
        goal = self._world.goal
        shown = goal.position[: 3 if np.isfinite(goal.floor).any() else 2]
        head = f"{self._world.path}: nothing leads to the goal at ({', '.join(f'{each:.3g}' for each in shown)})"
        if what == "goal":
            return f"{head}: no surface within its radius holds a sole; move the goal onto walkable ground"
        place = f"near ({x:.3g}, {y:.3g})"
        if what == "body":
            deep, high = 2 * self.box.half_depth, self.box.top - self._drops[-1]
            room = f"{deep:.2g} m wide even sideways, {high:.2g} m high crouched"
            return f"{head}: walls or a ceiling leave no room for the body ({room}) {place}; make more room there"
        return (
            f"{head}: the ground is interrupted {place} by a gap wider than the longest step ({longest:.2g} m), "
            f"surfaces too small for a sole, or a rise higher than {self._climb:.2g} m; "
            "bring larger surfaces closer together"
        )

    def _proof(self, start: Pose, longest: float, surfaces: Sequence[Surface]) -> tuple[str, np.ndarray] | None:
        """What keeps the robot from the goal, and where; see `Proof.place`."""
        found = None
        for bounds in dict.fromkeys(self._bounds):
            if found is None:
                beyond = self._beyond(bounds)
                found = Proof(self._robot, self._world, surfaces, bounds, beyond, longest).place(start)
        return found

    def _beyond(self, bounds: tuple[float, float, float, float]) -> tuple[bool, bool, bool, bool]:
        """Whether ground goes on beyond bounds, at low x, high x, low y and high y."""
        low, high = self._ground[0].min(0), self._ground[1].max(0)
        return bool(low[0] < bounds[0]), bool(high[0] > bounds[2]), bool(low[1] < bounds[1]), bool(high[1] > bounds[3])

    def too_steep(self, friction: float) -> str:
        """One line on the ground that is too steep for a robot whose feet must rest."""
        world = self._world
        steep = [s for s in world.surfaces if s.serves_foot and steepness(s.normal[2]) > friction * s.friction]
        worst = max(steep, key=lambda surface: steepness(surface.normal[2]) / surface.friction)
        angle, most = np.degrees(np.arctan([float(steepness(worst.normal[2])), worst.friction]))
        x, y = world.goal.position[:2]
        return (
            f"{world.path}: nothing leads to the goal at ({x:.3g}, {y:.3g}) in static balance: the ground on the way "
            f"is steeper than its friction angle ('{worst.geom}': {angle:.3g} deg, friction {worst.friction:g} holds "
            f"{most:.3g} deg), so that no foot can rest on it; a planner that knows dynamics may cross it"
        )

    def forced_acceleration(self) -> float:
        """The most, in m/s^2, that a foot surface on the way forces the robot to accelerate horizontally; 0: none.

        Surfaces force it on which no foot can rest with the part `_USED` of their friction.
        """
        table, bounds = self._projector.table, self._bounds[0]
        upright = np.clip(table.rotation[:, 2, 2], 1e-6, 1.0)
        near = (table.centre[:, :2] >= bounds[:2]).all(1) & (table.centre[:, :2] <= bounds[2:]).all(1)
        gain = (np.sqrt(1.0 - upright**2) - _USED * table.friction * upright) * upright * -GRAVITY[2]
        return float(max(gain[table.foot & near].max(initial=0.0), 0.0))
