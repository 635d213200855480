"""The robot as every stage knows it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.chain import arm_joints, bodies_above, joints_to, side_joints
from toolkit.robot.mend import geom_points
from toolkit.robot.scale import Scale, pendulum_pace, rotor_factor

_LATERAL = 0.5  # least |cosine| between the axis of a joint that turns about the lateral axis and that axis
_SHOULDER = 3  # joints of a shoulder
_CLEAR = 0.003  # m; kept free around a foot that is wider than its sole
LINE = 0.002
"""m; half the width of the line on which a sole that rolls stands: its edge is round by about as much."""


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
        rolls: Whether a foot rolls about the x axis of its site while it is in contact, because its leg has no ankle
            roll. It stands on the line along that axis, and its patch is only the room that it takes.
    """

    limb: Limb
    site: str
    body: str
    half_size: np.ndarray
    max_normal_force: float = float("inf")
    rolls: bool = False

    @property
    def bearing(self) -> np.ndarray:
        """Half extents (2,) float of the part of the patch on which the centre of pressure can be, m."""
        return np.array([self.half_size[0], LINE]) if self.rolls else self.half_size

    def borne(self, within: float) -> np.ndarray:
        """The half extents `bearing` (2,) m on ground that bears the patch up to `within` m from its middle."""
        return np.minimum(within, self.bearing)


class HipJoints(NamedTuple):
    """How the three joints of a hip follow each other.

    Attributes:
        order: The axes that they turn about, from the base down: 0 roll (x), 1 pitch (y), 2 yaw (z).
        first: Axis of the first joint, a unit vector in the axes of the base.
        skew: Cosine and sine of the angle, about the pitch axis, from the line hip to knee to the thigh's axis of roll
            or yaw, where the last joint turns about that; 1 and 0 where it is pitch.
    """

    order: tuple = (2, 0, 1)
    first: tuple = (0.0, 0.0, 1.0)
    skew: tuple = (1.0, 0.0)

    @property
    def numbers(self) -> list[float]:
        """All of it as eight numbers, for arrays of parameters."""
        return [*map(float, self.order), *self.first, *self.skew]


@dataclass(frozen=True)
class LegGeometry:
    """A leg as two links between hip centre and ankle centre, for constraints on the CoM (derived on load).

    Attributes:
        hip_in_com: Hip centre (3,) relative to the whole-body CoM in the home posture, axes of the base, m.
        ankle_in_sole: Ankle centre (3,) in the sole (contact) frame, m.
        thigh, shin: Lengths of the two links, m.
        min_length, max_length: Distances from hip to ankle that the knee allows, with a margin to the straight leg, m.
        ranges: Joint limits (lower, upper) in rad by role: hip_yaw, hip_roll, hip_pitch, knee, ankle_pitch, ankle_roll.
            Signs: roll about x, pitch about y, yaw about z of the base or sole; a flexed knee is positive. The ankle
            roll of a sole that rolls is how far its shapes let it roll.
        torques: Torque limits by the same roles, N m.
        hips: How the hip's joints follow each other.
    """

    hip_in_com: np.ndarray
    ankle_in_sole: np.ndarray
    thigh: float
    shin: float
    min_length: float
    max_length: float
    ranges: dict[str, tuple[float, float]]
    torques: dict[str, float]
    hips: HipJoints = HipJoints()

    @cached_property
    def numbers(self) -> np.ndarray:
        """(16,) for compiled functions: hip, ankle, lengths of thigh and shin, and the numbers of the `HipJoints`."""
        return np.array([*self.hip_in_com, *self.ankle_in_sole, self.thigh, self.shin, *self.hips.numbers])


class LegMass(NamedTuple):
    """How mass lies along a leg, from hip centre to ankle centre, in parts of the robot's mass; the mean of both legs.

    Attributes:
        first, second: Sums of mass times the part of the way from hip to ankle, and times that part's square.
        line: (2, 3) m; from hip to ankle of each leg in the home posture, axes of the base.
    """

    first: float
    second: float
    line: np.ndarray


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
    def bearings(self) -> np.ndarray:
        """Half extents (4, 2) float by limb within which the centre of pressure can be, m; zeros for a missing limb."""
        sizes = np.zeros((4, 2))
        for limb, model in self.limbs.items():
            sizes[limb] = model.bearing
        return sizes

    @cached_property
    def scale(self) -> Scale:
        """Factors on lengths, times and forces that are written for a body of the usual size."""
        return Scale.of(float(np.mean([leg.thigh + leg.shin for leg in self.legs.values()])), self.mass)

    @property
    def pace(self) -> float:
        """Factor on times of walking that are written for a body whose CoM is 1 m high and whose rotors are light."""
        return pendulum_pace(self.com_height) * self.rotor_factor

    @property
    def rotor_factor(self) -> float:
        """How many times as long it takes because of its rotors; 1 where they are light (`toolkit.robot.scale`)."""
        legs = self.carrying(FEET)
        return rotor_factor(self.com_height, self.armature[legs], self.torque_limit[legs])

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

    @cached_property
    def arm_sides(self) -> dict[Limb, np.ndarray]:
        """Indices (k,) int into `joint_names` of each arm's joints, with a palm or without, by the palm of its side."""
        found = dict(zip(PALMS, side_joints(self.mujoco_model, self.home), strict=True))
        sides = {palm: np.array(joints, int) - 1 for palm, joints in found.items() if joints}
        return sides | {palm: self.arm_joints(palm) for palm in PALMS if palm in self.limbs}

    @property
    def trunk_joints(self) -> np.ndarray:
        """(n,) bool; whether a joint is between the base and an arm, and of neither."""
        model, trunk = self.mujoco_model, np.zeros(len(self.joint_names), bool)
        for arm in self.arm_sides.values():
            above = set(bodies_above(model, model.jnt_bodyid[arm[0] + 1]))
            trunk |= np.isin(model.jnt_bodyid[1:], list(above))
        for arm in self.arm_sides.values():
            trunk[arm] = False
        return trunk

    def in_arms(self, model: mujoco.MjModel) -> np.ndarray:
        """(nbody,) int; palm of the side to whose arm a body belongs, -1 for none, in a model that holds the robot."""
        side = np.full(model.nbody, -1)
        for palm, joints in self.arm_sides.items():
            root = int(model.jnt_bodyid[model.joint(self.joint_names[joints[0]]).id])
            for body in range(root, model.nbody):
                if body == root or side[model.body_parentid[body]] == palm:
                    side[body] = palm
        return side

    @cached_property
    def leg_mass(self) -> LegMass:
        """How the mass of the legs lies along them."""
        model, data, moments, lines = self.mujoco_model, self._at_home, np.zeros(2), np.zeros((2, 3))
        base = data.xmat[1].reshape(3, 3)
        for foot in FEET:
            leg, site = self.legs[foot], model.site(self.limbs[foot].site).id
            hip = data.subtree_com[1] + base @ leg.hip_in_com
            line = data.site_xpos[site] + data.site_xmat[site].reshape(3, 3) @ leg.ankle_in_sole - hip
            root = int(model.jnt_bodyid[self.joints_to(foot)[0] + 1])
            for body in range(root, model.nbody):
                if root in bodies_above(model, body):
                    part = float((data.xipos[body] - hip) @ line / (line @ line))
                    moments += model.body_mass[body] * np.array([part, part * part])
            lines[foot] = line @ base
        first, second = moments / (len(FEET) * self.mass)
        return LegMass(float(first), float(second), lines)

    @cached_property
    def foot_outline(self) -> np.ndarray:
        """Half extents (2,) m of all collision shapes of a foot along the axes of its sole, around the centre of that.

        Shoes and round feet are larger than what touches level ground.
        """
        model, data, half = self.mujoco_model, self._at_home, np.zeros(2)
        rigid = model.body_weldid[model.geom_bodyid]
        collides = (model.geom_contype | model.geom_conaffinity) != 0
        for foot in FEET:
            site = model.site(self.limbs[foot].site).id
            sole = Pose(data.site_xmat[site].reshape(3, 3), data.site_xpos[site]).inverse()
            for geom in np.flatnonzero(collides & (rigid == model.body_weldid[model.site_bodyid[site]])).tolist():
                body = int(model.geom_bodyid[geom])
                points = sole @ (Pose(data.xmat[body].reshape(3, 3), data.xpos[body]) @ geom_points(model, geom))
                half = np.maximum(half, np.abs(points[:, :2]).max(0))
        return half

    @property
    def stands_on_one_foot(self) -> bool:
        """Whether either foot can bear the robot at rest; on soles that roll it balances by stepping in time alone."""
        return not any(self.limbs[foot].rolls for foot in FEET)

    @cached_property
    def leg_radii(self) -> np.ndarray:
        """(2,) m; radius of thighs and shins: half the thinner side of the thickest long geom there, 0 without one."""
        model, radius = self.mujoco_model, np.zeros((len(FEET), 2))
        for foot in FEET:
            leg, joints = self.legs[foot], self.joints_to(foot)
            for link, (joint, length) in enumerate(((joints[2], leg.thigh), (joints[3], leg.shin))):
                for geom in np.flatnonzero(model.geom_bodyid == model.jnt_bodyid[joint + 1]).tolist():
                    half = np.sort(model.geom_aabb[geom, 3:])
                    if (model.geom_contype[geom] or model.geom_conaffinity[geom]) and half[2] > 0.25 * length:
                        radius[foot, link] = max(radius[foot, link], float(half[0]))
        return radius.min(axis=0)

    @cached_property
    def passing_gap(self) -> float:
        """Gap in m between the soles at which the legs pass each other (`toolkit.robot.legroom.passing_gap`)."""
        from toolkit.robot.legroom import passing_gap  # here, since it needs a robot

        return passing_gap(self)

    def foot_room(self, margin: float) -> np.ndarray:
        """Half extents (2,) m of the place of a foot: its sole with a margin in m, and all of it that is wider."""
        return np.maximum(self.half_sizes[list(FEET)].max(0) + margin, self.foot_outline + self.scale.length * _CLEAR)

    @cached_property
    def stance_width(self) -> float:
        """Distance in m across between the soles in the home posture."""
        left, right = (self._at_home.site(self.limbs[foot].site).xpos[1] for foot in FEET)
        return float(left - right)

    @cached_property
    def turning_torque(self) -> float:
        """N m; what the trunk's motors can turn about the lateral axis, or the shoulders' where the trunk has none."""
        data, lateral = self._at_home, self._at_home.xmat[1].reshape(3, 3)[:, 1]
        share = np.abs(data.xaxis[1:] @ lateral)  # joint 0 is the free one
        trunk = np.flatnonzero(self.trunk_joints & (share > _LATERAL))
        if len(trunk):
            return float((self.torque_limit[trunk] / share[trunk]).min())
        shoulders = [joints[:_SHOULDER] for joints in self.arm_sides.values()]
        return float(sum((self.torque_limit[joints] * share[joints]).max() for joints in shoulders))

    @cached_property
    def _at_home(self) -> mujoco.MjData:
        data = mujoco.MjData(self.mujoco_model)
        data.qpos[:] = self.home
        mujoco.mj_kinematics(self.mujoco_model, data)
        mujoco.mj_comPos(self.mujoco_model, data)
        return data
