"""Joints that lead to limbs, against what moves when they do."""

import mujoco
import numpy as np
import pytest

from tests.shipped_robots import EVERY
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="module", params=EVERY)
def robot(request):
    return load_robot(request.param)


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
