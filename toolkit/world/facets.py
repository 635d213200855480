"""Flat facets of a triangle mesh: connected triangles of one plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
import trimesh
from shapely.geometry import Polygon

from toolkit.geometry.pose import Pose


@dataclass(frozen=True)
class Facet:
    """Connected coplanar triangles.

    Attributes:
        frame: frame of the plane (any_from_facet); z is the outward normal, the origin lies in the facet.
        polygon: outline in the frame's xy, m; may have holes.
        triangles: (k,) int; indices of its triangles in the mesh.
    """

    frame: Pose
    polygon: Polygon
    triangles: np.ndarray


def plane_frame(origin: np.ndarray, normal: np.ndarray) -> Pose:
    """A frame with z along a normal and x along the world's x axis projected on the plane (y where that is short).

    Args:
        origin: (3,) float, m; a point of the plane.
        normal: (3,) float unit normal.

    Returns:
        World-from-plane pose.
    """
    axis = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = axis - (axis @ normal) * normal
    x = x / np.linalg.norm(x)
    return Pose(np.stack([x, np.cross(normal, x), normal], axis=1), np.asarray(origin, float))


def find_facets(mesh: trimesh.Trimesh, *, angle: float, distance: float, least_area: float = 0.0) -> list[Facet]:
    """Split a mesh into its flat facets.

    Each facet grows from its largest triangle over shared edges. A triangle joins if its normal is within `angle` of
    the FIRST triangle's and its corners are within `distance` of the first triangle's plane, so that a smoothly curved
    mesh cannot drift into one facet. The facet's plane is the area-weighted mean of its triangles.

    Args:
        mesh: vertices merged; degenerate triangles are left out.
        angle: rad.
        distance: m.
        least_area: m^2; smaller facets are left out.

    Returns:
        Facets, ordered by their first triangle's area, largest first.
    """
    area = mesh.area_faces
    usable = area > 1e-10
    normals, corners = mesh.face_normals, mesh.triangles
    neighbours: list[list[int]] = [[] for _ in range(len(area))]
    for first, second in mesh.face_adjacency.tolist():
        neighbours[first].append(second)
        neighbours[second].append(first)
    free = usable.tolist()
    facets = []
    for seed in np.argsort(-area, kind="stable").tolist():
        if not free[seed]:
            continue
        normal, point = normals[seed], corners[seed, 0]
        free[seed] = False
        group, stack = [seed], [seed]
        while stack:
            for other in neighbours[stack.pop()]:
                if (
                    free[other]
                    and normals[other] @ normal > np.cos(angle)
                    and np.abs((corners[other] - point) @ normal).max() < distance
                ):
                    free[other] = False
                    group.append(other)
                    stack.append(other)
        if area[group].sum() >= least_area:
            facets.append(_facet(corners[group], normals[group], area[group], np.sort(np.array(group))))
    return facets


def _facet(corners: np.ndarray, normals: np.ndarray, area: np.ndarray, triangles: np.ndarray) -> Facet:
    """Facet of grouped triangles: corners (k, 3, 3), normals (k, 3), area (k,)."""
    weight = area / area.sum()
    normal = weight @ normals
    frame = plane_frame(weight @ corners.mean(axis=1), normal / np.linalg.norm(normal))
    flat = frame.inverse() @ corners
    shape = shapely.union_all(shapely.polygons(flat[..., :2])) if len(flat) > 1 else Polygon(flat[0, :, :2])
    if not isinstance(shape, Polygon):  # corners that only touch in a point: keep one piece, the largest
        parts = [part for part in shapely.get_parts(shapely.make_valid(shape)) if isinstance(part, Polygon)]
        shape = max(parts, key=lambda part: part.area, default=Polygon())
    return Facet(frame, shape, triangles)
