import numpy as np
import pytest

from toolkit.geometry.pose import Pose, rotation_exponential, rotation_on_surface, rotation_vector
from toolkit.wholebody.swing import Move, SwingPath, Window


def random_rotation(rng, angle):
    axis = rng.normal(size=3)
    return rotation_exponential(angle * axis / np.linalg.norm(axis))


@pytest.fixture
def path():
    rng = np.random.default_rng(3)
    start = Pose(random_rotation(rng, 0.4), rng.normal(size=3))
    end = Pose(random_rotation(rng, 0.8), rng.normal(size=3))
    up, aside = np.array([0, 0, 0.1]), np.array([0.05, 0.02, 0])
    moves = (
        Move(up, Window(0.0, 0.4)),
        Move(end.position - start.position, Window(0.05, 0.85)),
        Move(-up, Window(0.5, 1.0)),
        Move(aside, Window(0.05, 0.85), returns=True),
    )
    return SwingPath(2.0, 0.7, start, end, moves, Window(0.05, 0.85), pitch=0.5)


def test_path_joins_its_ends_at_rest(path):
    for time, pose in ((2.0, path.start), (2.7, path.end), (1.0, path.start), (9.0, path.end)):
        sample = path.sample(time)
        np.testing.assert_allclose(sample.pose.position, pose.position, atol=1e-12)
        np.testing.assert_allclose(sample.pose.rotation, pose.rotation, atol=1e-12)
        np.testing.assert_allclose(sample.velocity, 0.0, atol=1e-12)


def test_velocity_and_acceleration_match_finite_differences(path):
    h = 1e-5
    for time in np.linspace(2.013, 2.687, 40):
        before, sample, after = (path.sample(time + dt) for dt in (-h, 0.0, h))
        # Truncation error of central differences: h^2 times derivatives of at most about 1e4, plus rounding / h.
        speed = (after.pose.position - before.pose.position) / (2 * h)
        np.testing.assert_allclose(sample.velocity[:3], speed, atol=1e-5)
        turn = rotation_vector(after.pose.rotation @ before.pose.rotation.T) / (2 * h)
        np.testing.assert_allclose(sample.velocity[3:], turn, atol=1e-5)
        np.testing.assert_allclose(sample.acceleration, (after.velocity - before.velocity) / (2 * h), atol=1e-2)


def test_arrays_and_samples_agree(path):
    u = np.linspace(0, 1, 17)
    positions, rotations = path.positions(u), path.rotations(u)
    for index, share in enumerate(u):
        sample = path.sample(path.begin + share * path.duration)
        np.testing.assert_allclose(sample.pose.position, positions[index], atol=1e-12)
        np.testing.assert_allclose(sample.pose.rotation, rotations[index], atol=1e-12)


def test_orientation_turns_about_one_axis():
    start = Pose(rotation_on_surface(np.array([0.0, 0.0, 1.0]), 0.0), np.zeros(3))
    end = Pose(rotation_on_surface(np.array([0.2, 0.1, 1.0]) / np.linalg.norm([0.2, 0.1, 1.0]), 0.6), np.ones(3))
    path = SwingPath(0.0, 1.0, start, end, (Move(np.ones(3), Window(0, 1)),), Window(0, 1))
    total = np.linalg.norm(rotation_vector(end.rotation))
    angles = [np.linalg.norm(rotation_vector(path.sample(t).pose.rotation)) for t in np.linspace(0, 1, 11)]
    assert (np.diff(angles) > 0).all()
    np.testing.assert_allclose(angles[-1], total, atol=1e-9)
