"""Acceleration boxes keep joints inside their limits, whatever else pushes."""

import numpy as np

from toolkit.control import joint_box
from toolkit.control.joint_box import JointBox


def test_a_joint_pushed_as_hard_as_allowed_stays_within_range_and_speed(robot):
    box, period = JointBox(robot), 0.002
    for way in (1.0, -1.0):
        joints = 0.5 * (robot.lower + robot.upper)
        velocity = np.zeros_like(joints)
        for _ in range(2000):
            box.update(joints, velocity)
            velocity = velocity + period * (box.upper if way > 0 else box.lower)
            joints = joints + period * velocity
            assert (np.abs(velocity) <= robot.velocity_limit + 1e-9).all()
            assert (joints <= robot.upper + 1e-9).all() and (joints >= robot.lower - 1e-9).all()
        end = robot.upper if way > 0 else robot.lower
        assert (np.abs(joints - end) <= 0.1 * (robot.upper - robot.lower)).all()  # and the range can be used


def test_bounds_never_cross(robot):
    rng = np.random.default_rng(0)
    box = JointBox(robot)
    for _ in range(200):
        joints = rng.uniform(robot.lower - 0.5, robot.upper + 0.5)
        box.update(joints, 40.0 * rng.normal(size=len(joints)))
        assert (box.lower <= box.upper).all() and np.isfinite(box.lower).all()


def test_a_joint_at_rest_in_mid_range_is_free(robot):
    box = JointBox(robot)
    box.update(0.5 * (robot.lower + robot.upper), np.zeros_like(robot.lower))
    room = 0.5 * (robot.upper - robot.lower) - np.minimum(joint_box.RANGE_MARGIN, 0.1 * (robot.upper - robot.lower))
    braking = joint_box.RANGE_RATE**2 * room
    starting = joint_box.VELOCITY_FRACTION * robot.velocity_limit / joint_box.VELOCITY_TIME
    expected = np.minimum(np.minimum(braking, starting), joint_box.MAX_ACCELERATION)
    np.testing.assert_allclose(box.upper, expected, rtol=1e-9)
    np.testing.assert_allclose(box.lower, -expected, rtol=1e-9)
