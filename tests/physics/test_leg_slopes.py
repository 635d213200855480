"""Slopes of leg postures and torques against central differences, for hips of every order of joints."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit.physics.leg import joint_lines, joint_torques, posture_between, quantities
from toolkit.physics.leg_slopes import leg_slopes, quantity_slopes, torque_slopes
from toolkit.robot.model import HipJoints

TINY, NUDGE = 1e-12, 1e-6


def random_hip(rng, order, tilt):
    """Joints of a hip; the first axis leaves its coordinate axis by about `tilt`, and the thigh is skewed with it."""
    first = np.eye(3)[order[0]] + tilt * rng.normal(size=3)
    skew = 0.0 if order[2] == 1 else tilt * rng.normal()
    return HipJoints(order, tuple(first / np.linalg.norm(first)), (np.cos(skew), np.sin(skew)))


def random_leg(rng, shares=(0.6, 0.98)):
    """Hip and ankle in m, rotation of the sole, heading, and the two links in m."""
    thigh, shin, yaw = rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.5), rng.uniform(-3.0, 3.0)
    rotation = Rotation.from_euler("zyx", [yaw, 0.0, 0.0] + 0.3 * rng.normal(size=3)).as_matrix()
    ankle, line = rng.normal(size=3), [0.0, 0.0, 1.0] + 0.3 * rng.normal(size=3)
    nearest = abs(thigh - shin) + 0.1
    length = max(rng.uniform(*shares) * (thigh + shin), nearest)
    return ankle + length * line / np.linalg.norm(line), ankle, rotation, (np.cos(yaw), np.sin(yaw)), thigh, shin


def differences(law, hip):
    """(k, 3) central differences of a law of the hip's place."""
    ways = NUDGE * np.eye(3)
    return np.stack([np.subtract(law(hip + way), law(hip - way)) / (2.0 * NUDGE) for way in ways], axis=1)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
@pytest.mark.parametrize("tilt", (0.0, 0.1))
def test_slopes_are_the_derivatives(order, tilt):
    rng = np.random.default_rng(3)
    for _ in range(50):
        hip, ankle, rotation, heading, thigh, shin = random_leg(rng)
        joints, sole = random_hip(rng, order, tilt), ankle + 0.1 * rng.normal(size=3)
        force, moment = rng.normal(size=3), 0.1 * rng.normal(size=3)

        def at(place, given=(ankle, rotation, heading, thigh, shin, joints, TINY)):
            return posture_between(place, *given)

        def torques(place, given=(sole, rotation, force, moment, TINY)):
            return joint_torques(at(place), *given)

        posture = at(hip)
        slopes = leg_slopes(posture, rotation, thigh, shin, TINY)
        found = quantity_slopes(posture, slopes, TINY)
        np.testing.assert_allclose(found, differences(lambda place: quantities(at(place)), hip), rtol=1e-5, atol=1e-5)
        lines = joint_lines(posture, rotation, TINY)
        found = torque_slopes(posture, slopes, lines, sole, force, moment)
        np.testing.assert_allclose(found, differences(torques, hip), rtol=1e-5, atol=1e-5)


def test_legs_that_are_too_short_have_slopes_too():
    rng = np.random.default_rng(4)
    for _ in range(50):
        hip, ankle, rotation, heading, thigh, shin = random_leg(rng, shares=(1.01, 1.3))
        posture = posture_between(hip, ankle, rotation, heading, thigh, shin, HipJoints(), TINY)
        slopes = leg_slopes(posture, rotation, thigh, shin, TINY)
        length, pitch, roll, *hips = quantity_slopes(posture, slopes, TINY)
        assert np.linalg.norm(length) == pytest.approx(1.0)
        assert np.isfinite([pitch, roll, *hips]).all()
        np.testing.assert_allclose(np.linalg.norm(slopes.shin), 1.0 / posture.length)  # the shin leans with the line
