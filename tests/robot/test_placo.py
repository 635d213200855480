"""Conversions between MuJoCo's and Pinocchio's states, there and back and against finite differences."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio
import pytest

from tests.shipped_robots import EVERY, loaded
from toolkit.geometry.pose import rolled_onto
from toolkit.robot.model import RobotModel
from toolkit.robot.placo import PinocchioMap, pinocchio_map, pinocchio_model, placo_wrapper


@pytest.fixture(scope="module", params=EVERY)
def robot(request: pytest.FixtureRequest) -> RobotModel:
    return loaded(request.param)


@pytest.fixture(scope="module")
def model(robot: RobotModel) -> pinocchio.Model:
    return pinocchio_model(robot)


@pytest.fixture(scope="module")
def order(robot: RobotModel, model: pinocchio.Model) -> PinocchioMap:
    return pinocchio_map(robot, model)


def states(robot: RobotModel, count: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Batches of qpos, qvel and qacc, the base in any orientation."""
    rng = np.random.default_rng(5)
    quaternions = rng.standard_normal((count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    joints = rng.uniform(robot.lower, robot.upper, (count, len(robot.joint_names)))
    qpos = np.concatenate([rng.uniform(-2, 2, (count, 3)), quaternions, joints], axis=1)
    size = (count, 6 + joints.shape[1])
    return qpos, rng.standard_normal(size), rng.standard_normal(size)


def test_there_and_back(robot: RobotModel, order: PinocchioMap) -> None:
    qpos, qvel, qacc = states(robot)
    np.testing.assert_array_equal(order.qpos_from_q(order.q_from_qpos(qpos)), qpos)
    v = order.v_from_qvel(qpos, qvel)
    np.testing.assert_allclose(order.qvel_from_v(qpos, v), qvel, atol=1e-14)
    a = order.a_from_qacc(qpos, qvel, qacc)
    one = order.a_from_qacc(qpos[3], qvel[3], qacc[3])
    np.testing.assert_array_equal(one, a[3])


def test_inputs_stay_as_they_are(robot: RobotModel, order: PinocchioMap) -> None:
    arrays = states(robot)
    copies = [array.copy() for array in arrays]
    order.v_from_qvel(*arrays[:2])
    order.a_from_qacc(*arrays)
    for array, copy in zip(arrays, copies, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_joints_have_their_own_places(robot: RobotModel, model: pinocchio.Model, order: PinocchioMap) -> None:
    n = len(robot.joint_names)
    assert (model.nq, model.nv) == (7 + n, 6 + n)
    assert sorted(order.q_index) == list(range(7, 7 + n))
    assert sorted(order.v_index) == list(range(6, 6 + n))
    np.testing.assert_array_equal(model.armature[order.v_index], robot.armature)
    assert not model.armature[:6].any()


def test_velocities_are_derivatives(robot: RobotModel, model: pinocchio.Model, order: PinocchioMap) -> None:
    """MuJoCo's and Pinocchio's integrators reach the same place from converted velocities."""
    qpos, qvel, _ = states(robot)
    step = 1e-6  # the frames' turning within the step leaves an error of step²
    for place, speed in zip(qpos, qvel, strict=True):
        moved = place.copy()
        mujoco.mj_integratePos(robot.mujoco_model, moved, speed, step)
        q = pinocchio.integrate(model, order.q_from_qpos(place), step * order.v_from_qvel(place, speed))
        np.testing.assert_allclose(order.qpos_from_q(q), moved, atol=1e-10)


def test_acceleration_is_the_change_of_velocity(robot: RobotModel, order: PinocchioMap) -> None:
    qpos, qvel, qacc = states(robot)
    step = 1e-6
    for place, speed, change in zip(qpos, qvel, qacc, strict=True):
        ends = []
        for sign in (-1, 1):
            moved = place.copy()
            mujoco.mj_integratePos(robot.mujoco_model, moved, speed, sign * step)
            ends.append(order.v_from_qvel(moved, speed + sign * step * change))
        slope = (ends[1] - ends[0]) / (2 * step)
        np.testing.assert_allclose(order.a_from_qacc(place, speed, change), slope, atol=1e-7)


def test_inverse_dynamics_agree(robot: RobotModel, model: pinocchio.Model, order: PinocchioMap) -> None:
    """The joint torques of one motion from both libraries."""
    qpos, qvel, qacc = states(robot, 3)
    data, other = mujoco.MjData(robot.mujoco_model), model.createData()
    # Inverse dynamics without contacts, limits and friction: only what both know.
    disabled = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    robot.mujoco_model.opt.disableflags |= disabled
    try:
        for place, speed, change in zip(qpos, qvel, qacc, strict=True):
            data.qpos[:], data.qvel[:], data.qacc[:] = place, speed, change
            mujoco.mj_inverse(robot.mujoco_model, data)
            q, v = order.q_from_qpos(place), order.v_from_qvel(place, speed)
            tau = pinocchio.rnea(model, other, q, v, order.a_from_qacc(place, speed, change))
            np.testing.assert_allclose(order.qvel_from_v(place, tau), data.qfrc_inverse, atol=1e-9)
    finally:
        robot.mujoco_model.opt.disableflags &= ~disabled


def test_placo_wrapper_stands_where_mujoco_stands(robot: RobotModel) -> None:
    wrapper = placo_wrapper(robot)
    order = pinocchio_map(robot, wrapper.model)
    assert set(wrapper.joint_names()) == set(robot.joint_names)
    wrapper.state.q = order.q_from_qpos(robot.home)
    wrapper.update_kinematics()
    for item in robot.limbs.values():
        frame = wrapper.get_T_world_frame(item.site)
        if item.limb.is_foot:
            assert abs(frame[2, 3]) < 3e-3
            turn = rolled_onto(frame[:3, :3], np.array([0.0, 0.0, 1.0])) if item.rolls else frame[:3, :3]
            np.testing.assert_allclose(turn[:, 2], [0, 0, 1], atol=1e-3)
    assert wrapper.com_world()[2] == pytest.approx(robot.com_height, abs=1e-9)
    order_of_armature = wrapper.model.armature[order.v_index]
    np.testing.assert_array_equal(order_of_armature, robot.armature)
