"""Joints that lead to limbs, against what moves when they do."""

import mujoco
import numpy as np
import pytest

from tests.robot.samples import TOML, biped_mjcf
from tests.shipped_robots import EVERY, loaded
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.robot.chain import side_joints
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="module", params=EVERY)
def robot(request):
    return loaded(request.param)


def test_legs_carry_feet_and_arms_do_not(robot):
    left, right = (robot.carrying([limb]) for limb in (Limb.LEFT_FOOT, Limb.RIGHT_FOOT))
    assert not (left & right).any()
    assert left.sum() == right.sum() >= 5
    for palm in (limb for limb in robot.limbs if not limb.is_foot):
        arm = robot.carrying([palm])
        assert arm.any() and not (arm & (left | right)).any()


def test_a_limb_turns_with_the_joints_that_lead_to_it_and_no_others(robot):
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(robot.mujoco_model, data)
    mujoco.mj_comPos(robot.mujoco_model, data)
    linear, angular = np.zeros((2, 3, robot.mujoco_model.nv))
    for limb, model in robot.limbs.items():
        mujoco.mj_jacSite(robot.mujoco_model, data, linear, angular, data.site(model.site).id)
        moving = np.any([linear, angular], axis=(0, 1))[6:]
        np.testing.assert_array_equal(moving, robot.carrying([limb]))


def test_an_arm_is_the_end_of_what_leads_to_its_palm(robot):
    arms = {palm: robot.arm_joints(palm).tolist() for palm in robot.limbs if palm not in FEET}
    for palm, joints in arms.items():
        assert joints == robot.joints_to(palm).tolist()[-len(joints) :]
        assert not any(set(joints) & set(other) for limb, other in arms.items() if limb != palm)


def test_arms_are_known_without_their_palms(robot):
    """The tree alone gives the arms that lead to palms, and a trunk that carries them."""
    found = dict(zip(PALMS, side_joints(robot.mujoco_model, robot.home), strict=True))
    for palm in robot.arms:
        assert (np.array(found[palm]) - 1).tolist() == robot.arm_joints(palm).tolist()
    assert set(robot.arm_sides) == set(PALMS)
    left, right = (robot.arm_sides[palm] for palm in PALMS)
    assert len(left) == len(right) and not set(left.tolist()) & set(right.tolist())
    legs, trunk = robot.carrying(FEET), robot.trunk_joints
    assert not (legs | trunk)[np.concatenate([left, right])].any() and not (legs & trunk).any()
    sides = robot.in_arms(robot.mujoco_model)
    bodies = robot.mujoco_model.jnt_bodyid[1:]
    for palm, joints in robot.arm_sides.items():
        assert (sides[bodies[joints]] == palm).all()
    assert (sides[bodies[legs | trunk]] == -1).all()


def test_a_body_without_arms_has_none(tmp_path):
    (tmp_path / "robot.toml").write_text(TOML.format(file="robot.xml"))
    (tmp_path / "robot.xml").write_text(biped_mjcf())
    biped = load_robot(tmp_path)
    assert biped.arm_sides == {} and not biped.trunk_joints.any() and biped.turning_torque == 0.0


def test_legs_weigh_what_they_weigh(robot):
    """A heavier foot is worth its whole mass at the end of the line, and more than half of the leg's is above it."""
    mass = robot.leg_mass
    assert 0.0 < mass.second < mass.first < 0.5
    length = np.linalg.norm(mass.line, axis=1)
    leg = robot.legs[Limb.LEFT_FOOT]
    np.testing.assert_allclose(length, length.mean(), rtol=0.01)
    assert leg.min_length < length[0] <= leg.thigh + leg.shin + 1e-9
