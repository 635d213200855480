"""Poses: group laws and conversions, near singular cases too."""

import numpy as np
import pytest

from toolkit.geometry.pose import (
    Pose,
    quaternion_from_rotation,
    rotation_about_z,
    rotation_exponential,
    rotation_from_quaternion,
    rotation_on_surface,
    rotation_vector,
    yaw_of,
)

QUATERNIONS = [q / np.linalg.norm(q) for q in np.random.default_rng(0).normal(size=(50, 4))]
QUATERNIONS += [np.array(q, float) for q in ([1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1])]
QUATERNIONS += [np.array([1e-9, 1, 0, 0]), np.array([np.sqrt(0.5), 0, np.sqrt(0.5), 0])]


@pytest.mark.parametrize("quaternion", QUATERNIONS)
def test_quaternion_and_rotation_agree(quaternion):
    rotation = rotation_from_quaternion(quaternion)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(rotation) > 0
    back = quaternion_from_rotation(rotation)
    # The eigenvector is accurate to about the square root of nothing: its gap is 4.
    assert min(np.abs(back - quaternion).max(), np.abs(back + quaternion).max()) < 1e-8
    np.testing.assert_allclose(rotation_from_quaternion(back), rotation, rtol=0, atol=1e-8)


def test_quaternions_of_many_rotations_are_those_of_each():
    rotations = rotation_from_quaternion(np.random.default_rng(0).normal(size=(3, 4, 4)))
    each = [[quaternion_from_rotation(rotation) for rotation in row] for row in rotations]
    np.testing.assert_array_equal(quaternion_from_rotation(rotations), each)


def test_poses_compose_and_invert():
    rng = np.random.default_rng(1)
    a, b = (Pose(rotation_from_quaternion(rng.normal(size=4)), rng.normal(size=3)) for _ in range(2))
    points = rng.normal(size=(7, 3))
    np.testing.assert_allclose((a @ b) @ points, a @ (b @ points), rtol=0, atol=1e-13)
    np.testing.assert_allclose(a.inverse() @ (a @ points), points, rtol=0, atol=1e-13)
    np.testing.assert_allclose((a @ b).matrix, a.matrix @ b.matrix, rtol=0, atol=1e-13)


def test_frames_on_a_surface_have_its_normal_and_the_heading():
    rng = np.random.default_rng(2)
    normal = rng.normal(size=(100, 3))
    normal[:, 2] = np.abs(normal[:, 2]) + 0.1
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    yaw = rng.uniform(-np.pi, np.pi, 100)
    rotation = rotation_on_surface(normal, yaw)
    np.testing.assert_allclose(rotation[..., 2], normal, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, 1, 2), np.broadcast_to(np.eye(3), (100, 3, 3)), atol=1e-12
    )
    assert (np.linalg.det(rotation) > 0).all()
    # A heading projected straight down on the surface keeps its direction seen from above.
    np.testing.assert_allclose(np.cos(yaw_of(rotation) - yaw), 1.0, rtol=0, atol=1e-12)


def test_yaw_of_an_upright_frame():
    np.testing.assert_allclose(yaw_of(rotation_about_z(np.array([0.3, -2.0]))), [0.3, -2.0], rtol=0, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-6])
def test_rotation_vector_inverts_the_exponential(angle):
    axis = np.random.default_rng(1).normal(size=3)
    rotation = rotation_exponential(angle * axis / np.linalg.norm(axis))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    vector = rotation_vector(rotation)
    np.testing.assert_allclose(np.linalg.norm(vector), angle, atol=1e-8)
    np.testing.assert_allclose(rotation_exponential(vector), rotation, atol=1e-8)


def test_a_moved_pose_is_shifted_and_turned_on_the_spot():
    pose = Pose.from_quaternion(np.array([0.3, -0.2, 0.5]), QUATERNIONS[0])
    moved = pose.moved(np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, 0.4]))
    np.testing.assert_allclose(moved.position, [0.4, 0.0, 0.8], rtol=0, atol=1e-15)
    np.testing.assert_allclose(moved.rotation, rotation_about_z(0.4) @ pose.rotation, rtol=0, atol=1e-15)
