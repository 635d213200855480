"""How far the shin over a contact may lean towards the toes before it meets what stands in front of the foot.

A foot that stands at a riser leaves its shin less room than the ankle has: the knee that goes over the toes meets the
nose. In the sole's frame, with the ankle as origin, a point (x, y, z) is met by a capsule of radius s at the lean

    lambda = atan2(x, z) - asin(w / r),    w^2 = s^2 - y^2,    r^2 = x^2 + z^2,

or, where it meets the end of the shin, whose length is l, with acos((r^2 + l^2 - w^2) / (2 r l)) in place of asin. And
what stands in front of the foot is the part of the world's triangles within the width of the shin, above the ankle,
ahead of it, and no farther than the knee.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from toolkit.centroidal.problem import CentroidalProblem
from toolkit.compiled import compiled
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel
from toolkit.search.moves.obstacles import world_triangles
from toolkit.search.moves.occupancy import Occupancy
from toolkit.search.moves.shanks import ball_free
from toolkit.world.world import World

_SIZES = (0.1, 0.4, 2.0)  # m; half of the diagonal of the triangles in each class; few are larger
_AROUND = 2.0  # m around start, goal and all bounded geoms, as far as planes count
# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_CLEAR = 0.02  # m; kept free around shins
_HELP = 0.1  # rad; what the base helps by where it leans back
_ABOVE = 0.02  # m above the ankle; what is lower is left to the feet
_KEPT = 50_000  # leans that are remembered
_POINTS, _STRIPS = 12, 4  # points that are looked at of an edge as long as the shin; strips along the shin
_CORNERS = 16  # most corners of a triangle that five planes have cut


class ShinRoom:
    """The room of one robot's shins in one world."""

    def __init__(self, robot: RobotModel, world: World):
        self._robot, self._world, length = robot, world, robot.scale.length
        self._radius, self._above = float(robot.leg_radii[1]) + length * _CLEAR, length * _ABOVE
        self._known: dict[tuple, float] = {}

    def leans(self, problem: CentroidalProblem) -> np.ndarray | None:
        """See `toolkit.centroidal.surroundings.Surroundings`."""
        leans = np.full((problem.steps, len(FEET)), np.inf)
        for foot in FEET:
            on = np.flatnonzero(problem.active[:, foot])
            position, rotation = problem.position[on, foot], problem.rotation[on, foot]
            first = np.ones(len(on), bool)
            first[1:] = (position[1:] != position[:-1]).any(1) | (rotation[1:] != rotation[:-1]).any((1, 2))
            found = self._remembered(foot, position[first], rotation[first])
            leans[on, foot] = np.repeat(found, np.diff(np.flatnonzero(np.append(first, True))))
        return leans if np.isfinite(leans).any() else None

    def _remembered(self, foot: Limb, position: np.ndarray, rotation: np.ndarray) -> list[float]:
        """See `over`; a local search asks for the same contacts again and again."""
        keys = [(foot, place.tobytes(), turn.tobytes()) for place, turn in zip(position, rotation, strict=True)]
        new = [row for row, key in enumerate(keys) if key not in self._known]
        if len(self._known) + len(new) > _KEPT:
            self._known.clear()
            new = list(range(len(keys)))
        for row, lean in zip(new, self.over(foot, position[new], rotation[new]).tolist(), strict=True):
            self._known[keys[row]] = lean
        return [self._known[key] for key in keys]

    def beside(self, foot: Limb, position: np.ndarray, occupancy: Occupancy) -> np.ndarray:
        """(n,) bool; whether anything as high as an ankle is near soles at (n, 3) m, by the occupied cells: quickly."""
        leg, found = self._robot.legs[foot], np.zeros(len(position), bool)
        _fill_beside(occupancy, position, leg.ankle_in_sole[2] + self._above, leg.shin + self._radius, found)
        return found

    def over(self, foot: Limb, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """(n,) rad; how far the shin may lean over soles at (n, 3) m with world_from_sole (n, 3, 3); inf: any angle."""
        leg, leans = self._robot.legs[foot], np.full(len(position), np.inf)
        if not len(position):
            return leans
        ankle = position + rotation @ leg.ankle_in_sole
        far = leg.shin + self._radius  # what a shin meets lies in a quarter of a disc
        middle, reach = ankle + rotation @ [far / 2, 0.0, far / 2], np.hypot(far / np.sqrt(2.0), self._radius)
        sole, near = self._index.near(middle, reach)
        _fill_leans(self._triangles, sole, near, ankle, rotation, (self._radius, self._above, leg.shin), leans)
        return leans + _HELP

    @cached_property
    def _triangles(self) -> np.ndarray:
        """(t, 3, 3) m; the world's triangles."""
        world, model = self._world, self._world.mujoco_model
        places = np.stack([world.start.position, world.goal.position, *(s.pose.position for s in world.surfaces)])
        reach = 2.0 * float(model.stat.extent) + _AROUND
        return np.ascontiguousarray(world_triangles(model, places.min(0) - reach, places.max(0) + reach))

    @cached_property
    def _index(self) -> _Index:
        """Where the triangles are."""
        return _Index(self._triangles)


class _Index:
    """Finds the triangles (t, 3, 3) m that are near points, in classes of about the same size."""

    def __init__(self, triangles: np.ndarray):
        from scipy.spatial import KDTree  # here, since it takes long to import

        low, high = triangles.min(1), triangles.max(1)
        middle, half = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2
        size = np.searchsorted(_SIZES, half)
        classes = [np.flatnonzero(size == number) for number in range(len(_SIZES))]
        self._trees = [(rows, float(half[rows].max()), KDTree(middle[rows])) for rows in classes if len(rows)]
        self._large = np.flatnonzero(size == len(_SIZES))
        self._low, self._high = low[self._large], high[self._large]

    def near(self, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a point of (n, 3) m and a triangle that may be within a reach in m, (k,) int each."""
        beside = np.maximum(points[:, None] - self._high, self._low - points[:, None]).max(2)
        point, large = np.nonzero(beside < reach)
        pairs = [(point, self._large[large])]
        for rows, most, tree in self._trees:
            found = tree.query_ball_point(points, reach + most)
            count = [len(each) for each in found]
            pairs.append((np.repeat(np.arange(len(points)), count), rows[np.concatenate(found).astype(int)]))
        sole, near = (np.concatenate(part) for part in zip(*pairs, strict=True))
        return sole, near


@compiled(kept=True)
def _fill_beside(occupancy, position, above, reach, found):
    """Fill found (n,) bool: whether a cell within a reach in m of soles (n, 3) m is more than so many m above them."""
    for row in range(len(position)):
        x, y, z = position[row]
        found[row] = not ball_free(occupancy, x, y, z + above + reach, reach + occupancy.cell / 2)


@compiled(kept=True, allocates=True)
def _fill_leans(triangles, sole, near, ankle, rotation, sizes, leans):
    """Fill leans (n,) rad with the least at which a shin meets a triangle.

    The pairs of a sole (k,) int and a triangle near it (k,) int are looked at; triangles (t, 3, 3) m are in the world,
    as ankles (n, 3) m and the rotations world_from_sole (n, 3, 3) are. The sizes in m are the radius of the shin, the
    height above the ankle at which it begins, and its length.
    """
    radius, above, shin = sizes
    a, b, c = np.empty((_CORNERS, 3)), np.empty((_CORNERS, 3)), np.empty((_CORNERS, 3))
    for pair in range(len(sole)):
        n, t = sole[pair], near[pair]
        if _seen_along(triangles[t], ankle[n], rotation[n], 2, a) < above:
            continue
        if _seen_along(triangles[t], ankle[n], rotation[n], 0, a) < 0.0:
            continue
        _seen_along(triangles[t], ankle[n], rotation[n], 1, a)
        count = _cut(a, 3, b, 2, -1.0, -above)
        count = _cut(b, count, a, 0, -1.0, 0.0)
        count = _cut(a, count, b, 2, 1.0, shin + radius)
        for strip in range(_STRIPS):  # of the shin's width, so that there are edges in the middle of faces
            left = radius * (2.0 * strip / _STRIPS - 1.0)
            part = _cut(b, count, a, 1, -1.0, -left)
            part = _cut(a, part, c, 1, 1.0, left + 2.0 * radius / _STRIPS)
            for corner in range(part):
                leans[n] = min(leans[n], _lean_along(c[corner], c[(corner + 1) % part], radius, shin))


@compiled
def _seen_along(triangle, ankle, rotation, axis, seen):
    """Fill a coordinate of the corners of a triangle (3, 3) m in the sole's frame, and return the greatest."""
    most = -np.inf
    for corner in range(3):
        seen[corner, axis] = 0.0
        for k in range(3):
            seen[corner, axis] += rotation[k, axis] * (triangle[corner, k] - ankle[k])
        most = max(most, seen[corner, axis])
    return most


@compiled
def _cut(corners, count, cut, axis, sign, bound):
    """Fill the corners of the part of a polygon whose coordinate along an axis, times the sign, is at most a bound."""
    made = 0
    for k in range(count):
        here, there = corners[k], corners[(k + 1) % count]
        inside, outside = sign * here[axis] - bound, sign * there[axis] - bound
        if inside <= 0.0:
            for each in range(3):
                cut[made, each] = here[each]
            made += 1
        if (inside < 0.0 < outside) or (outside < 0.0 < inside):
            part = inside / (inside - outside)
            for each in range(3):
                cut[made, each] = here[each] + part * (there[each] - here[each])
            made += 1
    return made


@compiled
def _lean_along(here, there, radius, shin):
    """The least lean in rad at which a shin meets points of an edge from one corner (3,) m up to the next."""
    u, v, w = there[0] - here[0], there[1] - here[1], there[2] - here[2]
    points = int(np.sqrt(u * u + v * v + w * w) / shin * _POINTS) + 1
    least = np.inf
    for k in range(points):
        part = k / points
        least = min(least, _lean_at(here[0] + part * u, here[1] + part * v, here[2] + part * w, radius, shin))
    return least


@compiled
def _lean_at(x, y, z, radius, shin):
    """The lean in rad, at least 0, at which a shin meets a point in m before it; inf where it is beyond the knee."""
    far, wide = np.sqrt(x * x + z * z), np.sqrt(max(radius * radius - y * y, 0.0))
    if far >= shin + wide:
        return np.inf
    if far <= wide:
        return 0.0
    if far * far <= shin * shin + wide * wide:
        between = np.arcsin(wide / far)
    else:
        between = np.arccos((far * far + shin * shin - wide * wide) / (2.0 * far * shin))
    return max(np.arctan2(x, z) - between, 0.0)
