"""Pinocchio and placo models of a robot, and the conversion of states between them and MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.geometry.pose import rotation_from_quaternion
from toolkit.robot.model import RobotModel

if TYPE_CHECKING:
    import pinocchio
    import placo

_WXYZ = [3, 4, 5, 6]
_XYZW = [4, 5, 6, 3]


@dataclass(frozen=True)
class PinocchioMap:
    """Conversions between MuJoCo's and Pinocchio's states of one robot.

    MuJoCo: qpos = (position, quaternion wxyz, joints), qvel = (linear velocity in the WORLD, angular velocity in the
    BODY, joints). Pinocchio: q = (position, quaternion xyzw, joints), v = (linear and angular velocity in the BODY,
    joints), and joints in another order.

    Attributes:
        q_index: Indices (n,) int; joint_names[i] is at q[q_index[i]].
        v_index: Indices (n,) int; joint_names[i] is at v[v_index[i]], also in torques and Jacobian columns.
    """

    q_index: np.ndarray
    v_index: np.ndarray

    @classmethod
    def of(cls, joint_names: Sequence[str], model: pinocchio.Model) -> PinocchioMap:
        """Map between joints in MuJoCo's order and the vectors of a Pinocchio model."""
        joints = [model.joints[model.getJointId(name)] for name in joint_names]
        return cls(np.array([joint.idx_q for joint in joints], int), np.array([joint.idx_v for joint in joints], int))

    def q_from_qpos(self, qpos: np.ndarray) -> np.ndarray:
        """Pinocchio configuration (..., 7 + n) of MuJoCo's qpos (..., 7 + n)."""
        qpos = np.asarray(qpos, float)
        q = np.empty_like(qpos)
        q[..., :3], q[..., 3:7] = qpos[..., :3], qpos[..., _XYZW]
        q[..., self.q_index] = qpos[..., 7:]
        return q

    def qpos_from_q(self, q: np.ndarray) -> np.ndarray:
        """MuJoCo's qpos (..., 7 + n) of a Pinocchio configuration (..., 7 + n)."""
        q = np.asarray(q, float)
        qpos = np.empty_like(q)
        qpos[..., :3], qpos[..., _XYZW] = q[..., :3], q[..., 3:7]
        qpos[..., 7:] = q[..., self.q_index]
        return qpos

    def v_from_qvel(self, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Pinocchio velocity (..., 6 + n) of MuJoCo's qvel (..., 6 + n) at qpos (..., 7 + n)."""
        qvel = np.asarray(qvel, float)
        v = np.empty_like(qvel)
        rotation = rotation_from_quaternion(np.asarray(qpos)[..., _WXYZ])
        v[..., :3] = np.einsum("...ji,...j->...i", rotation, qvel[..., :3])
        v[..., 3:6] = qvel[..., 3:6]
        v[..., self.v_index] = qvel[..., 6:]
        return v

    def qvel_from_v(self, qpos: np.ndarray, v: np.ndarray) -> np.ndarray:
        """MuJoCo's qvel (..., 6 + n) of a Pinocchio velocity (..., 6 + n) at qpos (..., 7 + n)."""
        v = np.asarray(v, float)
        qvel = np.empty_like(v)
        rotation = rotation_from_quaternion(np.asarray(qpos)[..., _WXYZ])
        qvel[..., :3] = np.einsum("...ij,...j->...i", rotation, v[..., :3])
        qvel[..., 3:6] = v[..., 3:6]
        qvel[..., 6:] = v[..., self.v_index]
        return qvel

    def a_from_qacc(self, qpos: np.ndarray, qvel: np.ndarray, qacc: np.ndarray) -> np.ndarray:
        """Pinocchio acceleration (..., 6 + n) of MuJoCo's qacc (..., 6 + n).

        d/dt (Rᵀ v) = Rᵀ a - ω × (Rᵀ v), with ω in the body.
        """
        a, v = self.v_from_qvel(qpos, qacc), self.v_from_qvel(qpos, qvel)
        a[..., :3] -= np.cross(v[..., 3:6], v[..., :3])
        return a

    def matrix_to_mujoco(self, qpos: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        """Turn a symmetric matrix (6 + n, 6 + n) over Pinocchio velocities, such as the mass, into one over qvel."""
        basis = np.stack([self.v_from_qvel(qpos, row) for row in np.eye(len(matrix))], axis=1)  # v = basis @ qvel
        return basis.T @ matrix @ basis


def placo_wrapper(robot: RobotModel) -> placo.RobotWrapper:
    """A new placo robot at its neutral configuration, with the robot's armature.

    `wrapper.model` is its pinocchio.Model; the frames have the names of bodies and contact sites.
    """
    import placo  # here, since it takes long to import

    wrapper = placo.RobotWrapper("", placo.Flags.ignore_collisions, robot.urdf)
    wrapper.model.armature = _armature(robot, pinocchio_map(robot, wrapper.model))
    return wrapper


def pinocchio_model(robot: RobotModel) -> pinocchio.Model:
    """A Pinocchio model of the robot alone, with its armature (lighter than a placo wrapper)."""
    import pinocchio

    model = pinocchio.buildModelFromXML(robot.urdf, pinocchio.JointModelFreeFlyer())
    model.armature = _armature(robot, pinocchio_map(robot, model))
    return model


def pinocchio_map(robot: RobotModel, model: pinocchio.Model) -> PinocchioMap:
    """Index maps between `robot.joint_names` and a Pinocchio model's vectors."""
    return PinocchioMap.of(robot.joint_names, model)


def _armature(robot: RobotModel, order: PinocchioMap) -> np.ndarray:
    armature = np.zeros(6 + len(robot.joint_names))
    armature[order.v_index] = robot.armature
    return armature
