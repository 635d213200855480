"""Rigid transforms, named so that neighbouring frames cancel: `world_from_foot @ point_in_foot`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np

from toolkit.geometry.heading import mean_heading


def rotation_from_quaternion(quaternion_wxyz: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), scalar first, which are normalised here."""
    q = np.asarray(quaternion_wxyz, float)
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4), scalar first and not negative, of rotation matrices (..., 3, 3)."""
    r = np.asarray(rotation, float)
    # Bar-Itzhack: the dominant eigenvector of a symmetric 4 x 4 matrix; accurate near every singular case.
    k = np.zeros((*r.shape[:-2], 4, 4))
    x, y, z = np.moveaxis(np.diagonal(r, axis1=-2, axis2=-1), -1, 0)
    k[..., 0, 0], k[..., 1, 1], k[..., 2, 2], k[..., 3, 3] = x - y - z, y - x - z, z - x - y, x + y + z
    for i, j, axis in ((0, 1, 2), (2, 0, 1), (1, 2, 0)):
        k[..., max(i, j), min(i, j)] = r[..., j, i] + r[..., i, j]
        k[..., 3, axis] = r[..., j, i] - r[..., i, j]
    _, vectors = np.linalg.eigh(k)  # reads the lower triangle
    q = np.roll(vectors[..., -1], 1, axis=-1)
    return np.where(q[..., :1] < 0.0, -q, q)


def rotation_about_z(angle: np.ndarray | float) -> np.ndarray:
    """Rotation matrices (..., 3, 3) about z by `angle` (...,) in rad."""
    angle = np.asarray(angle, float)
    rotation = np.zeros((*angle.shape, 3, 3))
    rotation[..., 0, 0] = rotation[..., 1, 1] = np.cos(angle)
    rotation[..., 1, 0] = np.sin(angle)
    rotation[..., 0, 1] = -rotation[..., 1, 0]
    rotation[..., 2, 2] = 1.0
    return rotation


def rotation_to_z(direction: np.ndarray) -> np.ndarray:
    """The smallest rotation (3, 3) that turns a direction (3,), of any length but zero, to z."""
    x, y, z = direction / np.linalg.norm(direction)
    if z < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + z)


def rotation_exponential(vector: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) in rad (Rodrigues)."""
    vector = np.asarray(vector, float)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], -2)
    # numpy's sinc is sin(pi x) / (pi x): exact through zero.
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (cross @ cross)


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) in rad, at most pi long, of one rotation matrix (3, 3)."""
    w, *axis = quaternion_from_rotation(rotation)
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return 2.0 * np.asarray(axis)
    return 2.0 * np.arctan2(sine, w) / sine * np.asarray(axis)


def yaw_of(rotation: np.ndarray) -> np.ndarray | float:
    """Heading (...,) in rad of the x axis of `rotation` (..., 3, 3), projected on the horizontal plane."""
    return np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])


def steepness(normal_z: np.ndarray | float) -> np.ndarray:
    """Rise over run (...,) of surfaces with the z entries (...,) of their unit normals: friction that resting needs."""
    return np.tan(np.arccos(np.clip(normal_z, 1e-6, 1.0)))


def rotation_on_surface(normal: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """Rotations (..., 3, 3), world_from_contact, with z along a surface's normal and x along a heading projected on it.

    The unit normals (..., 3) in the world must not be horizontal; the headings (...,) are in rad.
    """
    normal = np.asarray(normal, float)
    heading = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(np.asarray(yaw, float))], -1)
    heading, normal = np.broadcast_arrays(heading, normal)
    # The vertical plane through the heading cuts the surface in x: its yaw is the heading, exactly.
    x = heading * normal[..., 2:3]
    x = x - np.concatenate([np.zeros_like(normal[..., :2]), (heading * normal).sum(-1, keepdims=True)], -1)
    x = x * np.where(normal[..., 2:3] < 0, -1.0, 1.0)
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(normal, x), normal], axis=-1)


def rolled_onto(rotation: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) turned about its own x axis until its z axis is as near as it gets to a direction (3,)."""
    x = rotation[:, 0]
    y = np.cross(normal, x)
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


@dataclass(frozen=True)
class Pose:
    """A rigid transform `a_from_b`: maps points in frame b to points in frame a.

    Attributes:
        rotation: (3, 3) float.
        position: (3,) float, m; the origin of b in a.
    """

    rotation: np.ndarray
    position: np.ndarray

    @classmethod
    def identity(cls) -> Pose:
        """The transform that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_quaternion(cls, position: np.ndarray, quaternion_wxyz: np.ndarray) -> Pose:
        """Pose of a (3,) position and a (4,) quaternion, scalar first."""
        return cls(rotation_from_quaternion(quaternion_wxyz), np.asarray(position, float))

    @classmethod
    def from_yaw(cls, position: np.ndarray, yaw: float) -> Pose:
        """Upright pose at (3,) `position` with heading `yaw` in rad."""
        return cls(rotation_about_z(yaw), np.asarray(position, float))

    @overload
    def __matmul__(self, other: Pose) -> Pose: ...
    @overload
    def __matmul__(self, other: np.ndarray) -> np.ndarray: ...
    def __matmul__(self, other):
        """Compose with a pose, or map points (..., 3)."""
        if isinstance(other, Pose):
            return Pose(self.rotation @ other.rotation, self.rotation @ other.position + self.position)
        return np.asarray(other) @ self.rotation.T + self.position

    def inverse(self) -> Pose:
        """The transform the other way, `b_from_a`."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position)

    def moved(self, shift: np.ndarray, turn: np.ndarray) -> Pose:
        """The pose shifted by (3,) m and turned on the spot by a rotation vector (3,) in rad, both in frame a."""
        return Pose(rotation_exponential(turn) @ self.rotation, self.position + shift)

    @property
    def quaternion_wxyz(self) -> np.ndarray:
        """(4,) float unit quaternion, scalar first."""
        return quaternion_from_rotation(self.rotation)

    @property
    def yaw(self) -> float:
        """Heading of the x axis in rad."""
        return float(yaw_of(self.rotation))

    @property
    def normal(self) -> np.ndarray:
        """(3,) float z axis: the surface normal of a contact frame."""
        return self.rotation[:, 2]

    @property
    def matrix(self) -> np.ndarray:
        """(4, 4) float homogeneous matrix."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.position
        return matrix


def mean_pose(one: Pose, other: Pose) -> Pose:
    """Upright pose in the middle of two, with the circular mean of their headings."""
    return Pose.from_yaw((one.position + other.position) / 2, float(mean_heading(one.yaw, other.yaw)))
