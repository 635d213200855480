"""Flat facets of a triangle mesh: connected triangles of one plane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from toolkit.compiled import compiled
from toolkit.geometry.pose import Pose
from toolkit.world.overlay import united
from toolkit.world.relief import FLAT, off_relief, relief_of

if TYPE_CHECKING:
    import trimesh

_STRICT = 0.07  # part of the tolerances within which the seed of a facet is flat
_DEGENERATE = 1e-10  # m^2; smaller triangles belong to no facet
_PLANE = 1e-4  # m; corners that lie less apart are in a plane
_SPACING = 0.2  # m; distance of the seeds of overlapping facets
_DISCS = (0.26, 0.23, 0.2, 0.17)  # m; radii of those in which the mesh is smooth
_DISC_ANGLE, _DISC_DISTANCE = np.radians(10.0), 0.02  # rad, m; within which their triangles are grown
_SIDES, _ROUNDING = 16, (1.0, 0.9, 0.8)  # sides of a disc, and parts of its radius that are tried
_ROUGH = 1.5e-3  # m; where the mesh is further off its relief, a disc is not smooth
_ANGLE, _DISTANCE = np.radians(6.0), 2e-3  # rad, m; tolerances of overlapping facets that are not
_MANY = 100  # more triangles are merged along edges; for fewer the general union is as quick and allows overlaps


@dataclass(frozen=True)
class Facet:
    """Connected coplanar triangles.

    Attributes:
        frame: Frame of the plane (any_from_facet); z is the outward normal and the origin lies in the facet.
        polygon: Outline in the frame's xy, m; it may have holes.
        triangles: Indices of its triangles in the mesh, (k,) int.
        off: m; how far its triangles' corners lie apart along the normal.
        relief: The paraboloid nearest to them; see `toolkit.world.relief`.
    """

    frame: Pose
    polygon: Polygon
    triangles: np.ndarray
    off: float
    relief: np.ndarray


def plane_frame(origin: np.ndarray, normal: np.ndarray) -> Pose:
    """Frame with z along a unit normal (3,) and x along the projected x axis of the world (y if that is short)."""
    axis = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = axis - (axis @ normal) * normal
    x = x / np.linalg.norm(x)
    return Pose(np.stack([x, np.cross(normal, x), normal], axis=1), np.asarray(origin, float))


def find_facets(mesh: trimesh.Trimesh, *, angle: float, distance: float, least_area: float = 0.0) -> list[Facet]:
    """Flat facets of a mesh with merged vertices, ordered by the area of their seeds, largest first.

    Each facet grows over shared edges from a seed, a patch that is flat within a small part of the tolerances. A
    triangle joins if its normal is within `angle` rad of the seed's first triangle's and its corners are within
    `distance` m of that triangle's plane, so that a smoothly curved mesh does not become one facet, and slightly bent
    ground next to a flat patch takes nothing from it. The facet's plane is the area-weighted mean of its triangles.
    Degenerate triangles and facets smaller than `least_area` m^2 are left out.
    """
    return [facet_of(mesh, group) for group in flat_groups(mesh, angle=angle, distance=distance, least_area=least_area)]


def flat_groups(mesh: trimesh.Trimesh, *, angle: float, distance: float, least_area: float = 0.0) -> list[np.ndarray]:
    """Triangles (k,) of each flat facet of a mesh, in the order in which they joined; see `find_facets`."""
    table, area = _Triangles.of(mesh), mesh.area_faces
    free, seed_area = area > _DEGENERATE, area.copy()
    for patch in table.grown(np.argsort(-area, kind="stable"), free.copy(), _STRICT * angle, _STRICT * distance):
        seed_area[patch] = area[patch].sum()
    groups = table.grown(np.lexsort([-area, -seed_area]), free, angle, distance)
    return [group for group in groups if area[group].sum() >= least_area]


def with_overlapping(mesh: trimesh.Trimesh, facets: list[Facet], *, flat: float, least_area: float) -> list[Facet]:
    """Facets of a mesh, and more of its curved parts, which overlap each other: a sole finds its place between others.

    Around seeds that are `_SPACING` apart seen from above, these are the largest of the `_DISCS` in which the mesh is
    within `_ROUGH` m of a relief, or, where it is rough, what grows there as in `find_facets`. No seed is in one of the
    `facets` that are off their plane by at most `flat` m and at least as large as a square of that. Other `facets` are
    left out where a disc holds them whole.
    """
    table, area = _Triangles.of(mesh), mesh.area_faces
    free = area > _DEGENERATE
    curved, smooth = free & (mesh.face_normals[:, 2] > 0.0), np.zeros(len(free), bool)  # what faces down bears nothing
    for facet in facets:
        curved[facet.triangles] &= facet.off > flat or facet.polygon.area < _SPACING**2
    place = mesh.triangles_center[:, :2] / _SPACING
    near = np.flatnonzero(curved)
    near = near[np.argsort(np.abs(place[near] % 1.0 - 0.5).max(1), kind="stable")]  # to the middle of their cell
    _, first = np.unique(np.floor(place[near]), axis=0, return_index=True)
    known, found = {facet.triangles.tobytes() for facet in facets}, []
    for seed in near[first].tolist():
        facet = _disc(mesh, table, free, seed)
        if facet is not None:
            corners = facet.frame.inverse() @ mesh.triangles[facet.triangles].reshape(-1, 3)
            held = shapely.intersects_xy(facet.polygon, corners[:, 0], corners[:, 1]).reshape(-1, 3)
            smooth[facet.triangles[held.all(axis=1)]] = True
        else:
            facet = facet_of(mesh, table.around(seed, free, _ANGLE, _DISTANCE))
        if area[facet.triangles].sum() >= least_area and (key := facet.triangles.tobytes()) not in known:
            known.add(key)
            found.append(facet)
    return [facet for facet in facets if facet.off <= flat or not smooth[facet.triangles].all()] + found


def _disc(mesh: trimesh.Trimesh, table: _Triangles, free: np.ndarray, seed: int) -> Facet | None:
    """The largest smooth facet around a triangle whose triangles are `free`; None where the mesh is rough."""
    group = table.around(seed, free, _DISC_ANGLE, _DISC_DISTANCE)
    centre = mesh.triangles_center[seed]
    away = np.linalg.norm(mesh.triangles[group] - centre, axis=2).min(axis=1)
    for radius in _DISCS:
        facet = facet_of(mesh, group[(away <= radius) | (group == seed)])
        middle = facet.frame.inverse() @ centre
        points = facet.frame.inverse() @ _samples(mesh.triangles[facet.triangles])
        inside = np.linalg.norm(points - middle, axis=1) <= radius  # no point may be: a splinter is longer
        if np.abs(off_relief(facet.relief, points[inside])).max(initial=0.0) <= _ROUGH:
            return replace(facet, polygon=_rounded(facet.polygon, middle[:2], radius))
    return None


def _rounded(polygon: Polygon, centre: np.ndarray, radius: float) -> Polygon:
    """A regular polygon of nearly that radius in m around a centre (2,) where it fits in a ragged one, or that."""
    shapely.prepare(polygon)
    turns = 2 * np.pi * np.arange(_SIDES) / _SIDES
    for share in _ROUNDING:
        inner = Polygon(centre + share * radius * np.column_stack([np.cos(turns), np.sin(turns)]))
        if polygon.covers(inner):
            return inner
    return polygon


class _Triangles(NamedTuple):
    """A mesh as `_grow` reads it."""

    first: np.ndarray
    neighbours: np.ndarray
    normals: np.ndarray
    corners: np.ndarray

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> _Triangles:
        """The triangles of a mesh with merged vertices."""
        pairs = mesh.face_adjacency
        ends = pairs.ravel()
        order = np.argsort(ends, kind="stable")
        first = np.searchsorted(ends[order], np.arange(len(mesh.triangles) + 1))
        normals, corners = np.ascontiguousarray(mesh.face_normals), np.ascontiguousarray(mesh.triangles)
        return cls(first, pairs[:, ::-1].ravel()[order], normals, corners)

    def grown(self, seeds: np.ndarray, free: np.ndarray, angle: float, distance: float) -> list[np.ndarray]:
        """Groups (k,) of triangles that are `free` around seeds, at most one for each seed; then they are not free."""
        members, last = np.empty(len(free), np.int64), np.empty(len(seeds), np.int64)
        count = _grow(seeds, free, *self, float(np.cos(angle)), distance, members, last)
        return np.split(members[: last[count - 1]], last[: count - 1]) if count else []

    def around(self, seed: int, free: np.ndarray, angle: float, distance: float) -> np.ndarray:
        """The group (k,) around one triangle, in order of the triangles; they stay free."""
        (group,) = self.grown(np.array([seed]), free, angle, distance)
        free[group] = True
        return np.sort(group)


@compiled(kept=True, allocates=True)
def _grow(seeds, free, first, neighbours, normals, corners, cosine, distance, members, last):
    """Fill `members` with triangles, group by group, and `last` with the end of each group; return their number."""
    count, end = 0, 0
    stack = np.empty(len(free), np.int64)
    for seed in seeds:
        if not free[seed]:
            continue
        free[seed] = False
        members[end] = stack[0] = seed
        end, height = end + 1, 1
        while height > 0:
            height -= 1
            here = stack[height]
            for k in range(first[here], first[here + 1]):
                other = neighbours[k]
                if not free[other]:
                    continue
                alike, off = 0.0, 0.0
                for axis in range(3):
                    alike += normals[other, axis] * normals[seed, axis]
                if alike <= cosine:
                    continue
                for corner in range(3):
                    height_above = 0.0
                    for axis in range(3):
                        height_above += (corners[other, corner, axis] - corners[seed, 0, axis]) * normals[seed, axis]
                    off = max(off, abs(height_above))
                if off < distance:
                    free[other] = False
                    members[end] = stack[height] = other
                    end, height = end + 1, height + 1
        last[count] = end
        count += 1
    return count


def facet_of(mesh: trimesh.Trimesh, group: np.ndarray) -> Facet:
    """The facet that a group of triangles (k,) of a mesh makes."""
    corners, area = mesh.triangles[group], mesh.area_faces[group]
    weight = area / area.sum()
    normal = weight @ mesh.face_normals[group]
    frame = plane_frame(weight @ corners.mean(axis=1), normal / np.linalg.norm(normal))
    flat = frame.inverse() @ corners
    shape = _union(flat[..., :2]) if len(flat) > 1 else Polygon(flat[0, :, :2])
    if not isinstance(shape, Polygon):  # the pieces touch only in points, and the largest is kept
        parts = [part for part in shapely.get_parts(shapely.make_valid(shape)) if isinstance(part, Polygon)]
        shape = max(parts, key=lambda part: part.area, default=Polygon())
    off = float(np.ptp(flat[..., 2]))
    return Facet(frame, shape, np.sort(group), off, _relief(flat) if off > _PLANE else FLAT)


def _relief(triangles: np.ndarray) -> np.ndarray:
    """The relief of triangles (k, 3, 3) m in the frame of a facet; none where the plane is as near to them."""
    points = _samples(triangles)
    relief = relief_of(points)
    return relief if np.abs(off_relief(relief, points)).max() < np.abs(points[:, 2]).max() else FLAT


def _samples(triangles: np.ndarray) -> np.ndarray:
    """Points (6 k, 3) of triangles (k, 3, 3): the corners, and the middles of the sides."""
    return np.concatenate([triangles, (triangles + np.roll(triangles, 1, axis=1)) / 2]).reshape(-1, 3)


def _union(triangles: np.ndarray) -> BaseGeometry:
    """Union of triangles (k, 3, 2); many triangles are merged along their edges if they do not overlap."""
    shapes = shapely.polygons(triangles)
    if len(triangles) > _MANY:
        merged = shapely.coverage_union_all(shapes)
        if abs(merged.area - shapely.area(shapes).sum()) < 1e-9 * merged.area:
            return merged
    return united(shapes)
