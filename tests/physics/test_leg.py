"""Leg postures in closed form against MuJoCo's forward kinematics and against a chain of rotations."""

import itertools
from dataclasses import replace

import casadi as ca
import mujoco
import numpy as np
import pytest

from tests.oracles.leg import angles_of, chain, torques
from tests.shipped_robots import OWN
from toolkit.compiled import compiled
from toolkit.geometry.limb import FEET, Limb
from toolkit.physics.leg import ReachMargins, leg_clearances, leg_posture, leg_torques, posture_between
from toolkit.robot.loader import load_robot
from toolkit.robot.model import HipJoints
from validation.reference.pieces import pieces


@pytest.fixture(scope="module", params=OWN)
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
    clearances = leg_clearances(leg, com, yaw, position, rotation, ReachMargins())
    return np.all([value >= 0.0 for value in clearances.values()], axis=0)


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
    place = com, np.zeros(n), position, np.tile(np.eye(3), (n, 1, 1))
    loose = leg_clearances(leg, *place, ReachMargins(0.0, 0.0, 0.0))
    tight = leg_clearances(leg, *place, ReachMargins(0.01, 0.1, 0.05))
    for name, taken in [("leg length", 0.01), ("ankle pitch", 0.1), ("ankle roll", 0.1), ("hip pitch", 0.05)]:
        np.testing.assert_allclose(loose[name] - tight[name], taken, atol=1e-12)


def placed(leg, com, heading, angles):
    """The posture that the law finds for a sole that the chain of rotations places, and the chain's points and sole."""
    *points, sole, rotation = chain(leg, com, heading, angles)
    return leg_posture(leg, com[None], np.array([heading]), sole[None], rotation[None]), points, sole, rotation


def with_hips(leg, order, skew=0.0):
    """The leg with its hip's joints in another order of axes, 0 roll, 1 pitch, 2 yaw."""
    first = tuple(np.eye(3)[order[0]])
    return replace(leg, hips=HipJoints(order, first, (np.cos(skew), np.sin(skew))))


@pytest.mark.parametrize("skew", [0.0, 0.2])
@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
@pytest.mark.parametrize("limb", FEET)
def test_the_law_undoes_the_chain_of_rotations(robot, limb, order, skew):
    if skew and order[2] == 1:
        pytest.skip("a thigh that turns last about its pitch axis has no axis beside its line")
    rng, leg = np.random.default_rng(4), with_hips(robot.legs[limb], order, skew)
    for _ in range(100):
        com, heading = rng.normal(size=3), rng.uniform(-3, 3)
        angles = rng.uniform([-1.5, -1.3, -1.4, 0.05, -1.4, -1.4], [1.5, 1.3, 1.4, 2.6, 1.4, 1.4])
        posture, points, sole, rotation = placed(leg, com, heading, angles)
        if (points[0] - points[2]) @ rotation[:, 2] < 0.02:
            continue  # the hip below the sole: the ankle would have rolled over
        np.testing.assert_allclose(angles_of(posture), angles, atol=1e-9)
        found = (posture.hip_point, posture.knee_point, posture.ankle_point)
        np.testing.assert_allclose(np.squeeze(found), points, atol=1e-9)
        force, moment = rng.normal(size=3) * [50, 50, 300], rng.normal(size=3) * 20
        place = com[None], np.array([heading]), sole[None], rotation[None]
        ours = leg_torques(leg, *place, force[None], moment[None])
        expected = torques(leg, com, heading, angles, force, moment)
        for role, torque in ours.items():
            np.testing.assert_allclose(torque[0], expected[role], atol=1e-5, err_msg=role)  # differences of 1e-6 rad


@pytest.mark.parametrize("limb", FEET)
@pytest.mark.parametrize("singular", ["straight", "folded", "hip on its side", "ankle on its side"])
def test_the_law_near_its_singularities(robot, limb, singular):
    rng, leg = np.random.default_rng(5), with_hips(robot.legs[limb], (2, 0, 1))
    for off in (0.0, 1e-9, 1e-6, 1e-3, 0.05):
        angles = np.array([0.3, 0.1, -0.5, 0.9, -0.5, 0.1]) + 0.05 * rng.normal(size=6)
        k, value = {
            "straight": (3, off),
            "folded": (3, np.pi - 0.05 - off),
            "hip on its side": (1, np.pi / 2 - off),
            "ankle on its side": (5, np.pi / 2 - off),
        }[singular]
        angles[k] = value
        com = rng.normal(size=3)
        posture, points, sole, rotation = placed(leg, com, 0.4, angles)
        assert all(np.isfinite(np.array(value)).all() for value in posture._replace(hips=()))
        found = np.squeeze((posture.hip_point, posture.knee_point, posture.ankle_point))
        near = off < 0.05 and singular in ("straight", "hip on its side")
        if near:  # angles nearer to these than 0.0142 rad are taken as that near; the hip's yaw may then be any
            np.testing.assert_allclose(angles_of(posture)[k], value, atol=0.0142)
            np.testing.assert_allclose(found, points, atol=0.0142 * leg.shin if singular == "straight" else 1e-9)
        else:
            np.testing.assert_allclose(angles_of(posture), angles, atol=1e-6)
            np.testing.assert_allclose(found, points, atol=1e-8)


def test_a_leg_that_is_too_long_points_at_its_hip(robot):
    leg = robot.legs[Limb.LEFT_FOOT]
    position = ((leg.hip_in_com - leg.ankle_in_sole) * [1, 1, 0])[None]
    com = np.array([[0.0, 0.0, 2.0 * robot.com_height]])
    place = com, np.zeros(1), position, np.eye(3)[None]
    posture = leg_posture(leg, *place)
    assert posture.length[0] > leg.max_length and posture.knee[0] < 0.0142
    up = np.squeeze(posture.knee_point) - np.squeeze(posture.ankle_point)
    np.testing.assert_allclose(up / np.linalg.norm(up), [0.0, 0.0, 1.0], atol=0.0142)
    assert leg_clearances(leg, *place, ReachMargins())["leg length"][0] < 0.0


def test_numbers_arrays_and_symbols_take_the_same_law(robot):
    rng, leg = np.random.default_rng(6), robot.legs[Limb.RIGHT_FOOT]
    compile_once = compiled(posture_between)
    pieces()  # CasADi takes NumPy's functions from here on
    orders = itertools.cycle(itertools.permutations(range(3)))
    for _, _, _, com, position, rotation in random_legs(robot, Limb.RIGHT_FOOT, rng, 6):
        heading = (np.cos(0.3), np.sin(0.3))
        hip, ankle = com + leg.hip_in_com, position + rotation @ leg.ankle_in_sole
        column = heading[0][None], heading[1][None]
        links = leg.thigh, leg.shin, with_hips(leg, next(orders)).hips
        arrays = posture_between(hip[:, None], ankle[:, None], rotation[:, :, None], column, *links)
        numbers = compile_once(tuple(hip), tuple(ankle), rotation, heading, *links)
        given = ca.SX.sym("h", 3), ca.SX.sym("a", 3), ca.SX.sym("r", 3, 3)
        symbols = posture_between(*given, heading, *links)
        values = ca.Function("f", list(given), [ca.vertcat(*symbols[:7])])(hip, ankle, rotation)
        np.testing.assert_allclose(numbers[:7], np.squeeze(arrays[:7]), rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(np.array(values).ravel(), np.squeeze(arrays[:7]), rtol=0.0, atol=1e-12)
