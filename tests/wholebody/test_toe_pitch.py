import dataclasses

import numpy as np
import pytest

from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.physics.leg import leg_posture
from toolkit.wholebody.swing_planner import plan_swing
from toolkit.wholebody.swing_task import SwingingLeg, SwingTask


def nothing(centers, rotations, halves):
    return np.zeros(len(centers), bool)


@pytest.fixture
def stride(robot):
    """A long stride past a standing foot while the CoM, rather low, passes over it."""
    scale, u = robot.com_height, np.linspace(0.0, 1.0, 33)
    side = robot.legs[Limb.LEFT_FOOT].hip_in_com[1]
    com = np.stack([np.linspace(-0.08, 0.08, 33) * scale, np.zeros(33), np.full(33, 0.88 * scale)], 1)
    leg = SwingingLeg(robot.legs[Limb.LEFT_FOOT], u, com, 0.0)
    start, end = (Pose.from_yaw(np.array([x * scale, side, 0.0]), 0.0) for x in (-0.4, 0.4))
    other = (Pose.from_yaw(np.array([0.0, -side, 0.0]), 0.0), robot.half_sizes[1])
    return SwingTask(0.0, 0.8, start, end, robot.half_sizes[0], True, other=other, leg=leg)


def ankle(stride, path):
    leg = stride.leg
    rotations = path.rotations(leg.u)
    angles = leg_posture(leg.leg, leg.com, np.zeros(len(leg.u)), path.positions(leg.u), rotations).ankle_pitch
    return angles[(leg.u > 0.2) & (leg.u < 0.6)]  # where the pitch acts; at the ends the contact decides


def test_ankle_stays_in_its_range(stride):
    """Level, the sole would ask for more than the ankle has; pitched, it does not."""
    lower = stride.leg.leg.ranges["ankle_pitch"][0]
    tight = max(lower, ankle(stride, plan_swing(dataclasses.replace(stride, leg=None), nothing)).min() + 0.1)
    ranges = {**stride.leg.leg.ranges, "ankle_pitch": (tight, stride.leg.leg.ranges["ankle_pitch"][1])}
    leg = dataclasses.replace(stride.leg, leg=dataclasses.replace(stride.leg.leg, ranges=ranges))
    path = plan_swing(dataclasses.replace(stride, leg=leg), nothing)
    assert path.pitch > 0.1
    assert ankle(stride, path).min() > tight


def test_toes_do_not_dip_below_a_level_path(stride):
    path = plan_swing(stride, nothing)
    level = dataclasses.replace(path, pitch=0.0, moves=tuple(move for move in path.moves if not move.returns))
    u = np.linspace(0, 1, 101)
    toes = np.array([stride.half_size[0], 0.0, 0.0])
    pitched = path.positions(u) + path.rotations(u) @ toes
    flat = level.positions(u) + level.rotations(u) @ toes
    assert path.pitch > 0.05
    assert (pitched[:, 2] - flat[:, 2]).min() > -1e-3  # m; a bump of angles is no bump of heights, but nearly so


def test_a_foot_ahead_is_not_pitched(stride):
    other = (Pose.from_yaw(stride.start.position - [0.2, 0.3, 0.0], 0.0), stride.half_size)
    path = plan_swing(dataclasses.replace(stride, other=other, leg=None), nothing)
    assert path.pitch == 0.0
