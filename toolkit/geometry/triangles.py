"""Vertices and triangles of the meshes and height fields in a compiled model."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco


def mesh_vertices(model: mujoco.MjModel, mesh: int) -> np.ndarray:
    """Vertices (n, 3) float32 of a mesh in its geom's frame, m; a view into the model."""
    first = int(model.mesh_vertadr[mesh])
    return model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])]


def mesh_triangles(model: mujoco.MjModel, mesh: int) -> np.ndarray:
    """Triangles (k, 3) int32 of a mesh, as indices into its vertices; a view into the model."""
    first = int(model.mesh_faceadr[mesh])
    return model.mesh_face[first : first + int(model.mesh_facenum[mesh])]


def field_heights(model: mujoco.MjModel, field: int) -> np.ndarray:
    """Heights (rows, columns) float32 of a height field as parts of its highest one; a view into the model."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    first = int(model.hfield_adr[field])
    return model.hfield_data[first : first + rows * columns].reshape(rows, columns)


def height_field_triangles(model: mujoco.MjModel, field: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (r * c, 3) and upward triangles (k, 3) of a height field in its geom's frame, split as MuJoCo does."""
    heights = field_heights(model, field)
    rows, columns = heights.shape
    half_x, half_y, top, _ = model.hfield_size[field]
    y, x = np.meshgrid(np.linspace(-half_y, half_y, rows), np.linspace(-half_x, half_x, columns), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), heights.ravel().astype(float) * top])
    return points, grid_triangles(rows, columns)


def grid_triangles(rows: int, columns: int) -> np.ndarray:
    """Upward triangles (k, 3) over a grid of points, numbered row by row: two for each square of four points."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, up, across = corner + 1, corner + columns, corner + columns + 1
    return np.column_stack([corner, right, across, corner, across, up]).reshape(-1, 3)


@cache
def ball(divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and triangles (k, 3) of a polyhedron around the unit sphere: an icosahedron's, divided so often.

    It is 26, 7, 2, 0.5, 0.1 % larger than the sphere after 0 to 4 divisions.
    """
    import trimesh  # here, since it takes long to import

    sphere = trimesh.creation.icosphere(subdivisions=divisions)
    inside = (sphere.triangles[:, 0] * sphere.face_normals).sum(axis=1).min()
    return np.asarray(sphere.vertices) / inside, np.asarray(sphere.faces)


def capsule_points(radius: float, half_length: float, divisions: int) -> np.ndarray:
    """Points (n, 3) m of two balls at the ends of a capsule along z, whose hull is around it; see `ball`."""
    end, shift = radius * ball(divisions)[0], np.array([0.0, 0.0, half_length])
    return np.concatenate([end + shift, end - shift])
