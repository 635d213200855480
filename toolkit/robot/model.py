"""The robot as every stage knows it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.chain import arm_joints, joints_to
from toolkit.robot.scale import Scale


@dataclass(frozen=True)
class LimbModel:
    """A limb that can make contact.

    Attributes:
        limb: The limb.
        site: Name of the site at the centre of the contact patch; its z axis is the outward normal of the surface
            that it rests on, and x of a foot points to the toes.
        body: Name of the body that carries the site.
        half_size: Half extents (2,) float of the patch along x and y of the site, m.
        max_normal_force: Largest normal force, N; inf if only friction and weight bound it.
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
        hip_in_com: Hip centre (3,) relative to the whole-body CoM in the home posture, axes of the base, m.
        ankle_in_sole: Ankle centre (3,) in the sole (contact) frame, m.
        thigh, shin: Lengths of the two links, m.
        min_length, max_length: Distances from hip to ankle that the knee allows, with a margin to the straight leg, m.
        ranges: Joint limits (lower, upper) in rad by role: hip_yaw, hip_roll, hip_pitch, knee, ankle_pitch, ankle_roll.
            Signs: roll about x, pitch about y, yaw about z of the base or sole; a flexed knee is positive.
        torques: Torque limits by the same roles, N m.
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
        shoulder_in_com: Shoulder centre (3,) relative to the CoM in the home posture, axes of the base, m.
        min_reach, max_reach: Range of distances from shoulder to palm patch that IK can reach, m.
    """

    shoulder_in_com: np.ndarray
    min_reach: float
    max_reach: float


def half_sizes_of(limbs: Mapping[Limb, LimbModel]) -> np.ndarray:
    """Half extents (4, 2) float of patches by limb, m; zeros for a limb that is not there."""
    sizes = np.zeros((4, 2))
    for limb, model in limbs.items():
        sizes[limb] = model.half_size
    return sizes


@dataclass(frozen=True)
class RobotModel:
    """A robot, loaded and checked. Joint arrays are in MuJoCo's order of the robot compiled alone (`joint_names`).

    Attributes:
        name: Name of the robot's folder under robots/.
        folder: That folder.
        mjcf: Self-contained MJCF text of the robot alone (free joint `root_joint` on the base, torque actuators limited
            to the joint torques, contact sites named after the limbs, no world geometry).
        assets: Content by name of the files needed to compile `mjcf` (meshes); empty for primitives.
        mujoco_model: The compiled `mjcf`; nq = 7 + n, nv = 6 + n, nu = n, actuator i drives joint_names[i].
        urdf: URDF text without geometry generated from `mujoco_model`; build placo wrappers with `toolkit.robot.placo`.
        base: Name of the base body.
        joint_names: Names (n,) of the actuated joints.
        lower, upper: Position limits (n,), rad.
        velocity_limit, torque_limit: Limits (n,), rad/s and N m.
        armature: Armature (n,), kg m^2.
        kp, kd: Default joint gains (n,), N m/rad and N m s/rad.
        home: Home qpos (7 + n,): soles on z = 0, mean of the feet above the origin, heading +x.
        mass: Mass, kg.
        com_height: Height of the CoM above the soles in the home posture, m.
        limbs: Models by limb; both feet are always there.
        legs: Legs by foot.
        arms: Arms by palm.
        fingerprint: Hash of everything that the dynamics depend on, for data sets and networks.
        warnings: What was assumed, changed or found doubtful on load, one line each.
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
    warnings: tuple[str, ...] = ()

    @property
    def half_sizes(self) -> np.ndarray:
        """Half extents (4, 2) float of the patches by limb, m; zeros for a limb that the robot does not have."""
        return half_sizes_of(self.limbs)

    @property
    def scale(self) -> Scale:
        """Factors on lengths, times and forces that are written for a body of the usual size."""
        return Scale.of(float(np.mean([leg.thigh + leg.shin for leg in self.legs.values()])), self.mass)

    def joints_to(self, limb: Limb) -> np.ndarray:
        """Indices (k,) int into `joint_names` of the joints from the base to a limb, in order."""
        model = self.mujoco_model
        return np.array(joints_to(model, model.body(self.limbs[limb].body).id), int) - 1  # joint 0 is the free one

    def carrying(self, limbs: Iterable[Limb]) -> np.ndarray:
        """Whether each joint is between the base and one of the limbs, (n,) bool."""
        joints = np.zeros(len(self.joint_names), bool)
        for limb in limbs:
            joints[self.joints_to(limb)] = True
        return joints

    def arm_joints(self, palm: Limb) -> np.ndarray:
        """Indices (k,) int into `joint_names` of the joints from the trunk to a palm, in order."""
        return np.array(arm_joints(self.mujoco_model, palm), int) - 1
