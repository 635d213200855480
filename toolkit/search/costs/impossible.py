"""Proofs that nothing leads to the goal.

A plan of this planner keeps to bounds that are known without it. Feet stand on surfaces, at most a longest step apart
and with heights that differ at most by the highest step. The trunk, upright in any heading and as low as the legs let
it be, goes from the start to the goal through free space, never far from the foot that stands. So there is no plan
where the goal cannot be reached on a grid whose cells err only to the good: a cell counts as ground where a foot may
stand anywhere in reach of it, and as free where a disc fits that is smaller than the trunk by the grid's own errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from toolkit.contacts.footholds import eroded
from toolkit.geometry.limb import Limb
from toolkit.geometry.plane import plane_height
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.search.costs.proof_kernels import (
    collect_heights,
    disc,
    enter_heights,
    flood,
    mark_between,
    mark_free,
    mark_stances,
)
from toolkit.search.moves.limits import climb
from toolkit.search.moves.occupancy import MARGIN, BodyBox, Occupancy
from toolkit.search.moves.shanks import shanks_of
from toolkit.world.surface import Surface
from toolkit.world.world import World

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_CELL, _MAX_CELLS = 0.03, 60_000  # m; larger where the world would need more cells in XY
_LEVELS = 14  # heights of a cell
_MERGE = 0.02, 0.1  # m; heights that differ by less are not told apart; tried in turn where there are too many
_INSIDE = 0.005  # m; a sole may be so far beyond an edge
_HEADINGS = 24  # of soles on surfaces too narrow for some heading, over half a turn
_PART = 0.75  # of half the body's depth: what is surely filled by some part of the trunk in any heading
_BESIDE = 0.05  # m; the trunk may be so far beside the line from one foot to the other
_SINK = 0.35  # part of its height at home by which the CoM may be lower; plans keep 0.7 of it
_STEEP = 0.2  # least vertical part of a normal of ground
_START, _UNEVEN = 0.25, 0.4  # m around the start, and above and below it, where its feet are
_HALF_STEP = 0.01  # m; half the spacing of the heights at which the trunk is tried
_AROUND = 0.5  # m around the grid and the trunk in which the world counts


class Trunk(NamedTuple):
    """What a body surely fills: an upright cylinder from below the hips to the top of the head.

    Attributes:
        radius: m; without the errors of the grids.
        bottom, top: m above the mean of the soles, standing as at home.
        sink, rise: m by which the legs let it sink and rise.
        slack: m; half the spacing of the heights that are tried.
    """

    radius: float
    bottom: float
    top: float
    sink: float
    rise: float
    slack: float

    @classmethod
    def of(cls, robot: RobotModel, cell: float) -> Trunk:
        """The trunk of a robot, for grids whose errors add up to a part of the cells' edges `cell` m in XY."""
        box, leg, scale = BodyBox.of(robot), robot.legs[Limb.LEFT_FOOT], robot.scale.length
        margin, slack = scale * MARGIN, scale * _HALF_STEP
        hips = robot.com_height + leg.hip_in_com[2]
        ankle = leg.ankle_in_sole[2]
        sink, rise = min(hips - ankle - leg.min_length, _SINK * robot.com_height), ankle + leg.max_length - hips
        radius = _PART * (box.half_depth - margin) - np.sqrt(0.5) * cell
        bottom = hips - shanks_of(robot).radius[0]
        return cls(float(radius), float(bottom), box.top - margin, float(sink), float(rise), slack)


class Proof:
    """The grid of one proof.

    Args:
        robot: The robot.
        world: The world.
        surfaces: Surfaces of the world as feet may use them.
        bounds: (xmin, ymin, xmax, ymax) m of the grid.
        beyond: Whether ground goes on beyond the bounds at low x, high x, low y and high y.
        longest: Longest step in m.
    """

    def __init__(
        self,
        robot: RobotModel,
        world: World,
        surfaces: Sequence[Surface],
        bounds: tuple[float, float, float, float],
        beyond: tuple[bool, bool, bool, bool],
        longest: float,
    ):
        from scipy.ndimage import binary_dilation  # here, since it takes long to import

        self._world, self._beyond, self._scale = world, np.array(beyond), robot.scale.length
        low, high = np.array(bounds[:2]), np.array(bounds[2:])
        self._cell = max(self._scale * _CELL, float(np.sqrt((high - low).prod() / _MAX_CELLS)))
        self._corner, self._shape = low, np.ceil((high - low) / self._cell).astype(int) + 1
        stride = longest / self._cell + 2 * np.sqrt(2.0)
        around = np.insert(disc(stride / 2), 0, 0, axis=0)
        between = None
        rooms = [(surface, room) for surface in surfaces if (room := self._room(robot, surface)) is not None]
        for merge in _MERGE:
            self._merge = self._scale * merge
            ground = self._ground(rooms)
            if between is None:
                between = mark_between(ground.max(2) > -np.inf, stride, self._beyond)
                between = binary_dilation(between, iterations=int(np.ceil(self._scale * _BESIDE / self._cell)))
            self._levels = np.full(ground.shape, -np.inf)
            collect_heights(ground, between, around, self._merge, self._levels)
            self._known = bool((np.stack([ground, self._levels])[..., -1] == -np.inf).all())
            if self._known:
                break
        self._rise = climb(robot) + 2 * self._merge
        self._goal = self._levels > -np.inf
        self._goal &= self._within(world.goal.position[:2], world.goal.radius + self._cell)[..., None]
        self._goal &= world.goal.on_floor(self._levels, self._merge)
        mark_stances(self._levels, ground, around, self._rise, self._merge, self._goal)
        self._free = np.zeros(self._levels.shape, np.bool_)
        if self._goal.any():
            self._mark(robot)

    def _room(self, robot: RobotModel, surface: Surface) -> BaseGeometry | None:
        """Where the centre of a sole may be on a surface, with what the grid may err; None where nowhere."""
        if not surface.serves_foot or surface.normal[2] < _STEEP:
            return None
        half, inside_by = robot.half_sizes[Limb.LEFT_FOOT], self._scale * _INSIDE
        room = surface.region.buffer(inside_by - half.min())
        if surface.region.buffer(inside_by - np.hypot(*half)).is_empty:  # too narrow for some heading
            # Within half the spacing of the headings, a sole contains one that is so much smaller.
            within = np.maximum(half - np.sin(np.pi / 2 / _HEADINGS) * half[::-1] - inside_by, 1e-4)
            turns = np.pi * np.arange(_HEADINGS) / _HEADINGS
            axes = np.column_stack([np.cos(turns), np.sin(turns)])
            room = room.intersection(shapely.union_all([eroded(surface, axis, within) for axis in axes]))
        room = room.buffer(inside_by + np.sqrt(0.5) * self._cell / surface.normal[2])
        return None if room.is_empty else room

    def _ground(self, rooms: Sequence[tuple[Surface, BaseGeometry]]) -> np.ndarray:
        """(nx, ny, L) m; heights at which the centre of a sole may be in a cell, -inf where there is none."""
        levels = np.full((*self._shape, _LEVELS), -np.inf)
        for surface, near in rooms:
            normal, origin = surface.normal, surface.pose.position
            flat = shapely.get_coordinates(near)
            corners = surface.pose @ np.column_stack([flat, np.zeros(len(flat))])
            first = np.clip(np.floor((corners[:, :2].min(0) - self._corner) / self._cell), 0, self._shape).astype(int)
            last = np.clip(np.ceil((corners[:, :2].max(0) - self._corner) / self._cell) + 1, 0, self._shape).astype(int)
            i, j = (axis.ravel() for axis in np.mgrid[first[0] : last[0], first[1] : last[1]])
            x, y = self._corner[:, None] + self._cell * np.stack([i, j])
            height = plane_height(origin, normal, x, y)
            local = (np.column_stack([x, y, height]) - origin) @ surface.pose.rotation
            inside = shapely.contains_xy(near, local[:, 0], local[:, 1])
            enter_heights(levels, i[inside], j[inside], height[inside], self._merge)
        return levels

    def _mark(self, robot: RobotModel) -> None:
        """Find out where the trunk has room."""
        heights, trunk = self._levels[self._levels > -np.inf], Trunk.of(robot, 0.0)
        around, far = self._scale * _AROUND, self._corner + self._cell * self._shape
        low = np.array([*(self._corner - around), heights.min() + trunk.bottom - trunk.sink - around])
        high = np.array([*(far + around), heights.max() + trunk.top + around])
        occupancy = Occupancy.of(self._world.mujoco_model, low, high, self._cell / 2)
        trunk = Trunk.of(robot, self._cell + occupancy.cell)
        if trunk.radius <= 0.0:
            self._free[:] = self._levels > -np.inf
            return
        mark_free(self._levels, self._corner, self._cell, occupancy, trunk, self._rise, self._merge, self._free)

    def place(self, start: Pose) -> tuple[str, np.ndarray] | None:
        """What keeps the robot from the goal, "goal", "ground" or "body", and (2,) m where; None where nothing must."""
        if not self._known:
            return None
        if not self._goal.any():
            return "goal", self._world.goal.position[:2]
        for what, free in (("ground", self._levels > -np.inf), ("body", self._free)):
            found = self._split(start, free)
            if found is not None:
                return what, found
        return None

    def _split(self, start: Pose, free: np.ndarray) -> np.ndarray | None:
        """(2,) m; where free ground leads from start and goal come nearest to each other; None where they meet."""
        near = np.abs(self._levels - start.position[2]) <= self._scale * _UNEVEN
        at_start = self._within(start.position[:2], self._scale * _START)[..., None] & near & free
        from_goal, from_start = (self._flooded(places, free) for places in (self._goal & free, at_start))
        if (from_goal & from_start).any():
            return None
        ends = [np.argwhere(reached.any(2)) for reached in (from_goal, from_start)]
        if not all(len(end) for end in ends):  # start or goal themselves are blocked
            return (start.position if len(ends[0]) else self._world.goal.position)[:2]
        from scipy.spatial import KDTree  # here, since it takes long to import

        apart, nearest = map(np.asarray, KDTree(ends[0]).query(ends[1]))
        ties = np.flatnonzero(apart == apart.min())
        places = (ends[1][ties] + ends[0][nearest[ties]]) / 2
        middle = places[np.argmin(np.hypot(*(places - places.mean(0)).T))]
        return self._corner + self._cell * middle

    def _within(self, place: np.ndarray, radius: float) -> np.ndarray:
        """(nx, ny) bool; cells within a radius of a place, both in m."""
        middle = np.stack(np.meshgrid(*(np.arange(k) for k in self._shape), indexing="ij"), -1) * self._cell
        return np.hypot(*np.moveaxis(self._corner + middle - place, -1, 0)) <= radius

    def _flooded(self, places: np.ndarray, free: np.ndarray) -> np.ndarray:
        """(nx, ny, L) bool; what can be reached from places (nx, ny, L)."""
        reached = places.copy()
        flood(self._levels, free, self._rise, self._beyond, reached)
        return reached
