import numpy as np
import pytest

from toolkit.world.relief import FLAT, crest, height_and_slopes, moved_relief, off_relief, relief_of

RELIEF = np.array([0.002, 0.01, -0.02, 0.3, -0.1, 0.2])


def on(relief, places):
    """Points (n, 3) of a relief."""
    return np.column_stack([places, height_and_slopes(relief, places)[0]])


def test_the_relief_of_points_is_the_paraboloid_that_they_lie_on():
    places = np.random.default_rng(0).uniform(-0.2, 0.2, (60, 2))
    np.testing.assert_allclose(relief_of(on(RELIEF, places)), RELIEF, atol=1e-9)
    np.testing.assert_allclose(off_relief(RELIEF, on(RELIEF, places) + [0.0, 0.0, 0.01]), 0.01, atol=1e-12)


def test_few_points_leave_the_relief_small():
    """A ridge of two triangles: four corners say nothing of how the ground curves along it."""
    points = np.array([[0.0, -0.2, 0.0], [0.0, 0.2, 0.0], [-0.1, 0.0, -0.002], [0.1, 0.0, -0.002]])
    assert np.abs(relief_of(points)[3:]).max() < 0.5
    np.testing.assert_allclose(off_relief(relief_of(points), points), 0.0, atol=1e-9)


def test_a_relief_moves_with_its_frame():
    places, origin = np.random.default_rng(1).uniform(-0.2, 0.2, (20, 2)), np.array([0.13, -0.07])
    moved = moved_relief(RELIEF, origin)
    np.testing.assert_allclose(on(moved, places - origin)[:, 2], on(RELIEF, places)[:, 2], atol=1e-12)
    assert not moved_relief(FLAT, origin).any()


def test_slopes_are_those_of_the_heights():
    place, step = np.array([[0.1, -0.05]]), 1e-6
    for axis in range(2):
        ahead, behind = (on(RELIEF, place + sign * step * np.eye(2)[axis])[0, 2] for sign in (1, -1))
        slope = height_and_slopes(RELIEF, place)[1][0, axis]
        assert slope == pytest.approx((ahead - behind) / (2 * step), abs=1e-9)


def test_a_crest_is_where_the_ground_falls_to_both_sides():
    assert crest(FLAT) == crest(np.array([0, 0, 0, 0.3, 0.0, 0.2])) == 0.0
    assert crest(np.array([0, 0, 0, -0.3, 0.0, -0.2])) == pytest.approx(0.3)
    assert crest(np.array([0, 0, 0, 0.0, 0.25, 0.0])) == pytest.approx(0.25)  # a saddle
