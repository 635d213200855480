"""Flat facets of a triangle mesh: connected triangles of one plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry import Polygon

from toolkit.compiled import compiled
from toolkit.geometry.pose import Pose
from toolkit.world.overlay import united

if TYPE_CHECKING:
    import trimesh

_STRICT = 0.07  # part of the tolerances within which the seed of a facet is flat
_MANY = 100  # more triangles are merged along edges; for fewer the general union is as quick and allows overlaps


@dataclass(frozen=True)
class Facet:
    """Connected coplanar triangles.

    Attributes:
        frame: Frame of the plane (any_from_facet); z is the outward normal and the origin lies in the facet.
        polygon: Outline in the frame's xy, m; it may have holes.
        triangles: Indices of its triangles in the mesh, (k,) int.
        off: m; how far its triangles' corners lie apart along the normal.
    """

    frame: Pose
    polygon: Polygon
    triangles: np.ndarray
    off: float


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
    area = mesh.area_faces
    pairs = mesh.face_adjacency
    ends = pairs.ravel()
    order = np.argsort(ends, kind="stable")
    first, neighbours = np.searchsorted(ends[order], np.arange(len(area) + 1)), pairs[:, ::-1].ravel()[order]
    normals, corners = np.ascontiguousarray(mesh.face_normals), np.ascontiguousarray(mesh.triangles)

    def grown(seeds: np.ndarray, part: float) -> list[np.ndarray]:
        members, last = np.empty(len(area), np.int64), np.empty(len(area), np.int64)
        within = float(np.cos(part * angle)), part * distance
        count = _grow(seeds, area > 1e-10, first, neighbours, normals, corners, *within, members, last)
        return np.split(members[: last[count - 1]], last[: count - 1]) if count else []

    seed_area = area.copy()
    for patch in grown(np.argsort(-area, kind="stable"), _STRICT):
        seed_area[patch] = area[patch].sum()
    groups = grown(np.lexsort([-area, -seed_area]), 1.0)
    return [group for group in groups if area[group].sum() >= least_area]


@compiled(kept=True, allocates=True)
def _grow(seeds, free, first, neighbours, normals, corners, cosine, distance, members, last):
    """Fill `members` with triangles, group by group, and `last` with the end of each group; return their number."""
    count, end = 0, 0
    stack = np.empty(len(seeds), np.int64)
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
    return Facet(frame, shape, np.sort(group), float(np.ptp(flat[..., 2])))


def _union(triangles: np.ndarray) -> shapely.Geometry:
    """Union of triangles (k, 3, 2); many triangles are merged along their edges if they do not overlap."""
    shapes = shapely.polygons(triangles)
    if len(triangles) > _MANY:
        merged = shapely.coverage_union_all(shapes)
        if abs(merged.area - shapely.area(shapes).sum()) < 1e-9 * merged.area:
            return merged
    return united(shapes)
