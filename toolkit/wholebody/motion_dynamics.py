"""Contact wrenches, joint torques and angular momentum that belong to a motion."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.robot.model import RobotModel

SMOOTHING = np.array([0.0625, 0.25, 0.375, 0.25, 0.0625])  # weights of neighbouring samples; they sum to 1


def planned_wrench(motion: CentroidalMotion) -> np.ndarray:
    """(N, 4, 6) planned wrenches in the contact frames: force f (N), and moment tau (N m) about the patch's centre.

    The moment is `tau = z x f + tau_n n`, from the centre of pressure z and the torque tau_n about the normal n.
    """
    force = np.einsum("nlji,nlj->nli", motion.problem.rotation, motion.force)
    lever = np.concatenate([motion.cop, np.zeros_like(motion.cop[..., :1])], axis=-1)
    moment = np.cross(lever, force)
    moment[..., 2] += motion.yaw_torque
    return np.where(motion.problem.active[..., None], np.concatenate([force, moment], axis=-1), 0.0)


def contact_wrenches(motion: CentroidalMotion, times: np.ndarray, window: float) -> np.ndarray:
    """(T, 4, 6) planned force (N) and moment (N m) at the patch centres, in the world, at times (T,) in s.

    They are averaged over a window in s around each time. Plans are constant between knots, so the average removes the
    dependence on the side of a knot.
    """
    problem = motion.problem
    force, moment = np.split(planned_wrench(motion), 2, axis=-1)
    parts = [np.einsum("nlij,nlj->nli", problem.rotation, part) for part in (force, moment)]
    wrench = np.concatenate(parts, axis=-1)
    knots = problem.times
    total = np.zeros((len(times), 4, 6))
    for offset in (-0.25 * window, 0.25 * window):
        clamped = np.clip(times + offset, 0.0, knots[-1])
        total += wrench[np.clip(np.searchsorted(knots, clamped, side="right") - 1, 0, problem.steps - 1)]
    return 0.5 * total


def velocities(model: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """(T - 1, nv) mean velocities between neighbouring samples, in MuJoCo's conventions."""
    speed = np.zeros((len(times) - 1, model.nv))
    for index in range(len(times) - 1):
        mujoco.mj_differentiatePos(model, speed[index], times[index + 1] - times[index], qpos[index], qpos[index + 1])
    return speed


def inverse_dynamics(robot: RobotModel, motion: CentroidalMotion, times: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """(T, 6 + n) `M qacc + h - J^T w` with the planned wrenches w, by MuJoCo, at uniform times (T,) in s.

    The first six are the residual at the base, zero if motion and wrenches agree exactly: force (N) in the world, and
    moment (N m) about the base in its frame. The others are the joint torques in N m.
    """
    model = copy.copy(robot.mujoco_model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    step = float(times[1] - times[0])
    between = velocities(model, times, qpos)
    wrenches = contact_wrenches(motion, times, step)
    sites = [(limb, model.site(item.site).id) for limb, item in robot.limbs.items()]
    jacobian = np.zeros((6, model.nv))
    result = np.zeros((len(times), model.nv))
    rest = np.zeros(model.nv)
    for index in range(len(times)):
        before = between[index - 1] if index > 0 else rest
        after = between[index] if index < len(between) else rest
        at_end = index in (0, len(times) - 1)
        data.qpos[:] = qpos[index]
        data.qvel[:] = 0.5 * (before + after)
        data.qacc[:] = 0.0 if at_end else (after - before) / step
        mujoco.mj_inverse(model, data)
        generalized = data.qfrc_inverse.copy()
        for limb, site in sites:
            if wrenches[index, limb].any():
                mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
                generalized -= jacobian.T @ wrenches[index, limb]
        result[index] = generalized
    return result


def posture_momentum(model: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> tuple:
    """Angular momentum about the CoM along a motion, lightly smoothed, and its rate: (T, 3) kg m^2/s and (T, 3) N m.

    Both are in the world, at times (T,) in s; `model` is the robot alone. Inverse kinematics follows the planned
    angular momentum only as far as the postures allow. A controller that tracks both the postures and a momentum must
    therefore take the momentum from the postures, or the two targets contradict each other.
    """
    data = mujoco.MjData(model)
    momentum = np.zeros((len(times), 3))
    for index in range(len(times)):
        data.qpos[:], data.qvel[:] = qpos[index], qvel[index]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        momentum[index] = data.subtree_angmom[0]
    if len(times) < len(SMOOTHING):
        return momentum, np.zeros_like(momentum)
    edge = len(SMOOTHING) // 2
    padded = np.pad(momentum, ((edge, edge), (0, 0)), mode="edge")
    momentum = np.column_stack([np.convolve(padded[:, k], SMOOTHING, "valid") for k in range(3)])
    return momentum, np.gradient(momentum, times, axis=0)
