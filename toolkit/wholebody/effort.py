"""Torques of the joints above the legs during inverse kinematics, and bounds that keep them within the motors' limits.

The motion of trunk, head and arms alone decides these torques, but for a palm's force: with d and d' the displacements
of the last tick and of this one,

    tau = M (d' - d) / dt^2 + h - J^T w

in the rows of these joints. Where a tick asks a motor for more than its share of its limit, the same tick is solved
again under bounds `tau <= limit`, linear in the displacements of the joints. What then gives way is the momentum that
trunk and arms were to have.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.geometry.limb import FEET, PALMS
from toolkit.robot.model import RobotModel
from toolkit.wholebody.motion_dynamics import contact_wrenches

SHARE = 0.85  # of a joint's torque limit; the controller needs the rest to correct
NEAR = 0.7  # of that share: joints beyond it are bounded too, lest they take over what others give up


class Effort:
    """The robot's own dynamics, tick after tick."""

    def __init__(self, robot: RobotModel, tick: float):
        """Prepare for ticks of some s."""
        self.model = copy.copy(robot.mujoco_model)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data, self.tick = mujoco.MjData(self.model), tick
        self.joints = np.flatnonzero(~robot.carrying(FEET))
        self.limit = SHARE * robot.torque_limit[self.joints]
        self.palms = [(limb, self.model.site(item.site).id) for limb, item in robot.limbs.items() if not limb.is_foot]
        self.jacobian = np.zeros((6, self.model.nv))

    def torques(
        self, time: float, qpos: np.ndarray, before: np.ndarray, after: np.ndarray, motion: CentroidalMotion
    ) -> np.ndarray:
        """(k,) N m; torques of the joints above the legs in a state.

        Args:
            time: s.
            qpos: (7 + n,) state.
            before: (6 + n,) displacement of the tick before it, as MuJoCo's qvel times the tick.
            after: (6 + n,) displacement of the tick after it.
            motion: The contact wrenches.
        """
        data = self.data
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, before / self.tick, (after - before) / self.tick**2
        mujoco.mj_inverse(self.model, data)
        torque = data.qfrc_inverse.copy()
        if motion.problem.active[:, PALMS].any():
            wrench = contact_wrenches(motion, np.array([time]), self.tick)[0]
            for limb, site in self.palms:
                if wrench[limb].any():
                    mujoco.mj_jacSite(self.model, data, self.jacobian[:3], self.jacobian[3:], site)
                    torque -= self.jacobian.T @ wrench[limb]
        return torque[6 + self.joints]

    def exceeded(self, torque: np.ndarray) -> bool:
        """Whether torques (k,) are beyond the limits."""
        return bool((np.abs(torque) > self.limit).any())

    def rows(self, torque: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A (m, n) and b (m,) rad of bounds `A dq <= b` over the joint displacements of a tick.

        They are linear about the displacements `after` (6 + n,) that need the torques (k,) in N m; both belong to the
        last call of `torques`. A row is scaled to the displacement of its own joint.
        """
        mass = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, mass)
        near = np.flatnonzero(np.abs(torque) > NEAR * self.limit)
        dofs, sign = 6 + self.joints[near], np.sign(torque[near])
        scale = self.tick**2 / mass[dofs, dofs]
        rate = sign[:, None] * mass[dofs, 6:] / mass[dofs, dofs][:, None]
        return rate, (self.limit[near] - np.abs(torque[near])) * scale + rate @ after[6:]
