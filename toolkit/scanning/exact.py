"""Meshes without noise, as CAD programs make them: taken as they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
import trimesh

from toolkit.scanning.patches import Patch
from toolkit.scanning.samples import Scan
from toolkit.world.facets import facet_of, flat_groups

_ANGLE, _DISTANCE = np.radians(1.0), 3e-4  # rad, m; by which facets are not flat; curved ground is not exact
_FACET = 3e-3  # m^2; facets of this area can be touched
_SHARE = 0.9  # of a mesh's area that such facets cover where there is no noise
_MOST_FACETS = 1500
_MOST_SOLIDS = 300
_MOST_CORNERS = 40  # of a facet in the mean; jagged outlines are those of a scan


@dataclass(frozen=True)
class Exact:
    """What can be taken from a mesh as it is.

    Attributes:
        solids: Closed meshes.
        patches: Flat facets of open meshes.
        area: Area of both, m^2.
        rest: What is left of the mesh.
    """

    solids: list[trimesh.Trimesh]
    patches: list[Patch]
    area: float
    rest: Scan


def take_exact(scan: Scan) -> Exact:
    """Take what has flat facets for nine tenths of its area; all of a noisy mesh is left."""
    nothing = Exact([], [], 0.0, scan)
    if len(scan.triangles) == 0:
        return nothing
    mesh = trimesh.Trimesh(scan.vertices, scan.triangles, process=True)
    if not _may_be_flat(mesh):
        return nothing
    groups = flat_groups(mesh, angle=_ANGLE, distance=_DISTANCE, least_area=_FACET)
    flat = np.zeros(len(mesh.faces), bool)
    flat[[index for group in groups for index in group]] = True
    if mesh.area_faces[flat].sum() < _SHARE * mesh.area or len(groups) > _MOST_FACETS:
        return nothing
    labels = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
    solids, left = [], np.ones(len(mesh.faces), bool)
    parts = range(labels.max() + 1) if labels.max() < _MOST_SOLIDS else range(0)
    for number in parts:
        part: Any = mesh.submesh([np.flatnonzero(labels == number)], append=True, repair=False)
        if part.is_watertight and part.is_winding_consistent and abs(part.volume) > 1e-6:
            solids.append(part)
            left[labels == number] = False
    up = np.bincount(labels, mesh.area_faces * mesh.face_normals[:, 2])[labels] >= 0
    sheets = trimesh.Trimesh(mesh.vertices, np.where(up[:, None], mesh.faces, mesh.faces[:, ::-1]), process=False)
    facets = [facet_of(sheets, group) for group in groups if left[group].all()]
    if sum(shapely.get_num_coordinates(facet.polygon) for facet in facets) > _MOST_CORNERS * (len(facets) + 1):
        return nothing
    left[[index for facet in facets for index in facet.triangles]] = False
    vertices = np.asarray(mesh.vertices) if left.any() else np.zeros((0, 3))  # points alone would be a cloud
    rest = Scan(vertices, np.asarray(mesh.faces)[left])
    patches = [Patch(facet.frame, facet.polygon) for facet in facets]
    return Exact(solids, patches, float(mesh.area_faces[~left].sum()), rest)


def _may_be_flat(mesh: trimesh.Trimesh) -> bool:
    """Whether enough triangles are large, or have a neighbour in their plane, for a mesh without noise."""
    flat = mesh.area_faces >= _FACET
    normals, pairs = mesh.face_normals, mesh.face_adjacency
    alike = np.einsum("kx,kx->k", normals[pairs[:, 0]], normals[pairs[:, 1]]) > np.cos(_ANGLE)
    flat[pairs[alike].ravel()] = True
    return bool(mesh.area_faces[flat].sum() >= _SHARE * mesh.area)
