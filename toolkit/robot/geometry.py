"""Legs as two links and arms as a reach, derived from the compiled model in its home posture."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import mujoco
import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rolled_onto
from toolkit.robot.chain import arm_joints, joints_to
from toolkit.robot.model import ArmGeometry, HipJoints, LegGeometry
from toolkit.robot.rolling import rolling_range

STRAIGHT_LEG_MARGIN = 0.015  # share of the length from hip to ankle
STRAIGHT_ARM_MARGIN = 0.05  # share of the length from shoulder to palm
_ROLES = ("roll", "pitch", "yaw")
_ALIGNED = 0.72  # least |cosine| between a joint axis in the home posture and the base axis that defines its role
_OBLIQUE = 0.6  # the same of hips, where two joints may share what roll and yaw are
_ACROSS = 0.5  # greatest |cosine| between the axes of these two and that of pitch


def leg_geometry(model: mujoco.MjModel, data: mujoco.MjData, limb: Limb) -> LegGeometry:
    """A leg between hip centre and ankle centre, from kinematics and CoM of the home posture.

    Angles are those of the two-link leg: zero is a straight leg at right angles to the level sole, even if the zeros of
    the joints differ.

    Raises:
        RobotError: The chain from base to foot is not hip (yaw, roll, pitch in any order), knee, ankle (pitch and roll
            in any order, or pitch alone).
    """
    joints = joints_to(model, int(model.site_bodyid[model.site(limb.label).id]))
    roles = _leg_roles(model, data, joints, limb)
    base = data.xmat[1].reshape(3, 3)
    site = model.site(limb.label).id
    sole, place = data.site_xmat[site].reshape(3, 3), data.site_xpos[site]
    rolls = "ankle_roll" not in roles
    hip = _axes_crossing(data, [roles[role] for role in ("hip_yaw", "hip_roll", "hip_pitch")])

    # The plane of the leg is normal to the knee axis.
    across = data.xaxis[roles["knee"]] * np.sign(data.xaxis[roles["knee"]] @ base[:, 1])
    knee = data.xanchor[roles["knee"]]
    if rolls:
        ankle = place + _across(data.xanchor[roles["ankle_pitch"]] - place, across)
    else:
        ankle = _axes_crossing(data, [roles["ankle_pitch"], roles["ankle_roll"]])
    upward_thigh, upward_shin = _across(hip - knee, across), _across(knee - ankle, across)
    thigh, shin = float(np.linalg.norm(upward_thigh)), float(np.linalg.norm(upward_shin))
    hips, skew = _hip_joints(data, roles, base, np.cross(across, upward_thigh / thigh), upward_thigh / thigh)
    angles = {
        "hip_pitch": _angle(base[:, 2], upward_thigh, across) + skew,
        "knee": _angle(upward_thigh, upward_shin, across),
        "ankle_pitch": _angle(upward_shin, sole[:, 2], across),
    }
    if rolls:
        angles |= _rolled(base, rolled_onto(sole, base[:, 2]), place, sole.T @ (ankle - place), hip)

    ranges, torques = {}, {}
    for role, joint in roles.items():
        reference = sole if role == "ankle_roll" else base
        axis = "pitch" if role == "knee" else role.partition("_")[2]
        sign = float(np.sign(data.xaxis[joint] @ reference[:, _ROLES.index(axis)]))
        value = data.qpos[model.jnt_qposadr[joint]]
        offset = angles[role] - sign * value if role in angles else 0.0
        low, high = sorted(offset + sign * limit for limit in model.jnt_range[joint])
        ranges[role] = float(low), float(high)
        torques[role] = float(model.actuator_forcerange[joint - 1, 1])  # joint 0 is the free one
    aside = 0.0
    if rolls:
        # The sole rolls with the leg's plane, which passes beside the hip.
        aside = float(across @ (hip - place))
        offset = angles["ankle_roll"] - _tilt(sole, rolled_onto(sole, base[:, 2]))
        low, high = rolling_range(model, limb)
        ranges["ankle_roll"] = low + offset, high + offset
        torques["ankle_roll"] = float(model.body_subtreemass[1] * -model.opt.gravity[2]) * (thigh + shin)
    ranges |= _shared_ranges(data, roles, ranges, base)
    flexed, straight = ranges["knee"][1], max(ranges["knee"][0], 0.0)
    if flexed < 0.1:
        raise RobotError(f"{limb.label}: the knee does not flex backwards in the home posture; bend it in [home]")
    return LegGeometry(
        hip_in_com=base.T @ (hip - data.subtree_com[1]),
        ankle_in_sole=sole.T @ (ankle - place),
        thigh=float(np.hypot(thigh, aside)),
        shin=shin,
        min_length=float(np.hypot(_length(thigh, shin, min(flexed, np.pi)), aside)),
        max_length=float(
            np.hypot(min(_length(thigh, shin, straight), (1 - STRAIGHT_LEG_MARGIN) * (thigh + shin)), aside)
        ),
        ranges=ranges,
        torques=torques,
        hips=hips,
    )


def arm_geometry(model: mujoco.MjModel, data: mujoco.MjData, limb: Limb) -> ArmGeometry:
    """An arm's reach around its shoulder by bending the elbow alone, from kinematics and CoM of the home posture.

    The shoulder is the point where the second and third axes meet; the first may be closer to the spine, as a clavicle.

    Raises:
        RobotError: There are fewer than four joints between the trunk and the palm.
    """
    site = model.site(limb.label).id
    joints = arm_joints(model, limb)
    if len(joints) < 4:
        raise RobotError(
            f"{limb.label}: {len(joints)} joints between the trunk and the palm; an arm needs four or more"
        )
    shoulder, palm = _axes_crossing(data, joints[1:3]), data.site_xpos[site]

    def distances(joint: int) -> np.ndarray:
        home = data.qpos[model.jnt_qposadr[joint]]
        axis, anchor = data.xaxis[joint], data.xanchor[joint]
        low, high = model.jnt_range[joint]
        angles = np.linspace(low, high, 200) - home
        arm = palm - anchor
        along = axis * (axis @ arm)
        turned = along + np.cos(angles)[:, None] * (arm - along) + np.sin(angles)[:, None] * np.cross(axis, arm)
        return np.linalg.norm(anchor + turned - shoulder, axis=1)

    reach = max((distances(joint) for joint in joints[3:]), key=np.ptp)
    base = data.xmat[1].reshape(3, 3)
    return ArmGeometry(
        shoulder_in_com=base.T @ (shoulder - data.subtree_com[1]),
        min_reach=float(reach.min()),
        max_reach=float((1 - STRAIGHT_ARM_MARGIN) * reach.max()),
    )


def derive_limbs(
    model: mujoco.MjModel, home: np.ndarray, limbs: Mapping[Limb, object]
) -> tuple[dict[Limb, LegGeometry], dict[Limb, ArmGeometry]]:
    """Legs by foot and arms by palm of a robot compiled alone, in the home posture qpos (7 + n,).

    Raises:
        RobotError: The joints of a limb are not those of a leg or an arm.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = home
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    legs = {limb: leg_geometry(model, data, limb) for limb in limbs if limb in FEET}
    arms = {limb: arm_geometry(model, data, limb) for limb in limbs if limb not in FEET}
    return legs, arms


def _shared_ranges(
    data: mujoco.MjData, roles: Mapping[str, int], ranges: Mapping[str, tuple[float, float]], base: np.ndarray
) -> dict[str, tuple[float, float]]:
    """Ranges of hip angles about the base's axes where oblique joints share them; nothing where none is oblique.

    The ranges of the joints nearest to the axes are shrunk by one factor, until every rotation within them is in reach
    of the joints: to the first order, angles theta about the base's axes need the joint angles A^-1 theta, with the
    joints' axes as columns of A.
    """
    hips = [f"hip_{role}" for role in _ROLES]
    axes = base.T @ data.xaxis[[roles[role] for role in hips]].T
    axes = axes * np.sign(np.diag(axes))
    oblique = np.flatnonzero(np.diag(axes) < _ALIGNED)
    if not len(oblique):
        return {}
    low, high = np.array([ranges[role] for role in hips]).T
    needed = np.linalg.inv(axes)
    most = np.maximum(needed * low, needed * high).sum(1)
    least = np.minimum(needed * low, needed * high).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.fmin(high / most, low / least)[oblique]
    share = float(np.clip(np.fmin(shares.min(), 1.0), 0.0, 1.0))
    return {hips[k]: (share * float(low[k]), share * float(high[k])) for k in oblique}


def _hip_joints(
    data: mujoco.MjData, roles: Mapping[str, int], base: np.ndarray, ahead: np.ndarray, up: np.ndarray
) -> tuple[HipJoints, float]:
    """How a hip's joints follow each other, and the skew in rad of the thigh's axes.

    The thigh's line goes `up` from knee to hip, and `ahead` is normal to it and to the axis of the knee.
    """
    order = sorted(range(3), key=lambda axis: roles[f"hip_{_ROLES[axis]}"])
    axes = data.xaxis[[roles[f"hip_{_ROLES[axis]}"] for axis in order]]
    axes = axes * np.sign(np.sum(axes.T * base[:, order], 0))[:, None]
    x, z = axes[2] @ ahead, axes[2] @ up
    skew = {"roll": np.arctan2(-z, x), "pitch": 0.0, "yaw": np.arctan2(x, z)}[_ROLES[order[2]]]
    hips = HipJoints(tuple(order), tuple((base.T @ axes[0]).tolist()), (float(np.cos(skew)), float(np.sin(skew))))
    return hips, float(skew)


def _leg_roles(model: mujoco.MjModel, data: mujoco.MjData, joints: list[int], limb: Limb) -> dict[str, int]:
    base = data.xmat[1].reshape(3, 3)
    names = [model.joint(joint).name for joint in joints]
    cosines = np.abs(data.xaxis[joints] @ base)
    found = [_ROLES[k] if row[k] >= _ALIGNED else "oblique" for row, k in zip(cosines, cosines.argmax(1), strict=True)]
    slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
    found[:3] = _hip_roles(cosines[:3]) or found[:3]
    found = ["slide" if slide else role for slide, role in zip(slides, found, strict=True)]
    if (
        sorted(found[:3]) != sorted(_ROLES)
        or found[3:4] != ["pitch"]
        or sorted(found[4:]) not in (["pitch", "roll"], ["pitch"])
    ):
        listed = ", ".join(f"{name} ({role})" for name, role in zip(names, found, strict=True)) or "none"
        raise RobotError(
            f"{limb.label}: the leg must be hip yaw, roll and pitch in any order, knee pitch, ankle pitch and roll in "
            f"any order or ankle pitch alone; found from the base down: {listed}; lock other joints or correct [home]"
        )
    roles = {f"hip_{role}": joint for role, joint in zip(found[:3], joints[:3], strict=True)}
    roles["knee"] = joints[3]
    roles |= {f"ankle_{role}": joint for role, joint in zip(found[4:], joints[4:], strict=True)}
    order = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
    return {role: roles[role] for role in order if role in roles}


def _rolled(
    base: np.ndarray, sole: np.ndarray, place: np.ndarray, ankle_in_sole: np.ndarray, hip: np.ndarray
) -> dict[str, float]:
    """Roll and yaw angles that a two-link leg between a hip and a level sole has, by role, in rad.

    They differ from those of a leg whose sole rolls with it, because its plane passes beside the hip, and because the
    line on which it stands may be oblique to it.
    """
    towards = sole.T @ (hip - place) - ankle_in_sole
    roll = float(np.arctan2(towards[1], towards[2]))
    axis = base.T @ sole @ [0.0, np.cos(roll), -np.sin(roll)]
    return {
        "ankle_roll": roll,
        "hip_roll": float(np.arcsin(axis[2])),
        "hip_yaw": float(np.arctan2(-axis[0], axis[1])),
    }


def _tilt(sole: np.ndarray, level: np.ndarray) -> float:
    """Angle in rad by which a rolling sole leans to the left of its level frame."""
    return float(np.arctan2(sole[:, 2] @ level[:, 1], sole[:, 2] @ level[:, 2]))


def _hip_roles(cosines: np.ndarray) -> list[str]:
    """Roles of three hip joints by |cosines| (3, 3) between their axes and the base's; empty where they do not fit.

    Two joints between roll and yaw are both as near to either. The upper one is then taken for the yaw.
    """
    if len(cosines) < 3:
        return []
    orders = sorted(itertools.permutations(range(3)), key=lambda order: -order[0])
    fits = [round(float(np.prod(cosines[[0, 1, 2], order])), 2) for order in orders]
    order = list(orders[int(np.argmax(fits))])
    pitch = _ROLES.index("pitch")
    across = max(cosines[joint, pitch] for joint in range(3) if order[joint] != pitch)
    fit = cosines[[0, 1, 2], order].min() >= _OBLIQUE and across <= _ACROSS
    return [_ROLES[k] for k in order] if fit else []


def _axes_crossing(data: mujoco.MjData, joints: list[int]) -> np.ndarray:
    """Point (3,) of the world nearest to the axes of joints: the least-squares solution of P_i (x - a_i) = 0."""
    axes, anchors = data.xaxis[joints], data.xanchor[joints]
    projections = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    # If the axes are parallel, the solution nearest to the mean anchor is used.
    middle = anchors.mean(0)
    pull = np.einsum("nij,nj->i", projections, anchors - middle)
    return middle + np.linalg.lstsq(projections.sum(0), pull, rcond=1e-9)[0]


def _across(vector: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return vector - axis * (axis @ vector)


def _angle(start: np.ndarray, end: np.ndarray, axis: np.ndarray) -> float:
    """Angle in rad about a unit axis from one vector to the other, both projected along the axis."""
    start, end = _across(start, axis), _across(end, axis)
    return float(np.arctan2(axis @ np.cross(start, end), start @ end))


def _length(thigh: float, shin: float, flexion: float) -> float:
    return float(np.sqrt(thigh**2 + shin**2 + 2 * thigh * shin * np.cos(flexion)))
