"""Leg postures in closed form against MuJoCo's forward kinematics."""

import mujoco
import numpy as np
import pytest

from toolkit.contacts.reach import ReachMargins, leg_clearances, leg_posture
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.loader import find_robots, load_robot


@pytest.fixture(scope="module", params=find_robots())
def robot(request):
    return load_robot(request.param)


def leg_chain(model, limb):
    """Joints from the base to a foot, in that order."""
    joints, body = [], model.site_bodyid[model.site(limb.label).id]
    while model.body_parentid[body]:
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        joints = [*range(first, first + count), *joints]
        body = model.body_parentid[body]
    return joints


def random_legs(robot, limb, rng, count=40):
    """Configurations of a leg on an upright base: qpos, hip-consistent CoM, sole position and rotation, data."""
    model, leg = robot.mujoco_model, robot.legs[limb]
    joints = leg_chain(model, limb)
    data = mujoco.MjData(model)
    for _ in range(count):
        data.qpos[:] = robot.home
        data.qpos[3:7] = [1, 0, 0, 0]
        data.qpos[:3] = rng.normal(size=3)
        lower, upper = model.jnt_range[joints].T
        q = lower + (0.25 + 0.5 * rng.random(6)) * (upper - lower)
        home = robot.home[model.jnt_qposadr[joints]]
        q[:3] = home[:3] + 0.4 * (q[:3] - home[:3])
        data.qpos[model.jnt_qposadr[joints]] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        hip = data.xanchor[joints[2]]
        site = model.site(limb.label).id
        sole = data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()
        yield data, joints, q, hip - leg.hip_in_com, *sole


@pytest.mark.parametrize("limb", FEET)
def test_joint_angles_are_those_of_the_robot(robot, limb):
    rng = np.random.default_rng(1)
    model, leg = robot.mujoco_model, robot.legs[limb]
    joints = leg_chain(model, limb)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(model, data)
    order = np.abs(data.xaxis[joints]).argmax(1).tolist()
    if order != [2, 0, 1, 1, 1, 0]:
        pytest.skip("the hip of this robot is not yaw, roll, pitch")
    for _, joints, q, com, position, rotation in random_legs(robot, limb, rng):
        posture = leg_posture(leg, com[None], np.zeros(1), position[None], rotation[None])
        lower, upper = model.jnt_range[joints].T
        roles = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
        angles = np.array([getattr(posture, role)[0] for role in roles])
        ranges = np.array([leg.ranges[role] for role in roles])
        # distances to the two ends of the range, whichever way the joint turns
        ours = np.sort(np.stack([angles - ranges[:, 0], ranges[:, 1] - angles]), 0)
        theirs = np.sort(np.stack([q - lower, upper - q]), 0)
        np.testing.assert_allclose(ours, theirs, atol=1e-6)


@pytest.mark.parametrize("limb", FEET)
def test_posture_turns_and_shifts_with_the_world(robot, limb):
    rng = np.random.default_rng(2)
    leg = robot.legs[limb]
    for _, _, _, com, position, rotation in random_legs(robot, limb, rng, 5):
        yaw, shift = rng.uniform(-3, 3), rng.normal(size=3)
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        still = leg_posture(leg, com[None], np.zeros(1), position[None], rotation[None])
        moved = leg_posture(
            leg, (turn @ com + shift)[None], np.array([yaw]), (turn @ position + shift)[None], (turn @ rotation)[None]
        )
        for role in ("length", "hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll"):
            np.testing.assert_allclose(getattr(moved, role), getattr(still, role), atol=1e-9)


def leg_feasible(leg, com, yaw, position, rotation):
    """(n,) bool; whether legs reach their soles within every joint range."""
    posture = leg_posture(leg, com, yaw, position, rotation)
    return np.all([value >= 0.0 for value in leg_clearances(leg, posture).values()], axis=0)


def test_home_posture_is_feasible_and_broken_ones_are_not(robot):
    for limb in FEET:
        leg = robot.legs[limb]
        ankle_height = leg.ankle_in_sole
        com = np.array([[0.0, 0.0, robot.com_height]])
        # below the hip, as the home posture has it
        position = (com + leg.hip_in_com) * [1, 1, 0] - ankle_height * [1, 1, 0]
        place = np.zeros(1), position, np.eye(3)[None]
        assert leg_feasible(leg, com, *place).all()
        for shift in ([0, 0, 0.3], [0, 0, -0.7], [0.6, 0, 0], [-0.6, 0, 0], [0, 0.5, -0.1], [0, -0.5, -0.1]):
            assert not leg_feasible(leg, com + shift, *place).any(), shift
        steep = np.array([[[1, 0, 0], [0, np.cos(0.9), -np.sin(0.9)], [0, np.sin(0.9), np.cos(0.9)]]])
        assert not leg_feasible(leg, com, np.zeros(1), position, steep).any()
        turned = np.array([2.5])
        assert not leg_feasible(leg, com, turned, position, np.eye(3)[None]).any()


def test_margins_tighten_every_limit(robot):
    leg = robot.legs[Limb.LEFT_FOOT]
    rng = np.random.default_rng(3)
    n = 50
    com = np.array([0, 0, robot.com_height]) + 0.1 * rng.normal(size=(n, 3))
    position = np.tile((leg.hip_in_com - leg.ankle_in_sole) * [1, 1, 0], (n, 1))
    posture = leg_posture(leg, com, np.zeros(n), position, np.tile(np.eye(3), (n, 1, 1)))
    loose = leg_clearances(leg, posture, ReachMargins(0.0, 0.0, 0.0))
    tight = leg_clearances(leg, posture, ReachMargins(0.01, 0.1, 0.05))
    for name, taken in [("leg length", 0.01), ("ankle pitch", 0.1), ("ankle roll", 0.1), ("hip pitch", 0.05)]:
        np.testing.assert_allclose(loose[name] - tight[name], taken, atol=1e-12)
