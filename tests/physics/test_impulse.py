"""Impulses of contacts: the nearest sums of vectors of friction cones."""

import numpy as np
import pytest

from toolkit.physics.impulse import nearest_sum


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def tilted(degrees, heading=0.0):
    """(3,) normal of a surface that falls towards a heading in rad."""
    angle = np.radians(degrees)
    return np.array([np.sin(angle) * np.cos(heading), np.sin(angle) * np.sin(heading), np.cos(angle)])


def in_cone(vectors, normal, friction):
    along = vectors @ normal
    return np.linalg.norm(vectors - along[:, None] * normal, axis=1) <= friction * along + 1e-9


def drawn(rng, normal, friction, n=100):
    """(n, 3) vectors of a cone."""
    across = np.cross(rng.normal(size=(n, 3)), normal)
    across /= np.linalg.norm(across, axis=1)[:, None]
    return rng.exponential(size=(n, 1)) * (normal + friction * np.sqrt(rng.random((n, 1))) * across)


def test_what_contacts_can_give_stays(rng):
    cones = np.array([tilted(35.0), tilted(30.0, 2.0)]), np.array([0.5, 0.4])
    sums = sum(drawn(rng, normal, mu) for normal, mu in zip(*cones, strict=True))
    np.testing.assert_allclose(nearest_sum(sums, *cones), sums, atol=5e-3)


@pytest.mark.parametrize("tilts", [[(30.0, 0.0)], [(30.0, 0.0), (40.0, 1.0)], [(0.0, 0.0), (60.0, 0.0), (60.0, 2.0)]])
def test_nothing_that_contacts_can_give_is_nearer(rng, tilts):
    normals, friction = [tilted(*tilt) for tilt in tilts], np.full(len(tilts), 0.5)
    wanted = rng.normal(size=(50, 3))
    nearest = nearest_sum(wanted, np.array(normals), friction)
    least = np.linalg.norm(wanted - nearest, axis=1)
    for _ in range(200):
        other = sum(drawn(rng, normal, 0.5, 50) for normal in normals)
        assert (np.linalg.norm(wanted - other, axis=1) >= least - 1e-3).all()


def test_one_cone_is_met_exactly(rng):
    normal = tilted(33.0, 0.7)
    nearest = nearest_sum(rng.normal(size=(50, 3)), normal[None], np.array([0.5]))
    assert in_cone(nearest, normal, 0.5).all()
    np.testing.assert_allclose(nearest_sum(-normal[None], normal[None], np.array([0.5])), 0.0, atol=1e-12)


def test_contacts_on_one_plane_count_once_with_the_most_friction(rng):
    wanted, normal = rng.normal(size=(20, 3)), tilted(30.0)
    one = nearest_sum(wanted, normal[None], np.array([0.6]))
    np.testing.assert_array_equal(nearest_sum(wanted, np.array([normal, normal]), np.array([0.3, 0.6])), one)
