"""The world's colliding geometry as convex solids, and the shadow they cast on a plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
import shapely

from toolkit.geometry.pose import Pose
from toolkit.geometry.triangles import ball, capsule_points, height_field_triangles, mesh_vertices

_WIDE = 100.0  # m; width and depth of the half space under a plane beyond the square
_SIDES = 48  # sides of a prism that replaces a cylinder
_DIVISIONS = 3  # of a `ball` that replaces a sphere


@dataclass(frozen=True)
class Solids:
    """Convex solids by their vertices and edges.

    Attributes:
        points: Vertices in the world frame, solid after solid, (n, 3) float, m.
        low, high: Boxes around the solids along the axes of the world, (s, 3) float, m.
        edges: Pairs of vertices, (k, 2) int, with all convex edges of the solids among them.
        edge_first: Solid i has the edges from edge_first[i] to edge_first[i + 1]; (s + 1,) int.
        first: The first solid of each geom, by the geom's number.
    """

    points: np.ndarray
    low: np.ndarray
    high: np.ndarray
    edges: np.ndarray
    edge_first: np.ndarray
    first: dict[int, int]

    def shadows(
        self,
        frames: Sequence[Pose],
        bounds: np.ndarray,
        low: float,
        high: float,
        own: Sequence[tuple[int, np.ndarray] | None] = (),
    ) -> tuple[np.ndarray, np.ndarray]:
        """Project the parts of the solids between two heights above each plane on that plane.

        Args:
            frames: World_from_plane poses of n planes; z is the normal.
            bounds: Bounds xmin, ymin, xmax, ymax in each plane, (n, 4) float, m; solids outside are left out.
            low: The lower height, m.
            high: The upper height, m.
            own: By plane, the solids that cast no shadow on it: the number of a geom, and the places among its solids.

        Returns:
            Ascending indices of planes (k,) int, and polygons (k,) in their xy, one per solid that covers an area.
        """
        turn, origin = np.array([frame.rotation for frame in frames]), np.array([frame.position for frame in frames])
        corners = [
            [bounds[:, x], bounds[:, y], np.full(len(bounds), z)] for x in (0, 2) for y in (1, 3) for z in (low, high)
        ]
        room = np.einsum("nij,cjn->nci", turn, np.array(corners)) + origin[:, None]
        least, most = room.min(axis=1), room.max(axis=1)
        pairs = self._boxes.query(shapely.box(least[:, 0], least[:, 1], most[:, 0], most[:, 1]))
        plane, solid = pairs[:, np.lexsort(pairs[::-1])]
        near = (self.high[solid] > least[plane]).all(axis=1) & (self.low[solid] < most[plane]).all(axis=1)
        plane, solid = plane[near], solid[near]
        skipped = [len(self.low) * k + self.first[part[0]] + part[1] for k, part in enumerate(own) if part is not None]
        if skipped:
            others = ~np.isin(len(self.low) * plane + solid, np.concatenate(skipped))
            plane, solid = plane[others], solid[others]
        edges, pair = _ranges(self.edge_first, solid)
        inverse = np.array([frame.inverse().position for frame in frames])
        ends, on = self.edges[edges], plane[pair]
        height = np.stack([(self.points[end] * turn[on, :, 2]).sum(1) + inverse[on, 2] for end in ends.T], axis=1)
        rise = height[:, 1] - height[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            at_low, at_high = (low - height[:, 0]) / rise, (high - height[:, 0]) / rise
        level = np.abs(rise) < 1e-12
        enter = np.where(level, 0.0, np.clip(np.minimum(at_low, at_high), 0.0, 1.0))
        leave = np.where(level, 1.0, np.clip(np.maximum(at_low, at_high), 0.0, 1.0))
        inside = np.where(level, (height[:, 0] > low) & (height[:, 0] < high), leave > enter)
        enter, leave, ends, pair, on = enter[inside], leave[inside], ends[inside], pair[inside], on[inside]
        if len(pair) == 0:
            return np.empty(0, int), np.empty(0, object)
        ends = self.points[ends] @ turn[on, :, :2] + inverse[on, None, :2]
        along = ends[:, 1] - ends[:, 0]
        cut = ends[:, :1] + np.stack([enter, leave], axis=1)[:, :, None] * along[:, None]
        kept, rank = np.unique(pair, return_inverse=True)
        hulls = np.asarray(shapely.convex_hull(shapely.linestrings(cut.reshape(-1, 2), indices=np.repeat(rank, 2))))
        filled = (shapely.get_type_id(hulls) == 3) & (shapely.area(hulls) > 1e-10)
        return plane[kept[filled]], hulls[filled]

    @cached_property
    def _boxes(self) -> shapely.STRtree:
        """The solids' boxes seen from above."""
        return shapely.STRtree(shapely.box(self.low[:, 0], self.low[:, 1], self.high[:, 0], self.high[:, 1]))


def solids_of(model: mujoco.MjModel, *, square: tuple[float, ...]) -> Solids:
    """Convex solids of all colliding geoms of a compiled world whose meshes are convex.

    Planes are half spaces, whatever their drawn size, because MuJoCo collides them so; here they reach far beyond the
    square (xmin, ymin, xmax, ymax) in m. Cylinders become prisms around the circle, and spheres, capsules and
    ellipsoids become polyhedra around them. A height field becomes one prism per triangle, as MuJoCo collides it.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points, edges, counts, total = [np.zeros((0, 3))], [np.zeros((0, 2), int)], [], 0
    starts, solids = {}, 0
    for index in np.flatnonzero((model.geom_contype | model.geom_conaffinity) != 0).tolist():
        pose = Pose(data.geom_xmat[index].reshape(3, 3), data.geom_xpos[index])
        starts[index] = solids
        for corners, sides in _local_solids(model, index, pose, square):
            many, each = corners.shape[:2]
            first = total + each * np.arange(many)[:, None, None]
            points.append((pose @ corners).reshape(-1, 3))
            edges.append((first + sides).reshape(-1, 2))
            counts.append(np.tile([each, len(sides)], (many, 1)))
            total += many * each
            solids += many
    numbers = np.concatenate([np.zeros((1, 2), int), *counts])
    points, (point_first, edge_first) = np.concatenate(points), np.cumsum(numbers, axis=0).T
    return Solids(
        points,
        np.minimum.reduceat(points, point_first[:-1]) if len(points) else points,
        np.maximum.reduceat(points, point_first[:-1]) if len(points) else points,
        np.concatenate(edges),
        edge_first,
        starts,
    )


def plane_rectangle(pose: Pose, square: tuple[float, ...]) -> np.ndarray:
    """Corners (4, 2) float in the frame of a plane geom that cover the world's square (m) in that plane."""
    x0, y0, x1, y1 = square
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    normal = pose.normal
    reach = np.hypot(x1 - x0, y1 - y0)
    if abs(normal[2]) > 0.1:  # the corners of the square, projected along z
        z = pose.position[2] - ((corners - pose.position[:2]) @ normal[:2]) / normal[2]
        low, high = _extent(pose.inverse() @ np.column_stack([corners, z]))
    else:  # a wall: a rectangle as wide as the square and as high as it is wide
        low, high = _extent(pose.inverse() @ np.column_stack([corners, np.zeros(4)]))
        middle = (low + high) / 2
        low, high = middle - reach / 2, middle + reach / 2
    return np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])


def _extent(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest xy of points (n, 3)."""
    return points[:, :2].min(axis=0), points[:, :2].max(axis=0)


def _ranges(first: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices in the ranges first[i] to first[i + 1] of the chosen i, and the position in `chosen` of each index."""
    counts = first[chosen + 1] - first[chosen]
    owner = np.repeat(np.arange(len(chosen)), counts)
    return np.arange(len(owner)) + (first[chosen] - np.cumsum(counts) + counts)[owner], owner


def _local_solids(model, index: int, pose: Pose, square: tuple[float, ...]):
    """Blocks of a geom's convex solids with equal edges: points (m, n, 3) in the geom's frame and edges (k, 2)."""
    kind, size = model.geom_type[index], model.geom_size[index]
    types = mujoco.mjtGeom
    if kind == types.mjGEOM_PLANE:
        x0, y0, x1, y1 = square
        wide = plane_rectangle(pose, (x0 - _WIDE, y0 - _WIDE, x1 + _WIDE, y1 + _WIDE))
        return [_hull(_extruded(wide, -_WIDE, 0.0))]
    if kind == types.mjGEOM_BOX:
        return [(_CUBE[None] * size, _CUBE_EDGES)]
    if kind == types.mjGEOM_CYLINDER:
        angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
        circle = size[0] / np.cos(np.pi / _SIDES) * np.column_stack([np.cos(angle), np.sin(angle)])
        return [_hull(_extruded(circle, -size[1], size[1]))]
    if kind == types.mjGEOM_SPHERE:
        return [_hull(ball(_DIVISIONS)[0] * size[0])]
    if kind == types.mjGEOM_ELLIPSOID:
        return [_hull(ball(_DIVISIONS)[0] * size)]
    if kind == types.mjGEOM_CAPSULE:
        return [_hull(capsule_points(size[0], size[1], _DIVISIONS))]
    if kind == types.mjGEOM_MESH:
        return [_hull(mesh_vertices(model, int(model.geom_dataid[index])).astype(float))]
    if kind == types.mjGEOM_HFIELD:
        points, triangles = height_field_triangles(model, int(model.geom_dataid[index]))
        top = points[triangles]
        foot = top * [1, 1, 0] + [0, 0, -model.hfield_size[model.geom_dataid[index], 3]]
        return [(np.concatenate([foot, top], axis=1), _PRISM_EDGES)]
    return []


def _extruded(ring: np.ndarray, low: float, high: float) -> np.ndarray:
    """Vertices (2 k, 3) of a prism over a ring (k, 2)."""
    return np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in (low, high)])


def _hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The convex hull of points (n, 3) as a block of one solid: vertices (1, m, 3) and edges (k, 2)."""
    from scipy.spatial import ConvexHull  # here, since it takes long to import

    hull = ConvexHull(points)
    index = np.full(len(points), -1)
    index[hull.vertices] = np.arange(len(hull.vertices))
    edges = np.sort(index[hull.simplices][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return points[hull.vertices][None], np.unique(edges, axis=0)


_CUBE = np.array([[x, y, z] for z in (-1.0, 1.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
_CUBE_EDGES = np.array([[i, (i + 1) % 4] for i in range(4)] * 2 + [[i, i + 4] for i in range(4)])
_CUBE_EDGES[4:8] += 4
_PRISM_EDGES = np.array([[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]])
