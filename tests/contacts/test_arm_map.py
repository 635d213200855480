"""ArmMap: agrees with MuJoCo's kinematics, serves what arms can do and nothing else."""

import mujoco
import numpy as np
import pytest

from tests.shipped_robots import OWN
from toolkit.contacts.arm_map import MARGIN, ArmMap
from toolkit.robot.chain import arm_joints
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="module", params=[name for name in OWN if load_robot(name).arms])
def robot(request):
    return load_robot(request.param)


@pytest.fixture(scope="module")
def maps(robot):
    return {limb: ArmMap.of(robot, limb) for limb in robot.arms}


def test_samples_are_where_the_kinematics_put_them(robot, maps):
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    for limb, arm in maps.items():
        address = model.jnt_qposadr[arm_joints(model, limb)]
        data.qpos[:] = robot.home
        mujoco.mj_forward(model, data)
        base = data.xmat[1].reshape(3, 3).copy()
        shoulder = data.subtree_com[1] + base @ robot.arms[limb].shoulder_in_com
        for row in range(0, len(arm.angles), len(arm.angles) // 20):
            data.qpos[address] = arm.angles[row]
            mujoco.mj_kinematics(model, data)
            site = data.site(robot.limbs[limb].site)
            np.testing.assert_allclose(arm.positions[row], base.T @ (site.xpos - shoulder), atol=1e-9)
            np.testing.assert_allclose(arm.normals[row], base.T @ site.xmat.reshape(3, 3)[:, 2], atol=1e-9)


def test_angles_keep_off_the_ends_of_the_ranges(robot, maps):
    for limb, arm in maps.items():
        low, high = robot.mujoco_model.jnt_range[arm_joints(robot.mujoco_model, limb)].T
        margin = np.minimum(MARGIN, 0.2 * (high - low)) - 1e-9
        assert (arm.angles >= low + margin).all() and (arm.angles <= high - margin).all()


def test_what_an_arm_does_is_served_and_what_it_cannot_is_not(robot, maps):
    for limb, arm in maps.items():
        rows = np.arange(0, len(arm.positions), 997)
        assert arm.serves(arm.positions[rows], arm.normals[rows]).all()
        far = np.array([[0.0, 2.0 * robot.arms[limb].max_reach, 0.0]])
        assert not arm.serves(far, arm.normals[:1]).any()
        # A palm at full stretch cannot face the shoulder's own side.
        stretched = np.linalg.norm(arm.positions, axis=1).argmax()
        outward = arm.positions[stretched] / np.linalg.norm(arm.positions[stretched])
        assert not arm.serves(arm.positions[stretched][None], outward[None]).any()


def test_mirrored_palms_are_served_alike(robot, maps):
    if len(maps) < 2:
        pytest.skip("one arm")
    left, right = (maps[limb] for limb in sorted(maps))
    rows = np.arange(0, len(left.positions), 499)
    mirror = np.array([1.0, -1.0, 1.0])
    assert right.serves(left.positions[rows] * mirror, left.normals[rows] * mirror).all()


def test_a_posture_brings_the_palm_near_and_changes_little(maps):
    for arm in maps.values():
        row = len(arm.angles) // 3
        near = arm.angles[row] + 0.01
        found = arm.posture(arm.positions[row], arm.normals[row], near)
        np.testing.assert_array_equal(found, arm.angles[row])
