"""RobotModel: what every stage knows about the robot."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.chain import arm_joints, joints_to


@dataclass(frozen=True)
class LimbModel:
    """A limb that can make contact.

    Attributes:
        limb: which one.
        site: name of the site at the centre of the contact patch; its z axis is the outward normal of the surface
            that it rests on, x of a foot points to the toes.
        body: name of the body that carries the site.
        half_size: (2,) float, m; half extents of the patch along x and y of the site.
        max_normal_force: N; inf where only friction and weight bound it.
    """

    limb: Limb
    site: str
    body: str
    half_size: np.ndarray
    max_normal_force: float = float("inf")


@dataclass(frozen=True)
class LegGeometry:
    """A leg as two links between hip centre and ankle centre, for constraints on the CoM (derived on load).

    Attributes:
        hip_in_com: (3,) m; hip centre relative to the whole-body CoM in the home posture, axes of the base.
        ankle_in_sole: (3,) m; ankle centre in the sole (contact) frame.
        thigh, shin: m.
        min_length, max_length: m; distance from hip to ankle that the knee range allows, with a margin from straight.
        ranges: joint limits (lower, upper) in rad by role: hip_yaw, hip_roll, hip_pitch, knee, ankle_pitch, ankle_roll.
            Signs: roll about x, pitch about y, yaw about z of the base / sole; a flexed knee is positive.
        torques: torque limits in N m by the same roles.
    """

    hip_in_com: np.ndarray
    ankle_in_sole: np.ndarray
    thigh: float
    shin: float
    min_length: float
    max_length: float
    ranges: dict[str, tuple[float, float]]
    torques: dict[str, float]


@dataclass(frozen=True)
class ArmGeometry:
    """An arm as a reach around the shoulder centre (derived on load).

    Attributes:
        shoulder_in_com: (3,) m; shoulder centre relative to the CoM in the home posture, axes of the base.
        min_reach, max_reach: m; distances from shoulder to palm patch that IK can serve.
    """

    shoulder_in_com: np.ndarray
    min_reach: float
    max_reach: float


@dataclass(frozen=True)
class RobotModel:
    """A robot, loaded and checked. Joint arrays are in MuJoCo's order of the robot compiled alone (`joint_names`).

    Attributes:
        name: folder name under robots/.
        folder: that folder.
        mjcf: self-contained MJCF text of the robot alone (free joint `root_joint` on the base, torque actuators limited
            to the joint torques, contact sites named after the limbs, no world geometry).
        assets: file name -> bytes needed to compile `mjcf` (meshes); empty for primitives.
        mujoco_model: `mjcf` compiled; nq = 7 + n, nv = 6 + n, nu = n, actuator i drives joint_names[i].
        urdf: URDF text without geometry generated from `mujoco_model`; build placo wrappers with `toolkit.robot.placo`.
        base: name of the base body.
        joint_names: (n,) actuated joints.
        lower, upper: (n,) rad position limits.
        velocity_limit: (n,) rad/s.
        torque_limit: (n,) N m.
        armature: (n,) kg m^2.
        kp, kd: (n,) default joint gains, N m/rad and N m s/rad.
        home: (7 + n,) qpos of the home posture, soles on z = 0, mean of the feet above the origin, heading +x.
        mass: kg.
        com_height: m above the soles in the home posture.
        limbs: limb -> LimbModel; both feet always.
        legs: foot limb -> LegGeometry.
        arms: palm limb -> ArmGeometry.
        fingerprint: hash of everything that the dynamics depend on (for data sets and networks).
    """

    name: str
    folder: Path
    mjcf: str
    assets: dict[str, bytes] = field(repr=False)
    mujoco_model: mujoco.MjModel = field(repr=False)
    urdf: str = field(repr=False)
    base: str
    joint_names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity_limit: np.ndarray
    torque_limit: np.ndarray
    armature: np.ndarray
    kp: np.ndarray
    kd: np.ndarray
    home: np.ndarray
    mass: float
    com_height: float
    limbs: dict[Limb, LimbModel]
    legs: dict[Limb, LegGeometry]
    arms: dict[Limb, ArmGeometry]
    fingerprint: str

    @property
    def half_sizes(self) -> np.ndarray:
        """(4, 2) float, m; patch half extents by limb, zeros for a limb the robot has not."""
        sizes = np.zeros((4, 2))
        for limb, model in self.limbs.items():
            sizes[limb] = model.half_size
        return sizes

    def joints_to(self, limb: Limb) -> np.ndarray:
        """(k,) int; indices into `joint_names` of the joints from the base to a limb, in order."""
        model = self.mujoco_model
        return np.array(joints_to(model, model.body(self.limbs[limb].body).id), int) - 1  # joint 0 is the free one

    def carrying(self, limbs: Iterable[Limb]) -> np.ndarray:
        """(n,) bool; joints from the base to any of some limbs."""
        joints = np.zeros(len(self.joint_names), bool)
        for limb in limbs:
            joints[self.joints_to(limb)] = True
        return joints

    def arm_joints(self, palm: Limb) -> np.ndarray:
        """(k,) int; indices into `joint_names` of the joints from the trunk to a palm, in order."""
        return np.array(arm_joints(self.mujoco_model, palm), int) - 1
