"""Joint torques that a whole-body motion needs under the planned contact wrenches."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.robot.model import RobotModel


def contact_wrenches(motion: CentroidalMotion, times: np.ndarray, window: float) -> np.ndarray:
    """Planned wrenches at the patch centres, averaged over a window around each time.

    The wrench of a contact is force f, and moment `tau = R (z x R^T f) + tau_n n` about the patch centre, with z the
    centre of pressure in the patch and tau_n the torque about the normal n.

    Args:
        motion: centroidal motion.
        times: (T,) s.
        window: s; plans are constant between knots, so an average removes the dependence on the side of a knot.

    Returns:
        (T, 4, 6) force and moment in the world.
    """
    problem = motion.problem
    force = motion.force
    local = np.einsum("tlji,tlj->tli", problem.rotation, force)
    cop = np.concatenate([motion.cop, np.zeros((*motion.cop.shape[:2], 1))], -1)
    moment = np.einsum("tlij,tlj->tli", problem.rotation, np.cross(cop, local))
    moment = moment + motion.yaw_torque[..., None] * problem.rotation[..., 2]
    wrench = np.where(problem.active[..., None], np.concatenate([force, moment], -1), 0.0)
    knots = problem.times
    total = np.zeros((len(times), 4, 6))
    for offset in (-0.25 * window, 0.25 * window):
        clamped = np.clip(times + offset, 0.0, knots[-1])
        total += wrench[np.clip(np.searchsorted(knots, clamped, side="right") - 1, 0, problem.steps - 1)]
    return 0.5 * total


def velocities(model: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """(T - 1, nv) mean velocities between neighbouring samples, MuJoCo conventions."""
    speed = np.zeros((len(times) - 1, model.nv))
    for index in range(len(times) - 1):
        mujoco.mj_differentiatePos(model, speed[index], times[index + 1] - times[index], qpos[index], qpos[index + 1])
    return speed


def inverse_dynamics(
    robot: RobotModel, motion: CentroidalMotion, times: np.ndarray, qpos: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Torques `M qacc + h - J^T w` with the planned wrenches w, by MuJoCo.

    Args:
        robot: the robot.
        motion: for the wrenches.
        times: (T,) s, uniform.
        qpos: (T, 7 + n).

    Returns:
        (T, n) N m of the joints, and (T, 6) what remains at the base: zero if motion and wrenches agree exactly
        (force in the world, moment about the base in its frame).
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
    return result[:, 6:], result[:, :6]
