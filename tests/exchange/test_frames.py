"""Frames are the run at its samples, and lie between them elsewhere."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit.exchange.frames import _Grid, frames_of
from toolkit.geometry.limb import Limb

CLOSE = 1e-6


@pytest.fixture(scope="session")
def frames(record, robot):
    return frames_of(record, robot, 50.0)


def test_frames_on_samples_are_the_samples(frames, record, walked):
    rows = np.round(frames.times / 0.002).astype(int)
    samples = walked.samples
    assert np.allclose(frames.times, samples.tick_times[rows], rtol=0, atol=1e-12)
    assert frames.times[-1] + 0.02 > samples.tick_times[-1]
    assert np.array_equal(frames.qpos, samples.qpos[rows])
    # what the run's folder holds in single precision is compared with what it was before
    for found, meant in (
        (frames.qvel, samples.qvel),
        (frames.torque, samples.torque),
        (frames.force, samples.wrench[..., :3]),
        (frames.moment, samples.wrench[..., 3:]),
        (frames.com, samples.com),
        (np.hstack([frames.linear_momentum, frames.angular_momentum]), samples.momentum),
        (frames.limb_pose[..., :3], samples.limb_pose[..., :3]),
    ):
        assert np.allclose(found, meant[rows], rtol=CLOSE, atol=2 * CLOSE, equal_nan=True)


def test_bodies_move_as_differences_say(record, robot):
    frames = frames_of(record, robot, 500.0)
    middle = slice(1, -1)
    speed = (frames.body_position[2:] - frames.body_position[:-2]) / 0.004
    assert np.percentile(np.abs(speed - frames.body_velocity[middle]), 99) < 0.02
    for body in (0, -1):
        turned = Rotation.from_quat(frames.body_quaternion_wxyz[:, body], scalar_first=True)
        spin = (turned[2:] * turned[:-2].inv()).as_rotvec() / 0.004
        assert np.percentile(np.abs(spin - frames.body_spin[middle, body]), 99) < 0.05


def test_targets_make_the_torques(frames, robot):
    torque = robot.kp * (frames.target - frames.qpos[:, 7:]) - robot.kd * frames.qvel[:, 6:]
    assert np.allclose(torque, frames.torque, rtol=0, atol=1e-9)


def test_labels_follow_the_plan(frames, walking):
    in_plan = [{c.limb for c in walking.schedule.phase_at(float(time)).contacts} for time in frames.times]
    expected = np.array([[limb in held for limb in Limb] for held in in_plan])
    assert np.array_equal(frames.planned_contact, expected)
    assert (frames.contact == expected).mean() > 0.97  # touchdowns are a few frames early or late
    assert not frames.contact.all(axis=0).any()  # each limb swings, or is free


def test_planned_frames_are_the_plan(record, robot, walking):
    trajectory = walking.trajectory
    frames = frames_of(record, robot, 1.0 / (trajectory.times[1] - trajectory.times[0]), planned=True)
    assert np.allclose(frames.qpos, trajectory.qpos, rtol=0, atol=CLOSE)
    assert np.allclose(frames.torque, trajectory.torque, rtol=0, atol=CLOSE)
    assert np.array_equal(frames.contact, frames.planned_contact)
    knots = walking.motion.problem.times
    com = np.column_stack([np.interp(frames.times, knots, walking.motion.com[:, k]) for k in range(3)])
    assert np.abs(frames.com - com).max() < 0.02


def test_other_rates_lie_between_samples(record, robot):
    fine, coarse = frames_of(record, robot, 500.0), frames_of(record, robot, 30.0)
    assert np.allclose(np.diff(coarse.times), 1 / 30)
    for k, time in enumerate(coarse.times):
        first = int(np.floor(time / 0.002 + 1e-6))
        after = min(first + 1, len(fine.times) - 1)
        low, high = np.sort(fine.qpos[[first, after], 7:], axis=0)
        assert (coarse.qpos[k, 7:] >= low - 1e-12).all() and (coarse.qpos[k, 7:] <= high + 1e-12).all()
    assert np.allclose(np.linalg.norm(coarse.qpos[:, 3:7], axis=1), 1.0, rtol=0, atol=1e-12)


def test_slerp_turns_evenly_and_keeps_signs():
    turns = Rotation.from_rotvec(np.array([[0, 0, 0], [0, 0, 1.0], [0, 0, 3.0]])).as_quat(scalar_first=True)
    turns[1] *= -1.0
    grid = _Grid.of(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.25, 0.5, 1.0, 1.5, 2.0]))
    found = grid.turned(turns)
    angles = Rotation.from_quat(found, scalar_first=True).as_rotvec()[:, 2]
    assert np.allclose(angles, [0.0, 0.25, 0.5, 1.0, 2.0, 3.0], rtol=0, atol=1e-12)
    assert ((found[1:] * found[:-1]).sum(1) > 0).all()
    assert np.array_equal(grid.linear(np.array([[0.0], [1.0], [5.0]]))[:, 0], [0.0, 0.25, 0.5, 1.0, 3.0, 5.0])


def test_a_joint_without_gain_has_no_target(record, robot):
    from dataclasses import replace

    kp = robot.kp.copy()
    kp[0] = 0.0
    frames = frames_of(record, replace(robot, kp=kp), 10.0)
    assert np.isnan(frames.target[:, 0]).all() and np.isfinite(frames.target[:, 1:]).all()


def test_bodies_are_those_of_the_robot_alone(frames, robot):
    data = mujoco.MjData(robot.mujoco_model)
    for row in (0, len(frames.times) // 2, -1):
        data.qpos[:] = frames.qpos[row]
        mujoco.mj_kinematics(robot.mujoco_model, data)
        assert np.allclose(data.xpos[1:], frames.body_position[row], rtol=0, atol=1e-9)
        assert np.allclose(data.xquat[1:], frames.body_quaternion_wxyz[row], rtol=0, atol=1e-9)
