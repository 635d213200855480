"""ArmMap: where a palm can be held, and facing which way.

The trunk is upright, and no joint comes near the end of its range. The distance to the shoulder does not tell this:
near the trunk the elbow reaches its end, and a wrist turns a palm only so far. The map holds the palms of evenly spread
joint angles. The arm can hold a palm if one of these is near to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.chain import arm_joints
from toolkit.robot.model import RobotModel

if TYPE_CHECKING:
    from scipy.spatial import KDTree

SAMPLES = 2**17  # joint angles of a map
MARGIN = 0.15  # rad; distance from both ends of each joint's range, at most a fifth of the range
# How far a palm may be from a sample, since the trunk can lean: m for a body of the usual size (`toolkit.robot.scale`),
# and rad.
NEAR = (0.05, 0.25)


@dataclass(frozen=True)
class ArmMap:
    """Palms that an arm can hold.

    Attributes:
        positions: (n, 3) Patches relative to the shoulder in the axes of the upright base, in m.
        normals: (n, 3) Unit z axes of the patches: the outward normals of the surfaces that they rest on.
        angles: (n, k) Angles of the joints from the trunk to the palm, in rad.
        near: How far a palm may be from a sample, in m.
    """

    positions: np.ndarray
    normals: np.ndarray
    angles: np.ndarray
    near: float

    @staticmethod
    def of(robot: RobotModel, limb: Limb) -> ArmMap:
        """Map of one arm. The other joints stay at home, and the angles are the same every time (a Sobol sequence)."""
        from scipy.stats import qmc  # here, since it takes long to import

        model = robot.mujoco_model
        data = mujoco.MjData(model)
        data.qpos[:] = robot.home
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        base = data.xmat[1].reshape(3, 3).copy()
        shoulder = data.subtree_com[1] + base @ robot.arms[limb].shoulder_in_com
        joints = arm_joints(model, limb)
        low, high = model.jnt_range[joints].T
        margin = np.minimum(MARGIN, 0.2 * (high - low))
        unit = qmc.Sobol(len(joints), scramble=False).random(SAMPLES)
        flipped = _flipped(robot, data, limb, joints)
        unit[:, flipped] = 1.0 - unit[:, flipped]
        angles = low + margin + unit * (high - low - 2 * margin)
        turned = angles - data.qpos[model.jnt_qposadr[joints]]
        site = model.site(robot.limbs[limb].site).id
        positions = np.tile(data.site_xpos[site], (SAMPLES, 1))
        normals = np.tile(data.site_xmat[site, 2::3], (SAMPLES, 1))
        for row, joint in reversed(list(enumerate(joints))):  # from the hand to the shoulder, by axes at home
            axis, anchor = data.xaxis[joint], data.xanchor[joint]
            positions = anchor + _rotated(positions - anchor, axis, turned[:, row])
            normals = _rotated(normals, axis, turned[:, row])
        return ArmMap((positions - shoulder) @ base, normals @ base, angles, robot.scale.length * NEAR[0])

    def serves(self, positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(n,) bool; whether the arm can hold palms.

        Args:
            positions: (n, 3) Places relative to the shoulder in the yaw frame of the base, in m.
            normals: (n, 3) Outward normals of the surfaces in the same frame.
        """
        return self._tree.query(self._scaled(positions, normals), distance_upper_bound=1.0)[0] < 1.0

    def posture(self, position: np.ndarray, normal: np.ndarray, near: np.ndarray) -> np.ndarray:
        """(k,) rad; among 64 samples around a palm, the joint angles that are nearest to `near` (k,)."""
        scaled = self._scaled(position[None], normal[None])[0]
        distance, rows = map(np.asarray, self._tree.query(scaled, 64))
        rows = rows[distance < max(1.0, 1.5 * distance[0])]
        return self.angles[rows[np.argmin(np.square(self.angles[rows] - near).sum(1))]]

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self._scaled(self.positions, self.normals))

    def _scaled(self, positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
        return np.hstack([positions / self.near, normals / NEAR[1]])


def _flipped(robot: RobotModel, data: mujoco.MjData, limb: Limb, joints: list[int]) -> np.ndarray:
    """(k,) bool; joints of a right arm that turn against the left arm's, so that mirrored arms get mirrored maps."""
    others = arm_joints(robot.mujoco_model, limb.mirrored) if limb.mirrored in robot.arms else []
    if limb.is_left or len(others) != len(joints):
        return np.zeros(len(joints), bool)
    mirrored = data.xaxis[others] * [-1.0, 1.0, -1.0]  # an axis of rotation is a pseudo-vector; home faces along x
    return (mirrored * data.xaxis[joints]).sum(1) < 0.0


def _rotated(vectors: np.ndarray, axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) turned about a unit axis (3,) by angles (n,) in rad (Rodrigues' formula)."""
    along = (vectors @ axis)[:, None] * axis
    return along + np.cos(angle)[:, None] * (vectors - along) + np.sin(angle)[:, None] * np.cross(axis, vectors)
