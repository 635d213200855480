"""Freeze joints of a model at given positions."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.pose import Pose
from toolkit.robot.skeleton import skeleton


def lock_joints(spec: mujoco.MjSpec, positions: Mapping[str, float]) -> None:
    """Remove joints from a spec that compiles, and leave their bodies at the given positions in rad (m for a slide).

    A body with joints J1 … Jk has the pose `M J1 … Jk`. The motion L of a frozen joint Ji is moved to the front,
    `M J1 … Ji-1 L … = M L (L⁻¹ J1 L) … (L⁻¹ Ji-1 L) …`. So M becomes M L, and earlier joints are expressed relative
    to L.

    Raises:
        RobotError: An earlier joint that must be re-expressed is in a `<frame>`.
    """
    if not positions:
        return
    model = skeleton(spec).compile()
    for name in positions:
        for actuator in list(spec.actuators):
            if actuator.target == name and actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT:
                spec.delete(actuator)
    for body_id in range(1, model.nbody):
        first, count = model.body_jntadr[body_id], model.body_jntnum[body_id]
        ids = range(first, first + count)
        if not any(model.joint(j).name in positions for j in ids):
            continue
        motion_of_body = Pose.identity()
        anchors, axes = model.jnt_pos[ids].copy(), model.jnt_axis[ids].copy()
        for order, j in enumerate(ids):
            name = model.joint(j).name
            if name not in positions:
                continue
            angle = positions[name] - model.qpos0[model.jnt_qposadr[j]]
            motion = _motion(model.jnt_type[j], anchors[order], axes[order], angle)
            motion_of_body = motion_of_body @ motion
            back = motion.inverse()
            anchors[:order], axes[:order] = back @ anchors[:order], axes[:order] @ back.rotation.T
        _move(spec, spec.body(model.body(body_id).name), motion_of_body)
        for order, j in enumerate(ids):
            joint = spec.joint(model.joint(j).name)
            if joint.name in positions:
                spec.delete(joint)
            elif order < max(i for i, k in enumerate(ids) if model.joint(k).name in positions):
                if joint.frame is not None:
                    raise RobotError(
                        f"joint '{joint.name}' stands in a <frame>: remove the frame to lock its neighbour"
                    )
                joint.pos, joint.axis = anchors[order], axes[order]


def _move(spec: mujoco.MjSpec, body: mujoco.MjsBody, motion: Pose) -> None:
    """Compose a body's pose (in its parent or its `<frame>`) with a motion given in the body's own frame."""
    quaternion = body.quat
    if body.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
        compiler = spec.compiler
        quaternion = spec.resolve_orientation(degree=compiler.degree, sequence=compiler.eulerseq, orientation=body.alt)
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    pose = Pose.from_quaternion(body.pos, quaternion) @ motion
    body.pos, body.quat = pose.position, pose.quaternion_wxyz


def _motion(kind: int, anchor: np.ndarray, axis: np.ndarray, amount: float) -> Pose:
    if kind == mujoco.mjtJoint.mjJNT_SLIDE:
        return Pose(np.eye(3), axis * amount)
    quaternion = np.concatenate([[np.cos(amount / 2)], np.sin(amount / 2) * axis])
    rotation = Pose.from_quaternion(np.zeros(3), quaternion).rotation
    return Pose(rotation, anchor - rotation @ anchor)
