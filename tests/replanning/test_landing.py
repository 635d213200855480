"""Regions of landing points."""

import numpy as np
import pytest
import shapely

from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose, rotation_about_z
from toolkit.replanning.landing import apart_row, landing_rows
from toolkit.world.surface import Surface

HALF = np.array([0.1, 0.05])
CORNERS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * HALF


def tilt(roll, pitch):
    """A rotation about x, then about y."""
    a, b = np.cos([roll, pitch]), np.sin([roll, pitch])
    about_x = np.array([[1, 0, 0], [0, a[0], -b[0]], [0, b[0], a[0]]])
    about_y = np.array([[a[1], 0, b[1]], [0, 1, 0], [-b[1], 0, a[1]]])
    return about_y @ about_x


def tile(boundary):
    """A tilted surface with the given ring."""
    pose = Pose(tilt(0.2, -0.1), np.array([1.0, 2.0, 0.5]))
    return Surface(0, "tile", pose, (boundary,), (boundary,), 0.7, True, False)


def on(surface, x, y, yaw):
    """A contact on a surface."""
    rotation = surface.pose.rotation @ rotation_about_z(yaw)
    return Contact(Limb.LEFT_FOOT, Pose(rotation, surface.pose.position + surface.pose.rotation @ [x, y, 0.0]), 0.7, 0)


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.5])
def test_rows_hold_exactly_where_the_sole_is_on_its_surface(yaw):
    ring = np.array([[-0.3, -0.2], [0.35, -0.25], [0.3, 0.3], [-0.25, 0.2]])
    surface = tile(ring)
    contact = on(surface, 0.02, 0.03, yaw)
    rows, bounds = landing_rows(contact, HALF, surface, 0.01)
    room = shapely.Polygon(ring).buffer(-0.01, join_style="mitre")
    rng, seen = np.random.default_rng(3), set()
    for shift in rng.uniform(-0.25, 0.25, (300, 2)):
        points = (CORNERS + shift) @ contact.pose.rotation[:, :2].T + contact.pose.position
        local = ((points - surface.pose.position) @ surface.pose.rotation)[:, :2]
        inside = all(room.contains(shapely.Point(point)) for point in local)
        assert inside == bool((rows @ shift <= bounds).all())
        seen.add(inside)
    assert seen == {True, False}


def test_a_planned_contact_near_an_edge_may_stay():
    ring = np.array([[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]])
    rows, bounds = landing_rows(on(tile(ring), 0.0, 0.0, 0.0), HALF, tile(ring), 0.01)
    assert (bounds == 0.0).all() and len(rows) == 4


def test_the_roomiest_piece_is_taken():
    small = np.array([[-0.11, -0.06], [0.11, -0.06], [0.11, 0.06], [-0.11, 0.06]])
    surface = tile(small)
    both = Surface(0, "tile", surface.pose, (3 * small,), (small, 3 * small), 0.7, True, False)
    _, bounds = landing_rows(on(surface, 0.0, 0.0, 0.0), HALF, both, 0.0)
    assert bounds.min() == pytest.approx(0.13, abs=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_feet_stay_apart(yaw):
    pose, other = Pose(np.eye(3), np.zeros(3)), Pose(rotation_about_z(yaw), np.array([0.05, -0.25, 0.0]))
    row, bound = apart_row(pose, HALF, other, HALF, 0.02)
    standing = shapely.Polygon(CORNERS @ other.rotation[:2, :2].T + other.position[:2])
    assert bound > 0.0
    for shift in np.random.default_rng(0).uniform(-0.3, 0.3, (300, 2)):
        if row @ shift <= bound:
            assert shapely.distance(shapely.Polygon(CORNERS + shift), standing) >= 0.02 - 1e-9


def test_feet_that_are_planned_closer_come_no_closer():
    row, bound = apart_row(Pose(np.eye(3), np.zeros(3)), HALF, Pose(np.eye(3), np.array([0.0, -0.11, 0.0])), HALF, 0.02)
    assert bound == 0.0
    np.testing.assert_allclose(row, [0.0, -1.0], rtol=0.0, atol=1e-12)
