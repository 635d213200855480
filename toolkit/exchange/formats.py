"""The formats that a motion can be written in, by name."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.exchange.columns import csv_text, motion_columns, table_text
from toolkit.exchange.frames import MotionFrames
from toolkit.robot.model import RobotModel


@dataclass(frozen=True)
class Format:
    """A format.

    Attributes:
        about: One line that says whose it is.
        fps: Frames per second that its readers expect.
        files: What makes the content of each file with the motion, by the file's name; empty where the contacts alone
            are wanted.
        layout: Plain sentences on frames, units and orders, for those who read it without the toolkit.
    """

    about: str
    fps: float
    files: Mapping[str, Callable[[MotionFrames, RobotModel], bytes]]
    layout: str


def _mjlab(frames: MotionFrames, robot: RobotModel) -> bytes:
    """A reference motion as mjlab's motion loader reads it."""
    return _npz(
        fps=np.array([frames.fps]),
        joint_pos=frames.qpos[:, 7:],
        joint_vel=frames.qvel[:, 6:],
        body_pos_w=frames.body_position,
        body_quat_w=frames.body_quaternion_wxyz,
        body_lin_vel_w=frames.body_velocity,
        body_ang_vel_w=frames.body_spin,
    )


def _unitree(frames: MotionFrames, robot: RobotModel) -> bytes:
    """Rows of root position, root quaternion xyzw and joints, without a header."""
    root, joints = frames.qpos[:, :7], frames.qpos[:, 7:]
    return table_text(np.hstack([root[:, [0, 1, 2, 4, 5, 6, 3]], joints])).encode()


def _npz(**arrays: np.ndarray) -> bytes:
    """An npz file."""
    content = io.BytesIO()
    np.savez(content, **arrays)  # type: ignore[arg-type]
    return content.getvalue()


def _columns_npz(frames: MotionFrames, robot: RobotModel) -> bytes:
    """An array for each column."""
    return _npz(**motion_columns(frames, robot))


def _columns_csv(frames: MotionFrames, robot: RobotModel) -> bytes:
    """A table with a header."""
    return csv_text(motion_columns(frames, robot)).encode()


_NAMED = (
    "One entry for each column: time (s); root_pos_{x,y,z} (m) and root_quat_{w,x,y,z}; root_lin_vel_* (m/s) and "
    "root_ang_vel_* (rad/s), both in the world; pos_JOINT (rad), vel_JOINT (rad/s), torque_JOINT (N m), target_JOINT "
    "(rad); com_* (m), linear_momentum_* (kg m/s), angular_momentum_* (kg m^2/s, about the CoM); and for each limb "
    "LIMB_pos_* (m), LIMB_quat_*, LIMB_force_* (N), LIMB_moment_* (N m, about the patch's centre), LIMB_contact and "
    "LIMB_planned_contact."
)
FORMATS = {
    "mjlab": Format(
        "a reference motion for mjlab's motion tracking",
        50.0,
        {"motion.npz": _mjlab},
        "fps (1,); joint_pos, joint_vel (T, joints) in rad and rad/s; body_pos_w (T, bodies, 3) in m; body_quat_w "
        "(T, bodies, 4), scalar first; body_lin_vel_w in m/s, of the origin of the body's frame, and body_ang_vel_w in "
        "rad/s, both (T, bodies, 3) in the world. Orders are joint_names and body_names of metadata.json, MuJoCo's of "
        "robot.xml.",
    ),
    "unitree-csv": Format(
        "rows as in Unitree's retargeted LAFAN1 motions",
        30.0,
        {"motion.csv": _unitree},
        "No header. Each row: root position x, y, z (m), root quaternion x, y, z, w, then the joints (rad) in the "
        "order of joint_names of metadata.json. The root is the first of body_names.",
    ),
    "npz": Format("NumPy arrays with named columns", 50.0, {"trajectory.npz": _columns_npz}, _NAMED),
    "csv": Format("a table with named columns", 50.0, {"trajectory.csv": _columns_csv}, _NAMED),
    "contacts": Format(
        "the contact sequence for optimisers that take it as given",
        50.0,
        {},
        "The motion is left out; contacts.json is what counts.",
    ),
}
