"""Checks of a whole-body motion that share no code with the inverse kinematics: MuJoCo recomputes everything."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.failure import Failure
from toolkit.robot.model import LimbModel, RobotModel
from toolkit.wholebody.collision import first_collision
from toolkit.wholebody.limb_paths import LimbPaths
from toolkit.wholebody.motion_dynamics import inverse_dynamics, velocities

# Largest deviation of a whole-body motion from its plan, for a body of the usual size (`toolkit.robot.scale`).
COM_ERROR = 0.02  # m; of the CoM
FOOT_ERROR, PALM_ERROR = 0.005, 0.01  # m; of a patch in contact
SWING_ERROR = 0.02  # m; of a foot in the air
ORIENTATION_ERROR = 0.03  # rad; of a sole, or of a palm's normal
RANGE_TOLERANCE = 1e-3  # rad; beyond a joint's range: rounding of the solver
# Allowed share of the torque limit for a head or a free arm: the controller keeps their torque within the limit, and
# they may follow late. Legs, trunk and what bears a contact may not.
FREE_TORQUE_RATIO = 2.0


@dataclass(frozen=True)
class CheckReport:
    """Result of the checks.

    Attributes:
        max_position_error: m; over CoM and contacts.
        max_orientation_error: rad; over contacts.
        torque: (T, n) N m.
        limits_respected: Whether joint ranges, velocities and torques are within their limits.
        findings: One per violated check, empty where all hold.
    """

    max_position_error: float
    max_orientation_error: float
    torque: np.ndarray
    limits_respected: bool
    findings: tuple[Failure, ...]


def check(
    robot: RobotModel,
    scene: mujoco.MjModel,
    paths: LimbPaths,
    motion: CentroidalMotion,
    times: np.ndarray,
    qpos: np.ndarray,
) -> CheckReport:
    """Check a motion (T, 7 + n) at uniform times (T,) in s.

    It is compared with the planned poses of the limbs and the planned CoM, and must collide nowhere in `scene`, the
    robot and the world in one model. Torques result from the planned wrenches.
    """
    position, orientation, tracking = _tracking(robot, paths, motion, times, qpos)
    torque = inverse_dynamics(robot, motion, times, qpos)[:, 6:]
    bearing = robot.carrying(limb for limb in robot.limbs if motion.problem.active[:, limb].any()) | robot.trunk_joints
    limits = _limits(robot, times, qpos, torque, bearing)
    hit = first_collision(robot, scene, times, qpos)
    findings = tracking + limits + ([hit] if hit else [])
    return CheckReport(position, orientation, torque, not limits, tuple(findings))


def _tracking(
    robot: RobotModel, paths: LimbPaths, motion: CentroidalMotion, times: np.ndarray, qpos: np.ndarray
) -> tuple[float, float, list[Failure]]:
    """Largest position (m) and orientation (rad) error over CoM and contacts, and the violated checks."""
    model = robot.mujoco_model
    data = mujoco.MjData(model)
    worst: dict[tuple[str, str], tuple[float, float, float]] = {}  # (thing, unit): error, limit, time

    def note(thing: str, unit: str, error: float, limit: float, time: float) -> float:
        error = float(error) if np.isfinite(error) else np.inf
        if error > worst.get((thing, unit), (-1.0,))[0]:
            worst[thing, unit] = (error, limit, time)
        return error

    position, orientation, scale = 0.0, 0.0, robot.scale.length
    for time, state in zip(times, qpos, strict=True):
        data.qpos[:] = state
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error = float(np.linalg.norm(data.subtree_com[0] - motion.sample(time)[0]))
        position = max(position, note("the CoM", "m", error, scale * COM_ERROR, time))
        for limb, item in robot.limbs.items():
            sample = paths.sample(limb, time)
            if sample.pose is None or not (limb.is_foot or sample.in_contact):
                continue
            site = data.site(item.site)
            error = float(np.linalg.norm(site.xpos - sample.pose.position))
            if not sample.in_contact:
                note(f"{limb.label} in the air", "m", error, scale * SWING_ERROR, time)
                continue
            turn = _angle(item, site.xmat.reshape(3, 3), sample.pose.rotation)
            limit = scale * (FOOT_ERROR if limb.is_foot else PALM_ERROR)
            position = max(position, note(limb.label, "m", error, limit, time))
            orientation = max(orientation, note(limb.label, "rad", turn, ORIENTATION_ERROR, time))
    findings = [
        Failure(f"{thing} is {error:.3g} {unit} off its plan at {time:.2f} s (limit {limit:.3g} {unit})", float(time))
        for (thing, unit), (error, limit, time) in worst.items()
        if error > limit
    ]
    return position, orientation, findings


def _angle(item: LimbModel, actual: np.ndarray, planned: np.ndarray) -> float:
    """Angle in rad between two orientations.

    For palms, whose twist is free, it is that between their normals, and for soles that roll between their x axes.
    """
    if item.rolls or not item.limb.is_foot:
        axis, wanted = (turn[:, 0 if item.rolls else 2] for turn in (actual, planned))
        return float(np.arctan2(np.linalg.norm(np.cross(axis, wanted)), axis @ wanted))
    # |R - I|_F = 2 sqrt(2) sin(angle / 2): accurate for small angles, unlike the trace.
    return float(2.0 * np.arcsin(min(np.linalg.norm(actual - planned) / (2.0 * np.sqrt(2.0)), 1.0)))


def _limits(
    robot: RobotModel, times: np.ndarray, qpos: np.ndarray, torque: np.ndarray, bearing: np.ndarray
) -> list[Failure]:
    """The violated limits of range, velocity and torque; `bearing` (n,) bool: joints with contacts or arms on them."""
    findings = []
    joints = qpos[:, 7:]
    beyond = np.maximum(robot.lower - joints, joints - robot.upper)
    row, column = _worst(beyond)
    if not beyond[row, column] <= RANGE_TOLERANCE:
        text = (
            f"joint {robot.joint_names[column]} is at {joints[row, column]:.3f} rad at {times[row]:.2f} s "
            f"(range {robot.lower[column]:.3f} to {robot.upper[column]:.3f} rad)"
        )
        findings.append(Failure(text, float(times[row])))
    torque_ratio = np.where(bearing, 1.0, FREE_TORQUE_RATIO)
    speed = velocities(robot.mujoco_model, times, qpos)[:, 6:]
    for values, limit, allowed, what, unit in (
        (speed, robot.velocity_limit, np.ones(len(bearing)), "turns at", "rad/s"),
        (torque, robot.torque_limit, torque_ratio, "needs", "N m"),
    ):
        row, column = _worst(np.abs(values) / (allowed * limit))
        if not abs(values[row, column]) <= allowed[column] * limit[column]:
            text = (
                f"joint {robot.joint_names[column]} {what} {values[row, column]:.3g} {unit} at {times[row]:.2f} s "
                f"(limit {allowed[column] * limit[column]:.3g} {unit})"
            )
            findings.append(Failure(text, float(times[row]), too_fast=True))
    return findings


def _worst(values: np.ndarray) -> tuple[int, int]:
    """Row and column of the largest entry, where NaN counts as infinite."""
    row, column = np.unravel_index(np.argmax(np.where(np.isnan(values), np.inf, values)), values.shape)
    return int(row), int(column)
