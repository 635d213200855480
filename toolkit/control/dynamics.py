"""RobotDynamics: the controller's model of the robot, apart from the simulation's."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.geometry.pose import rolled_onto
from toolkit.robot.model import RobotModel


class RobotDynamics:
    """Equation of motion, limb Jacobians and momentum of the robot compiled alone, evaluated into fixed arrays.

        mass_matrix @ qdd + bias = S.T tau + sum_i jacobian_i.T wrench_i

    Velocities and accelerations follow MuJoCo: base linear in the world, base angular in the base, joints. The rows of
    the floating base hold the momentum: with p the base's origin, R its rotation, c the CoM, F the first three rows
    and N the next three of `mass_matrix @ qdd + bias`,

        m c'' - m g = F,   k' = R N - (c - p) x F,

    where gravity cancels in the second, so that no separate Jacobian of CoM or momentum is needed.

    Attributes:
        model, data: The robot alone, and its state.
        nv: Number of degrees of freedom, 6 + n.
        mass: Mass in kg.
        limbs: The limbs that the robot has.
        rolling: Those of them whose soles roll.
        mass_matrix, bias: (nv, nv), and (nv,) Coriolis and gravity forces less passive joint forces.
        jacobian, drift: (4, 6, nv) of the linear, then angular velocity of each limb's site in the world, and (4, 6)
            dJ/dt v. Both are zero for missing limbs.
        limb_position, limb_rotation, limb_velocity: (4, 3), (4, 3, 3) world_from_limb and (4, 6).
        com, com_velocity, angular_momentum: Each (3,), the last about the CoM.
        com_jacobian, com_drift: (3, nv) and (3,), so that c'' = com_jacobian @ qdd + com_drift.
        momentum_jacobian, momentum_drift: (3, nv) and (3,), so that k' = momentum_jacobian @ qdd + momentum_drift.
        base_rotation: (3, 3) world_from_base.
    """

    def __init__(self, robot: RobotModel):
        self.model, self.data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
        model, data = self.model, self.data
        self.nv = model.nv
        self._base = model.body(robot.base).id
        self.mass = float(model.body_subtreemass[self._base])
        self.gravity = np.array(model.opt.gravity)
        self.limbs = tuple(sorted(robot.limbs))
        self.rolling = tuple(limb for limb in self.limbs if robot.limbs[limb].rolls)
        self._sites = {limb: model.site(robot.limbs[limb].site).id for limb in self.limbs}
        self._bodies = {limb: int(model.site_bodyid[site]) for limb, site in self._sites.items()}
        self.mass_matrix = np.zeros((self.nv, self.nv))
        self.bias = np.zeros(self.nv)
        self.jacobian = np.zeros((4, 6, self.nv))
        self.drift = np.zeros((4, 6))
        self.limb_position = np.zeros((4, 3))
        self.limb_rotation = np.tile(np.eye(3), (4, 1, 1))
        self.limb_velocity = np.zeros((4, 6))
        self.com_jacobian = np.zeros((3, self.nv))
        self.com_drift = np.zeros(3)
        self.com_velocity = np.zeros(3)
        self.momentum_jacobian = np.zeros((3, self.nv))
        self.momentum_drift = np.zeros(3)
        self.angular_momentum = np.zeros(3)
        self._dot = np.zeros((6, self.nv))
        self.com = data.subtree_com[self._base]
        self.base_rotation = data.xmat[self._base].reshape(3, 3)
        self.base_position = data.xpos[self._base]

    def update(self, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Evaluate everything at a state (7 + n,), (6 + n,) in MuJoCo's order."""
        model, data = self.model, self.data
        data.qpos[:] = qpos
        data.qvel[:] = qvel
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_passive(model, data)
        mujoco.mj_rne(model, data, 0, self.bias)
        self.bias -= data.qfrc_passive
        mujoco.mj_fullM(model, data, self.mass_matrix)
        self._momentum(qvel)
        for limb in self.limbs:
            site, jacobian, dot = self._sites[limb], self.jacobian[limb], self._dot
            self.limb_position[limb] = data.site_xpos[site]
            self.limb_rotation[limb] = data.site_xmat[site].reshape(3, 3)
            mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
            mujoco.mj_jacDot(model, data, dot[:3], dot[3:], data.site_xpos[site], self._bodies[limb])
            np.dot(jacobian, qvel, out=self.limb_velocity[limb])
            np.dot(dot, qvel, out=self.drift[limb])

    def roll_soles(self, normals: np.ndarray) -> None:
        """Take the frames of soles that roll as turned about their x axes onto normals (4, 3): contacts do not roll."""
        for limb in self.rolling:
            self.limb_rotation[limb] = rolled_onto(self.limb_rotation[limb], normals[limb])

    def _momentum(self, qvel: np.ndarray) -> None:
        """Evaluate momentum and its rate from the base's rows of the equation of motion."""
        mass, rotation = self.mass, self.base_rotation
        x, y, z = self.com - self.base_position
        lever = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        linear, angular = self.mass_matrix[:3], self.mass_matrix[3:6]
        np.divide(linear, mass, out=self.com_jacobian)
        np.divide(self.bias[:3], mass, out=self.com_drift)
        self.com_drift += self.gravity
        np.dot(self.com_jacobian, qvel, out=self.com_velocity)
        np.dot(rotation, angular, out=self.momentum_jacobian)
        self.momentum_jacobian -= lever @ linear
        np.dot(rotation, self.bias[3:6], out=self.momentum_drift)
        self.momentum_drift -= lever @ self.bias[:3]
        np.dot(self.momentum_jacobian, qvel, out=self.angular_momentum)
