"""Footholds: exact regions for whole soles, on surfaces of any shape."""

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from tests.search.worlds import box, make_world
from toolkit.contacts.footholds import Footholds
from toolkit.geometry.pose import Pose
from toolkit.world.surface import Surface

HALF = np.array([0.11, 0.065])
CORNERS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])


def footholds(*geoms, margin=0.01):
    world = make_world(*geoms)
    return world, Footholds(world.surfaces, HALF, margin)


def covered(world, found, row, tolerance=1e-6):
    """Whether the whole sole of a row lies on its surface."""
    surface = world.surfaces[found.surface[row]]
    corners = np.array([[x, y, 0.0] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]) * np.append(HALF, 0.0)
    local = surface.pose.inverse() @ (found.position[row] + corners @ found.rotation[row].T)
    return surface.region.buffer(tolerance).covers(shapely.Polygon(local[:, :2]))


def test_soles_lie_on_the_surface_as_near_to_the_wish_as_they_can():
    world, holds = footholds(box([0, 0, -0.05], [0.5, 0.3, 0.05], [8, -12, 30]))
    wishes = np.random.default_rng(0).uniform(-1.0, 1.0, (60, 2))
    top = int(np.argmax([surface.normal[2] for surface in world.surfaces]))
    for yaw in (0.0, 0.4, 2.0):
        found = holds.nearest([(top, yaw)], wishes)
        assert found.found.all()
        assert all(covered(world, found, row) for row in range(len(wishes)))
        np.testing.assert_allclose(np.arctan2(*found.rotation[:, 1::-1, 0].T), yaw, atol=1e-9)
        inside = np.hypot(*(found.position[:, :2] - wishes).T) < 1e-9
        assert inside.any() and not inside.all()


def test_a_stone_as_large_as_a_sole_holds_it_in_its_own_direction_only():
    turn = 25.0
    world, holds = footholds(box([0, 0, -0.05], [0.112, 0.067, 0.05], [0, 0, turn]))
    top = int(np.argmax([surface.normal[2] for surface in world.surfaces]))
    assert not holds.nearest([(top, 0.0)], np.zeros((1, 2))).found.any()
    headings = holds.headings(top, 0.0)
    assert any(abs(heading - np.radians(turn)) < 1e-6 for heading in headings)
    found = holds.nearest([(top, np.radians(turn))], np.array([[0.3, 0.0]]))
    assert found.found.all() and covered(world, found, 0, 1e-4)
    np.testing.assert_allclose(found.position[0], 0.0, atol=2e-3)
    assert len(holds.samples(top, 0.1))


@pytest.mark.parametrize("length", [0.4, 1.2])
def test_samples_leave_no_wide_gaps_on_a_beam(length):
    world, holds = footholds(box([0, 0, -0.05], [length, 0.08, 0.05], [0, 0, 20]))
    top = int(np.argmax([surface.normal[2] for surface in world.surfaces]))
    along = np.sort(holds.samples(top, 0.1)[:, :2] @ [np.cos(np.radians(20)), np.sin(np.radians(20))])
    assert along[0] < -length + 0.15 and along[-1] > length - 0.15
    assert np.diff(along).max() < 0.11


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.2])
def test_a_round_surface_holds_soles_wherever_they_fit(yaw):
    angle = 2 * np.pi * np.arange(16) / 16
    ring = 0.26 * np.column_stack([np.cos(angle), np.sin(angle)])
    world = SimpleNamespace(surfaces=(Surface(0, "disc", Pose.identity(), (ring,), (ring,), 0.5, True, False),))
    margin = 0.01
    wishes = np.random.default_rng(0).uniform(-0.25, 0.25, (200, 2))
    found = Footholds(world.surfaces, HALF, margin).nearest([(0, yaw)], wishes)
    region, turn = shapely.Polygon(ring), np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    for row, wish in enumerate(wishes):
        assert covered(world, found, row)
        fits = region.covers(shapely.Polygon(wish + CORNERS * (HALF + margin) @ turn))
        at_wish = np.hypot(*(found.position[row, :2] - wish)) < 1e-9
        assert at_wish == fits


@pytest.mark.parametrize("width", [0.135, 0.145, 0.15, 0.16])
def test_a_beam_between_platforms_of_its_height_holds_soles_that_hardly_fit(width):
    world, holds = footholds(
        box([0, 0, -0.05], [0.4, 0.4, 0.05]),
        box([1.0, 0, -0.05], [0.6, width / 2, 0.05]),
        box([2.0, 0, -0.05], [0.4, 0.4, 0.05]),
    )
    top = int(np.argmax([surface.normal[2] for surface in world.surfaces]))
    assert len(world.surfaces[top].pieces) > 1  # one surface
    wishes = np.column_stack([np.linspace(-0.3, 2.3, 53), np.full(53, 0.02)])
    found = holds.nearest([(top, 0.0)], wishes)
    assert all(covered(world, found, row, 1e-4) for row in range(len(wishes)))
    assert np.abs(found.position[:, 0] - wishes[:, 0]).max() < 0.05  # also in the middle of the beam
    on_beam = np.abs(found.position[:, 0] - 1.0) < 0.4
    assert on_beam.sum() > 10 and np.abs(found.position[on_beam, 1]).max() <= width / 2 - HALF[1]


def test_where_there_is_room_for_the_margin_it_is_kept():
    margin = 0.01
    world, holds = footholds(
        box([0, 0, -0.05], [0.4, 0.4, 0.05], [0, 0, 20]), box([0.7, 0.3, -0.05], [0.4, 0.3, 0.05], [0, 0, 20])
    )
    top = int(np.argmax([surface.normal[2] for surface in world.surfaces]))
    surface = world.surfaces[top]
    assert len(surface.pieces) > 1
    for yaw in (0.0, np.radians(20), 1.0):
        found = holds.nearest([(top, yaw)], np.random.default_rng(0).uniform(-1.0, 1.5, (80, 2)))
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        for place in (found.position - surface.pose.position)[:, :2] @ surface.pose.rotation[:2, :2]:
            sole = shapely.Polygon(place + CORNERS * (HALF + margin) @ turn @ surface.pose.rotation[:2, :2])
            assert surface.region.buffer(1e-4).covers(sole)
