"""Angular momentum that a whole-body motion has."""

from __future__ import annotations

import mujoco
import numpy as np

SMOOTHING = np.array([0.0625, 0.25, 0.375, 0.25, 0.0625])  # of neighbouring samples: velocities are differences


def posture_momentum(model: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> tuple:
    """Angular momentum about the CoM along a motion, lightly smoothed, and its rate.

    Inverse kinematics follows the planned angular momentum only as far as the postures allow; whoever tracks both the
    postures and a momentum must take the momentum from the postures, or the two pull against each other.

    Args:
        model: of the robot alone.
        times: (T,) s.
        qpos: (T, 7 + n).
        qvel: (T, 6 + n), MuJoCo conventions.

    Returns:
        (T, 3) kg m^2/s and (T, 3) N m in the world.
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
