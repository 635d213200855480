"""URDF text from a compiled MuJoCo model, without geometry, for Pinocchio and placo."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.pose import Pose

_UNLIMITED = 1e3  # rad; `continuous` would make Pinocchio use cos and sin, and nq + 1


def urdf_from_model(model: mujoco.MjModel, name: str = "robot") -> str:
    """URDF text, with exact numbers, of a robot compiled alone; it has the same kinematics and inertia.

    Every body and site becomes a link of the same name. A body with several joints gets massless links between them.
    The pose `M` of the body in its parent becomes `M T(anchor - previous anchor) Rot(axis, -ref)` at each joint.
    URDF cannot describe the armature; `toolkit.robot.placo` sets it on the Pinocchio model.

    Args:
        model: One root body with a free joint, and hinges and slides below it; bodies and joints have names.
        name: Name of the robot.

    Raises:
        RobotError: There is a ball joint, a second free joint, or two frames with the same name.
    """
    names = [model.joint(j).name for j in range(1, model.njnt)]
    names += [model.body(b).name for b in range(1, model.nbody)] + [model.site(s).name for s in range(model.nsite)]
    twice = sorted({item for item in names if names.count(item) > 1})
    if twice:
        raise RobotError(f"robot '{name}': '{twice[0]}' names several joints, bodies or sites; give each its own name")
    lines = [f'<robot name="{name}">']
    for body in range(1, model.nbody):
        lines.append(_link(model, body))
        parent = model.body(model.body_parentid[body]).name
        if parent != "world":
            lines += _joints(model, body, parent)
    for site in range(model.nsite):
        label, parent = model.site(site).name, model.body(model.site_bodyid[site]).name
        if parent != "world":
            pose = Pose.from_quaternion(model.site_pos[site], model.site_quat[site])
            lines.append(f'<link name="{label}"/>')
            lines.append(_joint(f"{label}__fixed", "fixed", parent, label, pose))
    return "\n".join([*lines, "</robot>", ""])


def _joints(model: mujoco.MjModel, body: int, parent: str) -> list[str]:
    label = model.body(body).name
    pose, anchor, lines = Pose.from_quaternion(model.body_pos[body], model.body_quat[body]), np.zeros(3), []
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    if count == 0:
        return [_joint(f"{label}__fixed", "fixed", parent, label, pose)]
    closing = model.jnt_pos[first + count - 1]
    for j in range(first, first + count):
        kind = int(model.jnt_type[j])
        if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            raise RobotError(f"joint '{model.joint(j).name}' on body '{label}' is neither a hinge nor a slide")
        axis, reference = model.jnt_axis[j], model.qpos0[model.jnt_qposadr[j]]
        pose = pose @ _displacement(kind, model.jnt_pos[j] - anchor, axis, -reference)
        anchor = model.jnt_pos[j]
        last = j == first + count - 1
        child = label if last and not closing.any() else f"{label}__{j - first}"
        if child != label:
            lines.append(f'<link name="{child}"/>')
        lower, upper = model.jnt_range[j] if model.jnt_limited[j] else (-_UNLIMITED, _UNLIMITED)
        limit = f'<limit lower="{float(lower)!r}" upper="{float(upper)!r}" effort="1e6" velocity="1e6"/>'
        word = "revolute" if kind == mujoco.mjtJoint.mjJNT_HINGE else "prismatic"
        extra = f'<axis xyz="{_text(axis)}"/>{limit}'
        lines.append(_joint(model.joint(j).name, word, parent, child, pose, extra))
        parent, pose = child, Pose.identity()
    if closing.any():
        lines.append(_joint(f"{label}__fixed", "fixed", parent, label, Pose(np.eye(3), -closing)))
    return lines


def _displacement(kind: int, translation: np.ndarray, axis: np.ndarray, amount: float) -> Pose:
    if kind == mujoco.mjtJoint.mjJNT_SLIDE:
        return Pose(np.eye(3), translation + amount * axis)
    quaternion = np.concatenate([[np.cos(amount / 2)], np.sin(amount / 2) * axis])
    return Pose.from_quaternion(translation, quaternion)


def _link(model: mujoco.MjModel, body: int) -> str:
    rotation = Pose.from_quaternion(np.zeros(3), model.body_iquat[body]).rotation
    inertia = rotation @ np.diag(model.body_inertia[body]) @ rotation.T
    pairs = (("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2))
    terms = " ".join(f'{key}="{float(inertia[i, j])!r}"' for key, i, j in pairs)
    return (
        f'<link name="{model.body(body).name}"><inertial><origin xyz="{_text(model.body_ipos[body])}" rpy="0 0 0"/>'
        f'<mass value="{float(model.body_mass[body])!r}"/><inertia {terms}/></inertial></link>'
    )


def _joint(name: str, kind: str, parent: str, child: str, pose: Pose, extra: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_text(pose.position)}" rpy="{_text(_roll_pitch_yaw(pose.rotation))}"/>{extra}</joint>'
    )


def _roll_pitch_yaw(rotation: np.ndarray) -> np.ndarray:
    """Angles with R = Rz(yaw) Ry(pitch) Rx(roll); the pitch uses atan2, because asin loses half the digits near 90°."""
    r = rotation
    cosine = np.hypot(r[0, 0], r[1, 0])
    pitch = np.arctan2(-r[2, 0], cosine)
    if cosine > 1e-9:
        return np.array([np.arctan2(r[2, 1], r[2, 2]), pitch, np.arctan2(r[1, 0], r[0, 0])])
    return np.array([0.0, pitch, np.arctan2(-r[0, 1], r[1, 1])])


def _text(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
