"""Torques of joints that carry no standing foot during inverse kinematics, and bounds that keep them within the limits.

The motion of trunk, head, arms and a swinging leg alone decides these torques, but for a palm's force: with d and d'
the displacements of the last tick and of this one,

    tau = M (d' - d) / dt^2 + h - J^T w

in the rows of these joints. Where a tick asks a motor for more than its share of its limit, the same tick is solved
again under bounds `tau <= limit`, linear in the displacements of the joints. What then gives way is the momentum that
trunk and arms were to have, and the path of the foot in the midst of its swing.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.robot.model import RobotModel
from toolkit.wholebody.motion_dynamics import contact_wrenches

SHARE = 0.85  # of a joint's torque limit; the controller needs the rest to correct
NEAR = 0.7  # of that share: joints beyond it are bounded too, lest they take over what others give up


class Effort:
    """The robot's own dynamics, tick after tick.

    Attributes:
        limit: (n,) N m; of each joint, the share that may be used.
        joints: By the foot that swings, None while both stand, the joints whose torques the motion alone decides.
        sites: Of the limbs' patches, in the model.
    """

    def __init__(self, robot: RobotModel, tick: float):
        """Prepare for ticks of some s."""
        self.model = copy.copy(robot.mujoco_model)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data, self.tick = mujoco.MjData(self.model), tick
        self.limit = SHARE * robot.torque_limit
        above = np.flatnonzero(~robot.carrying(FEET))
        self.joints: dict[Limb | None, np.ndarray] = {None: above}
        self.joints |= {foot: np.union1d(above, robot.joints_to(foot)) for foot in FEET}
        self.sites = {limb: int(self.model.site(item.site).id) for limb, item in robot.limbs.items()}
        self.palms = [(limb, site) for limb, site in self.sites.items() if not limb.is_foot]
        self.jacobian = np.zeros((6, self.model.nv))

    def torques(
        self, time: float, qpos: np.ndarray, before: np.ndarray, after: np.ndarray, motion: CentroidalMotion
    ) -> np.ndarray:
        """(n,) N m; torques of all joints in a state, as if no foot were on the ground.

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
        return torque[6:]

    def exceeded(self, torque: np.ndarray, swinging: Limb | None) -> bool:
        """Whether torques (n,) of joints that a swinging foot leaves to the motion are beyond the limits."""
        joints = self.joints[swinging]
        return bool((np.abs(torque[joints]) > self.limit[joints]).any())

    def rows(
        self, torque: np.ndarray, after: np.ndarray, swinging: Limb | None, standing: Limb | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """A (m, n) and b (m,) rad of bounds `A dq <= b` over the joint displacements of a tick.

        They are linear about the displacements `after` (6 + n,) that need the torques (n,) in N m; both belong to the
        last call of `torques`. A standing foot stays where it is, so that its leg carries the base; without one the
        base moves as in `after`. A row is scaled to the displacement of its own joint.
        """
        mass = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, mass)
        joints = self.joints[swinging]
        near = joints[np.abs(torque[joints]) > NEAR * self.limit[joints]]
        dofs, sign = 6 + near, np.sign(torque[near])
        scale = self.tick**2 / mass[dofs, dofs]
        rate = mass[dofs, 6:]
        if standing is not None:
            mujoco.mj_jacSite(self.model, self.data, self.jacobian[:3], self.jacobian[3:], self.sites[standing])
            rate -= mass[dofs, :6] @ np.linalg.solve(self.jacobian[:, :6], self.jacobian[:, 6:])
        rate *= (sign / mass[dofs, dofs])[:, None]
        return rate, (self.limit[near] - np.abs(torque[near])) * scale + rate @ after[6:]
