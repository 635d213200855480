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
from toolkit.search.costs.heuristic import GridDistance
from toolkit.search.moves.limits import climb
from toolkit.search.moves.occupancy import BodyBox, Occupancy
from toolkit.world.surface import Surface
from toolkit.world.world import World

_DETOURS = (2.0, 8.0)  # m around start and goal that the grid covers; the larger where the smaller has no way


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
        occupancy: Cells that the body can hit, around start and goal.
    """

    def __init__(self, robot: RobotModel, world: World, projector: Projector, footholds: Footholds):
        self._world, self._projector, self._footholds, self._climb = world, projector, footholds, climb(robot)
        self.box = BodyBox.of(robot)
        table = projector.table
        first, last = table.edge_start[:-1], table.edge_start[1:]
        owner = np.repeat(np.arange(len(first)), last - first)
        points = table.origin[owner] + np.einsum("nij,nj->ni", table.rotation[owner][:, :, :2], table.edges[:, :2])
        lower = np.minimum.reduceat(points, first)[table.foot]
        upper = np.maximum.reduceat(points, first)[table.foot]
        self._ground = lower, upper  # corners of the boxes around foot surfaces
        self._bounds = [self._around(detour) for detour in _DETOURS]
        self.occupancy = self._occupy(self._bounds[0])
        self._detour = 0

    def _around(self, detour: float) -> tuple[float, float, float, float]:
        """Bounds in XY around start and goal, no larger than the ground."""
        ends = np.stack([self._world.start.position[:2], self._world.goal.position[:2]])
        lower, upper = self._ground
        low = np.maximum(ends.min(0) - detour, np.minimum(lower[:, :2].min(0), ends.min(0)) - 0.3)
        high = np.minimum(ends.max(0) + detour, np.maximum(upper[:, :2].max(0), ends.max(0)) + 0.3)
        return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))

    def _occupy(self, bounds: tuple[float, float, float, float]) -> Occupancy:
        low, high = np.array(bounds[:2]) - 0.5, np.array(bounds[2:]) + 0.5
        lower, upper = self._ground
        near = (upper[:, :2] >= low).all(1) & (lower[:, :2] <= high).all(1)
        heights = np.append(np.concatenate([lower[near, 2], upper[near, 2]]), self._world.start.position[2])
        bottom, top = heights.min() + self.box.bottom - 0.3, heights.max() + self.box.top + 0.3
        return Occupancy.of(self._world.mujoco_model, np.array([*low, bottom]), np.array([*high, top]))

    def distance(self, start: Pose, stride: float) -> GridDistance | None:
        """Distance to the goal with steps of at most `stride` m; None where no way leads there from `start`."""
        for detour in range(self._detour, len(_DETOURS)):
            if detour > 0 and self._bounds[detour] == self._bounds[detour - 1]:
                continue
            if detour > self._detour:
                self.occupancy, self._detour = self._occupy(self._bounds[detour]), detour
            grid = self._grid(self.occupancy, stride)
            if np.isfinite(self._at(grid, start)):
                return grid
        return None

    def _grid(self, occupancy: Occupancy, stride: float) -> GridDistance:
        bounds = self._bounds[self._detour]
        goal = self._world.goal
        return GridDistance(self._projector, occupancy, self.box, goal, bounds, stride, self._climb, self._footholds)

    @staticmethod
    def _at(grid: GridDistance, start: Pose) -> float:
        return float(grid(start.position[None], np.array([start.yaw]))[0])

    def obstacle(self, start: Pose, stride: float, usual: float) -> str:
        """One line on what blocks the way to the goal with steps of at most `stride` m; `usual` ones are shorter."""
        world = self._world
        x, y = world.goal.position[:2]
        head = f"{world.path}: nothing leads to the goal at ({x:.3g}, {y:.3g})"
        grid = self._grid(self.occupancy, stride)
        if not grid.supported:
            return f"{head}: no surface within its radius holds a sole; move the goal onto walkable ground"
        open_air = Occupancy(self.occupancy.corner, self.occupancy.cell, np.zeros_like(self.occupancy.below))
        if np.isfinite(self._at(self._grid(open_air, usual), start)):
            room = f"{2 * self.box.half_width:.2g} m wide and {self.box.top:.2g} m high"
            return f"{head}: walls or a ceiling leave no room for the body ({room}) on any way; make more room"
        return (
            f"{head}: the ground is interrupted by a gap wider than the longest step ({stride:.2g} m) or a rise higher "
            f"than {self._climb:.2g} m; bring the surfaces closer together"
        )

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

        Surfaces steeper than their friction angle force it, since no foot can rest on them.
        """
        table, bounds = self._projector.table, self._bounds[0]
        upright = np.clip(table.rotation[:, 2, 2], 1e-6, 1.0)
        near = (table.centre[:, :2] >= bounds[:2]).all(1) & (table.centre[:, :2] <= bounds[2:]).all(1)
        gain = (np.sqrt(1.0 - upright**2) - table.friction * upright) * upright * -GRAVITY[2]
        return float(max(gain[table.foot & near].max(initial=0.0), 0.0))
