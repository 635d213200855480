"""Split a mesh that is not convex into convex solids whose faces are the mesh's own facets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from toolkit.world.convex import convex_partition, simplified
from toolkit.world.facets import Facet, facet_of, flat_groups

if TYPE_CHECKING:
    import trimesh

FACET_ANGLE = np.radians(3.0)  # triangles of one facet have normals within this angle of the first triangle's
FACET_DISTANCE = 1.5e-3  # m; their corners are within this distance of its plane

_DEPTH = 0.06  # m; thickness of a part where the mesh is thick enough
_LEAST_DEPTH = 2e-3  # m; least thickness of a part
_TAPER = 0.7  # size of a part's back relative to its front, so that sharp edges of the mesh stay sharp
_LEAST_WIDTH = 2e-4  # m; narrower slivers are left out
_MOST_PARTS = 4000


@dataclass(frozen=True)
class Decomposition:
    """Convex solids that replace a mesh.

    Attributes:
        facets: Flat facets of the mesh, in the frame of its vertices.
        parts: Vertex arrays (k, 3) float; the convex hull of each is a solid that has one face on the mesh.
    """

    facets: list[Facet]
    parts: list[np.ndarray]


def decompose_mesh(vertices: np.ndarray, triangles: np.ndarray) -> Decomposition | None:
    """Split a mesh into convex solids, or find that it is convex.

    A closed convex component becomes one solid. Each flat facet of any other component is split into convex polygons.
    Each of these becomes a frustum that reaches into the mesh, at most half way to the mesh's other side.
    Open meshes are sheets: their triangles are turned so that on average they face up.

    Args:
        vertices: Vertices (n, 3) float, m.
        triangles: Triangles (k, 3) int, counterclockwise seen from outside.

    Returns:
        The solids, or None if the mesh is convex and therefore equals its hull.

    Raises:
        ValueError: No triangle has an area, or there would be too many solids.
    """
    import trimesh  # here, since it takes long to import

    mesh = trimesh.Trimesh(vertices, triangles, process=True)
    components = _components(mesh)
    if not components:
        raise ValueError("it has no triangle with an area")
    convex = [_is_convex(component) for component in components]
    if len(components) == 1 and convex[0]:
        return None
    groups = [flat_groups(component, angle=FACET_ANGLE, distance=FACET_DISTANCE) for component in components]
    least = [_least_parts(component, flat) for component, flat in zip(components, groups, strict=True)]
    _check_count(int(np.where(convex, 1, least).sum()))
    facets, parts = [], []
    for component, flat, whole in zip(components, groups, convex, strict=True):
        found = [facet_of(component, group) for group in flat]
        facets += found
        if whole:
            parts.append(np.asarray(component.vertices))
        else:
            fronts = _fronts(found)
            _check_count(len(parts) + len(fronts))
            parts += _frusta(component, fronts)
    _check_count(len(parts))
    return Decomposition(facets, parts)


def _least_parts(mesh: trimesh.Trimesh, groups: list[np.ndarray]) -> int:
    """How many groups of triangles have one that is wide enough to become a part."""
    edges = np.linalg.norm(mesh.triangles - np.roll(mesh.triangles, 1, axis=1), axis=2)
    wide = 2 * mesh.area_faces > np.maximum(_LEAST_WIDTH * edges.sum(axis=1), 2e-8)
    owner = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return len(np.unique(owner[wide[np.concatenate(groups)]]))


def _check_count(parts: int) -> None:
    if parts > _MOST_PARTS:
        raise ValueError(
            f"it is not convex and has {parts} flat parts, more than {_MOST_PARTS}; simplify it or use a height field"
        )


def _components(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Connected components, each wound outwards (closed) or upwards (open)."""
    import trimesh

    labels = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
    order = np.argsort(labels, kind="stable")
    members = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)
    members = [group for group in members if mesh.area_faces[group].sum() >= 1e-10]
    _check_count(len(members))
    components = []
    for group in members:
        component: Any = mesh.submesh([group], append=True, repair=False)
        closed = component.is_watertight and component.is_winding_consistent
        upside_down = component.volume < 0 if closed else component.area_faces @ component.face_normals[:, 2] < 0
        if upside_down:
            component = trimesh.Trimesh(component.vertices, component.faces[:, ::-1], process=False)
        components.append(component)
    return components


def _is_convex(mesh: trimesh.Trimesh) -> bool:
    """Whether a mesh is closed and fills its convex hull."""
    if not (mesh.is_watertight and mesh.is_winding_consistent) or mesh.volume < 1e-12:
        return False
    return mesh.volume > (1.0 - 1e-4) * mesh.convex_hull.volume


def _fronts(facets: list[Facet]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Convex pieces of facets as (corners (k, 3), normal (3,)); slivers are left out because they touch nothing."""
    fronts = []
    for facet in facets:
        shape = shapely.remove_repeated_points(facet.polygon, 1e-6)
        for ring in convex_partition(shape) if shape.area > 1e-8 else []:
            piece = Polygon(ring)
            if 2 * piece.area > _LEAST_WIDTH * piece.length:
                corners = simplified(ring)
                fronts.append((facet.frame @ np.column_stack([corners, np.zeros(len(corners))]), facet.frame.normal))
    return fronts


def _frusta(mesh: trimesh.Trimesh, fronts: list[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """Frusta that reach from convex fronts into the mesh, (2 k, 3) vertices each."""
    if not fronts:
        return []
    centres = np.array([front.mean(axis=0) for front, _ in fronts])
    normals = np.array([normal for _, normal in fronts])
    depth = np.clip(0.5 * _thickness(mesh, centres, normals), _LEAST_DEPTH, _DEPTH)
    return [
        np.concatenate([front, centre + _TAPER * (front - centre) - deep * normal])
        for (front, normal), centre, deep in zip(fronts, centres, depth, strict=True)
    ]


def _thickness(mesh: trimesh.Trimesh, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Distance (n,) from points on a mesh to the next triangle behind them; inf if none is near.

    Each ray is tested against the triangles whose boxes meet its box (Moeller and Trumbore 1997).
    """
    ends = points - 2.1 * _DEPTH * normals
    low, high = (pick(mesh.triangles, axis=1)[:, :2] for pick in (np.min, np.max))
    tree = shapely.STRtree(shapely.box(*low.T, *high.T))
    rays, near = tree.query(shapely.box(*np.minimum(points, ends)[:, :2].T, *np.maximum(points, ends)[:, :2].T))
    result = np.full(len(points), np.inf)
    for block in np.array_split(np.arange(len(rays)), len(rays) // 1_000_000 + 1):
        point, ray, triangles = points[rays[block]], -normals[rays[block]], mesh.triangles[near[block]]
        first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        p = np.cross(ray, second)
        determinant = (first * p).sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            offset = point - triangles[:, 0]
            u = (offset * p).sum(-1) / determinant
            q = np.cross(offset, first)
            v = (ray * q).sum(-1) / determinant
            distance = (second * q).sum(-1) / determinant
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 1e-4)
        np.minimum.at(result, rays[block][hit], distance[hit])
    return result
