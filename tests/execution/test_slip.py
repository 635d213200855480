"""Slip is found where a loaded patch moves, and only there."""

import numpy as np
import pytest

from toolkit.execution.slip import contact_intervals
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import rotation_about_z, rotation_on_surface

COUNT, HALF = 400, np.array([0.11, 0.065])


def measured(force, position, rotation=None):
    rotation = np.tile(np.eye(3), (COUNT, 1, 1)) if rotation is None else rotation
    return contact_intervals(Limb.LEFT_FOOT, force, position, rotation, HALF, 0.002, 20.0)


def pulse(first, last):
    force = np.zeros(COUNT)
    force[first : last + 1] = 300.0
    return force


def test_a_patch_at_rest_does_not_slip():
    (contact,) = measured(pulse(100, 300), np.zeros((COUNT, 3)))
    assert (contact.first, contact.last, contact.slip) == (100, 300, 0.0)


def test_tangential_motion_counts_and_normal_motion_does_not():
    rotation = np.tile(rotation_on_surface(np.array([0.3, 0.1, 0.9]) / np.sqrt(0.91), 0.4), (COUNT, 1, 1))
    ramp = np.linspace(0.0, 1.0, COUNT)[:, None]
    assert measured(pulse(0, 399), 0.03 * ramp * rotation[:, :, 2], rotation)[0].slip < 1e-12
    assert measured(pulse(0, 399), 0.03 * ramp * rotation[:, :, 0], rotation)[0].slip == pytest.approx(0.03)


def test_slip_that_comes_back_is_still_slip():
    position = np.zeros((COUNT, 3))
    position[:, 1] = 0.02 * np.sin(np.linspace(0.0, np.pi, COUNT))
    assert measured(pulse(0, 399), position)[0].slip == pytest.approx(0.02, rel=1e-3)


def test_turning_on_the_spot_is_slip_of_the_corners():
    rotation = rotation_about_z(np.linspace(0.0, 0.2, COUNT))
    slip = measured(pulse(0, 399), np.zeros((COUNT, 3)), rotation)[0].slip
    assert slip == pytest.approx(2 * np.sin(0.1) * np.hypot(*HALF), rel=1e-6)


def test_motion_in_the_air_is_not_slip_and_splits_contacts():
    position = np.zeros((COUNT, 3))
    position[150:, 0] = 0.3
    force = pulse(0, 120) + pulse(200, 399)
    first, second = measured(force, position)
    assert first.slip == 0.0 and second.slip == 0.0 and second.first == 200


def test_a_short_loss_of_force_does_not_hide_slip():
    position = np.zeros((COUNT, 3))
    position[150:, 0] = 0.05
    force = pulse(0, 399)
    force[145:155] = 0.0
    (contact,) = measured(force, position)
    assert contact.slip == pytest.approx(0.05)
