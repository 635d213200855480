"""Triangles of a world's colliding geometry, for the occupancy grid."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.geometry.pose import Pose
from toolkit.geometry.triangles import ball, capsule_points, height_field_triangles, mesh_triangles, mesh_vertices

_SIDES = 16  # sides of a prism around a cylinder
_BALLS = (0.04, 0.14, 0.55, 2.2)  # m; largest radii of balls of 0 to 3 divisions, which reach out by a centimetre
_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
    + [[1, 5, 7], [1, 7, 3]]
)


def world_triangles(model: mujoco.MjModel, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Triangles (t, 3, 3) m in the world frame of all colliding geoms that come near a box with corners (3,) m.

    Polyhedra around rounded geoms and prisms around cylinders stand for these.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    triangles = [np.zeros((0, 3, 3))]
    for index in np.flatnonzero((model.geom_contype | model.geom_conaffinity) != 0).tolist():
        pose = Pose(data.geom_xmat[index].reshape(3, 3), data.geom_xpos[index])
        radius = model.geom_rbound[index]
        if radius > 0 and ((pose.position + radius < lower) | (pose.position - radius > upper)).any():
            continue
        corners = _plane(pose, lower, upper) if radius == 0 else pose @ _local(model, index)
        near = (corners.max(1) >= lower).all(1) & (corners.min(1) <= upper).all(1)
        triangles.append(corners[near])
    return np.concatenate(triangles)


def _local(model: mujoco.MjModel, index: int) -> np.ndarray:
    """(t, 3, 3) m; triangles of a bounded geom in its own frame."""
    kind, size, types = model.geom_type[index], model.geom_size[index], mujoco.mjtGeom
    if kind == types.mjGEOM_MESH:
        mesh = int(model.geom_dataid[index])
        return mesh_vertices(model, mesh).astype(float)[mesh_triangles(model, mesh)]
    if kind == types.mjGEOM_HFIELD:
        points, faces = height_field_triangles(model, int(model.geom_dataid[index]))
        return points[faces]
    if kind == types.mjGEOM_CYLINDER:
        angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
        ring = size[0] / np.cos(np.pi / _SIDES) * np.column_stack([np.cos(angle), np.sin(angle)])
        a, b = ring, np.roll(ring, -1, axis=0)
        zero = np.zeros_like(a)
        low, high = np.full((_SIDES, 1), -size[1]), np.full((_SIDES, 1), size[1])

        def triangle(*corners):
            return np.stack([np.column_stack(corner) for corner in corners], axis=1)

        return np.concatenate(
            [
                triangle((a, low), (b, low), (b, high)),
                triangle((a, low), (b, high), (a, high)),
                triangle((zero, low), (a, low), (b, low)),
                triangle((zero, high), (a, high), (b, high)),
            ]
        )
    if kind == types.mjGEOM_BOX:
        return (_CORNERS * size)[_FACES]
    if kind == types.mjGEOM_SPHERE:
        return _ellipsoid(size[[0, 0, 0]])
    if kind == types.mjGEOM_ELLIPSOID:
        return _ellipsoid(size)
    if kind == types.mjGEOM_CAPSULE:
        from scipy.spatial import ConvexHull  # here, since it takes long to import

        points = capsule_points(size[0], size[1], _divisions(size[0]))
        return points[ConvexHull(points).simplices]
    return np.zeros((0, 3, 3))


def _ellipsoid(radii: np.ndarray) -> np.ndarray:
    """(t, 3, 3) m; triangles around an ellipsoid with radii (3,) m."""
    points, faces = ball(_divisions(radii.max()))
    return (points * radii)[faces]


def _divisions(radius: float) -> int:
    """Divisions of a ball of a radius in m."""
    return int(np.searchsorted(_BALLS, radius))


def _plane(pose: Pose, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """(2, 3, 3) m; triangles of an infinite plane, as large as the box needs."""
    centre = pose.inverse() @ ((lower + upper) / 2)
    reach = float(np.linalg.norm(upper - lower)) * 2.0
    square = centre * [1, 1, 0] + reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return pose @ square[[[0, 1, 2], [0, 2, 3]]]
