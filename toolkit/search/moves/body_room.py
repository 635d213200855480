"""BodyRoom: where the world lets the CoM be along a motion: below ceilings, and between walls that are near."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.problem import CentroidalProblem, ComRoom
from toolkit.compiled import compiled
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import FEET
from toolkit.robot.model import RobotModel
from toolkit.search.moves.foot_collision import FootCollision
from toolkit.search.moves.legs import Legs, legs_of, reach
from toolkit.search.moves.limits import drops, margins
from toolkit.search.moves.obstacles import world_triangles
from toolkit.search.moves.occupancy import BodyBox, Occupancy, body_free, edge_of
from toolkit.search.moves.shanks import Shanks, leg_free, shanks_of
from toolkit.search.moves.shin_room import ShinRoom
from toolkit.world.world import World

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_CELL = 0.025  # m; edge of the cells
_AROUND = 1.0  # m around the feet that are looked at
_SLACK = np.array([1.0, 1.0, 0.3])  # m; the cells that are made reach farther by this than what is looked at
_AHEAD, _ASIDE = 0.12, 0.05  # m; the CoM may be so far from the middle of the feet when it meets a ceiling
_FAR, _STEP = 0.12, 0.01  # m; walls farther away do not matter; spacing of tries
_LEAST, _SWAY = 0.015, 0.05  # m; room that is left along the heading and across it, where walking needs more
_ARM = 0.03  # m by which arms give way: upper arms, which hang from the shoulders, hardly do
_SIDES = 4  # ahead, left, back, right


class _Walker(NamedTuple):
    """The robot as the kernels see it.

    Attributes:
        legs, shanks, box: See `toolkit.search.moves.screen.Body`.
        com_height: m; height of the CoM above the soles at home.
        deepest: m; the most that the CoM sinks.
        scale: Factor on lengths.
    """

    legs: Legs
    shanks: Shanks
    box: BodyBox
    com_height: float
    deepest: float
    scale: float


class BodyRoom:
    """The room of one robot's body in one world; see `toolkit.centroidal.surroundings.Surroundings`.

    The body is an upright box over the middle of the feet. Its top sinks with the CoM. Where walls before or behind it
    are near, as for a robot that passes a slot sideways, knees and thighs count as well. To the sides the body is
    narrower, since arms give way.
    """

    def __init__(self, robot: RobotModel, world: World):
        self._robot, self._world = robot, world
        box = BodyBox.of(robot)
        self._walker = _Walker(
            legs_of(robot, margins(robot)),
            shanks_of(robot),
            box,
            robot.com_height,
            float(drops(robot)[-1]),
            robot.scale.length,
        )
        self._occupancy: Occupancy | None = None  # made when the first triangle is where the body is
        self._bounds = np.stack([np.full(3, np.inf), np.full(3, -np.inf)])  # m; of the occupancy
        self._triangles = np.zeros((0, 3, 3))  # m; of the world within these bounds
        self._corners = np.zeros((2, 0, 3))  # m; of the boxes around them
        self._shins = ShinRoom(robot, world)

    def sink(self, stance: Stance) -> float:
        """See `Surroundings`."""
        feet = stance.mean_feet
        place, yaw = feet.position[None], np.array([feet.yaw])
        sink, occupancy = np.zeros(1), self._around(place)
        if occupancy is not None:
            _fill_sinks(occupancy, self._walker, place, yaw, sink)
        return float(sink[0])

    @cached_property
    def _feet(self) -> FootCollision | None:
        """The collisions of the feet, made when the first landing is to move."""
        return FootCollision.of(self._robot, self._world)

    def leans(self, problem: CentroidalProblem) -> np.ndarray | None:
        """See `Surroundings`."""
        return self._shins.leans(problem)

    def foot_hits(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """See `Surroundings`."""
        return np.zeros(len(position), bool) if self._feet is None else self._feet.hits(position, rotation)

    def room(self, problem: CentroidalProblem) -> ComRoom | None:
        """See `Surroundings`."""
        feet = _feet(problem)
        places, yaw = feet.mean(1), np.ascontiguousarray(problem.yaw)
        occupancy = self._around(places)
        if occupancy is None:
            return None
        sink, reach = np.zeros(len(places)), np.full((len(places), _SIDES), np.inf)
        _fill_sinks(occupancy, self._walker, places, yaw, sink)
        on = np.pad(problem.active[:, : len(FEET)], ((1, 1), (0, 0)))
        standing = on[:-1] | on[1:]
        later = np.minimum(np.arange(len(places)), problem.steps - 1)
        turns = np.ascontiguousarray(problem.rotation[later][:, : len(FEET)])
        _fill_reach(occupancy, self._walker, places, yaw, sink, feet, turns, standing, reach)
        low, near = np.flatnonzero(sink > 0.0), np.isfinite(reach)
        if not (len(low) or near.any()):
            return None
        up = np.tile([0.0, 0.0, 1.0], (len(low), 1))
        knots, normals = [low], [up]
        bounds = [places[low, 2] + self._walker.com_height - sink[low]]
        for side in range(_SIDES):
            at = np.flatnonzero(near[:, side])
            bearing = yaw[at] + side * np.pi / 2
            normal = np.column_stack([np.cos(bearing), np.sin(bearing), np.zeros(len(at))])
            knots.append(at)
            normals.append(normal)
            bounds.append((normal * places[at]).sum(1) + reach[at, side])
        return ComRoom(sink, np.concatenate(knots), np.concatenate(normals), np.concatenate(bounds))

    def _around(self, places: np.ndarray) -> Occupancy | None:
        """Cells around places (n, 3) m; None where nothing is there at the height of the body.

        The cells are made once for the whole way from start to goal, and again where a robot leaves them.
        """
        low, high = self._reached(places)
        if (low < self._bounds[0]).any() or (high > self._bounds[1]).any():
            world, slack = self._world, self._walker.scale * _SLACK
            first, last = self._reached(np.stack([world.start.position, world.goal.position]))
            first, last = (
                np.minimum.reduce([low, first, self._bounds[0]]),
                np.maximum.reduce([high, last, self._bounds[1]]),
            )
            self._bounds = np.stack([first - slack, last + slack])
            self._triangles, self._occupancy = world_triangles(world.mujoco_model, *self._bounds), None
            self._corners = np.stack([self._triangles.min(1), self._triangles.max(1)])
        bounds, cell = self._bounds, self._walker.scale * _CELL
        edge, corners = edge_of(bounds[0], bounds[1], cell), self._corners
        if not ((corners[1] >= low - edge) & (corners[0] <= high + edge)).all(1).any():
            return None
        if self._occupancy is None:
            self._occupancy = Occupancy.by(self._triangles, bounds[0], bounds[1], cell)
        occupancy = self._occupancy
        first, last = (np.floor((end - occupancy.corner) / occupancy.cell).astype(int) for end in (low, high))
        near = occupancy.below[first[0] : last[0] + 1, first[1] : last[1] + 1]
        return occupancy if (near[:, :, last[2] + 1] > near[:, :, first[2]]).any() else None

    def _reached(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3,) m each; corners of what a body may meet at places (n, 3) m."""
        box, around = self._walker.box, self._walker.scale * _AROUND
        return places.min(0) + [-around, -around, box.bottom], places.max(0) + [around, around, box.top]


def _feet(problem: CentroidalProblem) -> np.ndarray:
    """(N + 1, 2, 3) m; places of the feet at the knots, on the line between two contacts while they are in the air."""
    times, knots = problem.times, np.arange(problem.steps + 1)
    feet = np.empty((len(knots), len(FEET), 3))
    for foot in FEET:
        on = problem.active[:, foot]
        held = np.flatnonzero(np.append(on, False) | np.append(False, on))
        step = np.where(np.append(on, False)[held], held, held - 1)
        for axis in range(3):
            feet[:, foot, axis] = np.interp(times, times[held], problem.position[step, foot, axis])
    return feet


@compiled(kept=True)
def _fill_sinks(occupancy, walker, places, yaw, sink):
    """Fill sink (n,) m: by how much the CoM over places (n, 3) m with headings (n,) rad is lowered below ceilings.

    Columns that are occupied below the top of the lowest body are walls, of which ceilings know nothing.
    """
    corner, cell, below, box = occupancy.corner, occupancy.cell, occupancy.below, walker.box
    depth, width = box.half_depth + walker.scale * _AHEAD, box.half_width + walker.scale * _ASIDE
    for row in range(len(yaw)):
        x, y, z = places[row]
        c, s = np.cos(yaw[row]), np.sin(yaw[row])
        ex, ey = abs(c) * depth + abs(s) * width, abs(s) * depth + abs(c) * width
        most = below.shape[2] - 1
        first = min(max(int(np.floor((z + box.bottom - corner[2]) / cell)), 0), most)
        wall = min(max(int(np.floor((z + box.top - walker.deepest - corner[2]) / cell)), 0), most)
        last = min(max(int(np.ceil((z + box.top - corner[2]) / cell)), 0), most)
        i0, i1 = int(np.floor((x - ex - corner[0]) / cell)), int(np.floor((x + ex - corner[0]) / cell))
        j0, j1 = int(np.floor((y - ey - corner[1]) / cell)), int(np.floor((y + ey - corner[1]) / cell))
        lowest = last
        for i in range(max(i0, 0), min(i1, below.shape[0] - 1) + 1):
            for j in range(max(j0, 0), min(j1, below.shape[1] - 1) + 1):
                column = below[i, j]
                if column[last] == column[wall] or column[wall] > column[first]:
                    continue
                dx, dy = corner[0] + (i + 0.5) * cell - x, corner[1] + (j + 0.5) * cell - y
                if abs(c * dx + s * dy) <= depth and abs(-s * dx + c * dy) <= width:
                    k = wall
                    while column[k + 1] == column[wall]:
                        k += 1
                    lowest = min(lowest, k)
        if lowest < last:
            sink[row] = max(z + box.top - (corner[2] + lowest * cell), 0.0)


class _Posture(NamedTuple):
    """A posture for the kernels.

    Attributes:
        place: (3,) m; the middle of the feet.
        yaw: rad; heading.
        sink: m; by how much the CoM is lowered.
        feet, turns: (2, 3) m and (2, 3, 3); the soles.
        standing: (2,) bool; which of them bear a leg.
    """

    place: np.ndarray
    yaw: float
    sink: float
    feet: np.ndarray
    turns: np.ndarray
    standing: np.ndarray


@compiled(kept=True)
def _fill_reach(occupancy, walker, places, yaw, sink, feet, turns, standing, reached):
    """Fill reached (n, 4) m: how far the body can move ahead, left, back and right where walls are near.

    Where none is, inf stays. The arrays are those of `_Posture`, for n postures.
    """
    box = walker.box
    slim = BodyBox(box.half_depth, box.half_width - walker.scale * _ARM, box.bottom, box.top)
    for row in range(len(yaw)):
        posture = _Posture(places[row], yaw[row], sink[row], feet[row], turns[row], standing[row])
        for side in range(_SIDES):
            body = box if side % 2 == 0 else slim
            if _body_free(occupancy, body, posture, side, 0.0):
                reached[row, side] = _reach_of(occupancy, walker, body, posture, side)


@compiled
def _reach_of(occupancy, walker, body, posture, side):
    """How far a body can move to a side (see `_fill_reach`) in m; inf where it is far."""
    tries, step = int(_FAR / _STEP), walker.scale * _STEP
    half = tries * step / 2
    if _body_free(occupancy, _stretched(body, side, half), posture, side, half):
        return np.inf
    free = 0
    while free < tries and _body_free(occupancy, body, posture, side, (free + 1) * step):
        free += 1
    if free == tries:
        return np.inf
    if side % 2 == 1:
        return max(free * step, walker.scale * _SWAY)
    if _legs_free(occupancy, walker, posture, side, 0.0):
        bodies, free = free, 0
        while free < bodies and _legs_free(occupancy, walker, posture, side, (free + 1) * step):
            free += 1
    return max(free * step, walker.scale * _LEAST)


@compiled
def _stretched(body, side, by):
    """A body that is longer by so many m to a side and away from it, and a hair more."""
    more = by + 1e-9
    depth, width = (more, 0.0) if side % 2 == 0 else (0.0, more)
    return BodyBox(body.half_depth + depth, body.half_width + width, body.bottom, body.top)


@compiled
def _moved(posture, side, away):
    """The middle of the body that has moved so many m to a side."""
    bearing = posture.yaw + side * np.pi / 2
    return posture.place[0] + away * np.cos(bearing), posture.place[1] + away * np.sin(bearing), posture.place[2]


@compiled
def _body_free(occupancy, body, posture, side, away):
    """Whether a body is free where it has moved so many m to a side."""
    x, y, z = _moved(posture, side, away)
    return body_free(occupancy, body, x, y, z, posture.yaw, posture.sink)


@compiled
def _legs_free(occupancy, walker, posture, side, away):
    """Whether the legs that stand are free where the body has moved to a side; those that do not reach are."""
    x, y, z = _moved(posture, side, away)
    com = (x, y, z + walker.com_height - posture.sink)
    for foot in range(2):
        if posture.standing[foot]:
            code, points = reach(walker.legs, foot, com, posture.yaw, posture.feet[foot], posture.turns[foot])
            if code == 0 and not leg_free(occupancy, walker.shanks, points):
                return False
    return True
