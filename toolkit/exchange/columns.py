"""Motions as tables with a name for every column."""

from __future__ import annotations

import io

import numpy as np

from toolkit.exchange.frames import MotionFrames
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel

_AXES, _QUATERNION = ("x", "y", "z"), ("w", "x", "y", "z")


def motion_columns(frames: MotionFrames, robot: RobotModel) -> dict[str, np.ndarray]:
    """The whole motion: columns (T,) by name.

    `time`; `root_pos_x`, ... and `root_quat_w`, ...; `root_lin_vel_x`, ... and `root_ang_vel_x`, ..., in the world;
    `pos_`, `vel_`, `torque_` and `target_` before each joint's name; `com_x`, `linear_momentum_x`,
    `angular_momentum_x`, ...; for each limb that the robot has, such as `left_foot`: `left_foot_pos_x`, ...,
    `left_foot_quat_w`, ..., `left_foot_force_x`, ..., `left_foot_moment_x`, ..., `left_foot_contact` and
    `left_foot_planned_contact` (0 or 1).
    """
    columns = {"time": frames.times}
    columns |= _named("root_pos", frames.qpos[:, :3]) | _named("root_quat", frames.qpos[:, 3:7], _QUATERNION)
    columns |= _named("root_lin_vel", frames.qvel[:, :3]) | _named("root_ang_vel", frames.body_spin[:, 0])
    columns |= _joints("pos", frames.qpos[:, 7:], robot) | _joints("vel", frames.qvel[:, 6:], robot)
    columns |= _drives(frames, robot)
    columns |= _named("com", frames.com) | _named("linear_momentum", frames.linear_momentum)
    columns |= _named("angular_momentum", frames.angular_momentum)
    for limb in sorted(robot.limbs):
        columns |= _named(f"{limb.label}_pos", frames.limb_pose[:, limb, :3])
        columns |= _named(f"{limb.label}_quat", frames.limb_pose[:, limb, 3:], _QUATERNION)
        columns |= _named(f"{limb.label}_force", frames.force[:, limb])
        columns |= _named(f"{limb.label}_moment", frames.moment[:, limb])
        columns |= _labels(frames, limb)
    return columns


def label_columns(frames: MotionFrames, robot: RobotModel) -> dict[str, np.ndarray]:
    """What a tracker needs beside a motion: `time`, contact labels, torques, joint targets; see `motion_columns`."""
    columns = {"time": frames.times}
    for limb in sorted(robot.limbs):
        columns |= _labels(frames, limb)
    return columns | _drives(frames, robot)


def csv_text(columns: dict[str, np.ndarray]) -> str:
    """A table as CSV with a header; numbers have nine decimals, and truth values are 0 and 1."""
    style = ["%d" if values.dtype == bool else "%.9f" for values in columns.values()]
    table = np.column_stack([values.astype(float) for values in columns.values()])
    return table_text(table, style, ",".join(columns))


def table_text(table: np.ndarray, style: str | list[str] = "%.9f", header: str = "") -> str:
    """A table (T, k) as CSV."""
    text = io.StringIO()
    np.savetxt(text, table, style, delimiter=",", header=header, comments="")
    return text.getvalue()


def _named(name: str, values: np.ndarray, axes: tuple[str, ...] = _AXES) -> dict[str, np.ndarray]:
    """Columns of a vector (T, k) by axis."""
    return {f"{name}_{axis}": values[:, index] for index, axis in enumerate(axes)}


def _joints(name: str, values: np.ndarray, robot: RobotModel) -> dict[str, np.ndarray]:
    """Columns of a quantity (T, n) by joint."""
    return {f"{name}_{joint}": values[:, index] for index, joint in enumerate(robot.joint_names)}


def _drives(frames: MotionFrames, robot: RobotModel) -> dict[str, np.ndarray]:
    """Torques and joint targets."""
    return _joints("torque", frames.torque, robot) | _joints("target", frames.target, robot)


def _labels(frames: MotionFrames, limb: Limb) -> dict[str, np.ndarray]:
    """Contact labels of a limb."""
    return {
        f"{limb.label}_contact": frames.contact[:, limb],
        f"{limb.label}_planned_contact": frames.planned_contact[:, limb],
    }
