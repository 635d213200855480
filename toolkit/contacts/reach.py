"""What a two-link leg can reach: joint angles of a leg from the CoM, the base's heading and the sole, in closed form.

The base stands upright at the heading `yaw` and its CoM where the home posture has it; the hip is a ball joint of yaw,
roll and pitch, the ankle one of pitch and roll (the usual humanoid leg). With

    h = R_sole^T (c + Rz(yaw) hip_in_com - p) - ankle_in_sole        hip seen from the ankle, in the sole frame

all six joint angles follow: the ankle rolls until h lies in the plane of the leg, the cosine rule gives the knee and
the shin, and the thigh's frame seen from the base gives the hip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.pose import rotation_about_z
from toolkit.robot.model import LegGeometry


@dataclass(frozen=True)
class ReachMargins:
    """How far inside its limits a leg must stay.

    Attributes:
        length: m, off both ends of the hip-ankle distance.
        ankle: rad, off both ends of ankle pitch and roll.
        hip: rad, off both ends of hip yaw, roll and pitch; negative where the base may turn or lean to help.
    """

    length: float = 0.0
    ankle: float = 0.1
    hip: float = 0.0


@dataclass(frozen=True)
class LegPosture:
    """Joint angles of n legs in rad, signs as in `LegGeometry.ranges`, and what they follow from.

    Attributes:
        length: (n,) m; hip to ankle. Beyond what the two links can span the angles are those of the nearest triangle.
        hip_yaw, hip_roll, hip_pitch, knee, ankle_pitch, ankle_roll: (n,) rad.
        hip, knee_point, ankle: (n, 3) m in the world.
        pitch_axis: (n, 3) unit; axis of hip pitch, knee and ankle pitch in the world.
    """

    length: np.ndarray
    hip_yaw: np.ndarray
    hip_roll: np.ndarray
    hip_pitch: np.ndarray
    knee: np.ndarray
    ankle_pitch: np.ndarray
    ankle_roll: np.ndarray
    hip: np.ndarray
    knee_point: np.ndarray
    ankle: np.ndarray
    pitch_axis: np.ndarray


def leg_posture(
    leg: LegGeometry, com: np.ndarray, yaw: np.ndarray, position: np.ndarray, rotation: np.ndarray
) -> LegPosture:
    """Joint angles of legs whose soles are placed.

    Args:
        leg: geometry of the leg.
        com: (n, 3) m; CoM in the world.
        yaw: (n,) rad; heading of the base.
        position: (n, 3) m; centre of the sole in the world.
        rotation: (n, 3, 3); world_from_sole.

    Returns:
        The posture of each.
    """
    com, position, rotation = (np.asarray(value, float) for value in (com, position, rotation))
    base = rotation_about_z(yaw)
    hip = com + base @ leg.hip_in_com
    ankle = position + rotation @ leg.ankle_in_sole
    h = np.einsum("nji,nj->ni", rotation, hip - ankle)
    length = np.linalg.norm(h, axis=-1)
    roll = np.arctan2(h[:, 1], h[:, 2])
    thigh, shin = leg.thigh, leg.shin
    span = np.clip(length, abs(thigh - shin) + 1e-9, thigh + shin - 1e-9)
    at_ankle = np.arccos(np.clip((span**2 + shin**2 - thigh**2) / (2 * shin * span), -1.0, 1.0))
    knee = np.pi - np.arccos(np.clip((thigh**2 + shin**2 - span**2) / (2 * thigh * shin), -1.0, 1.0))
    lean = np.arctan2(h[:, 0], np.hypot(h[:, 1], h[:, 2])) + at_ankle  # of the shin, towards the toes
    zero = np.zeros_like(roll)
    axis = np.einsum("nij,nj->ni", rotation, np.stack([zero, np.cos(roll), -np.sin(roll)], -1))
    up = np.stack([np.sin(lean), np.sin(roll) * np.cos(lean), np.cos(roll) * np.cos(lean)], -1)
    knee_point = ankle + shin * np.einsum("nij,nj->ni", rotation, up)
    thigh_z = hip - knee_point
    thigh_z = thigh_z / np.linalg.norm(thigh_z, axis=-1, keepdims=True)
    thigh_x = np.cross(axis, thigh_z)
    x, y, z = (np.einsum("nji,nj->ni", base, vector) for vector in (thigh_x, axis, thigh_z))
    return LegPosture(
        length=length,
        hip_yaw=np.arctan2(-y[:, 0], y[:, 1]),
        hip_roll=np.arcsin(np.clip(y[:, 2], -1.0, 1.0)),
        hip_pitch=np.arctan2(-x[:, 2], z[:, 2]),
        knee=knee,
        ankle_pitch=-lean,
        ankle_roll=roll,
        hip=hip,
        knee_point=knee_point,
        ankle=ankle,
        pitch_axis=axis,
    )


def leg_clearances(
    leg: LegGeometry, posture: LegPosture, margins: ReachMargins = ReachMargins()
) -> dict[str, np.ndarray]:
    """Distance of each leg to each of its limits; negative where the limit, less its margin, is exceeded.

    Args:
        leg: geometry of the leg.
        posture: of n legs.
        margins: taken off each limit.

    Returns:
        Name of the limit -> (n,) m or rad: the smaller distance to the two ends of the range.
    """
    clearances = {
        "leg length": np.minimum(posture.length - leg.min_length, leg.max_length - posture.length) - margins.length
    }
    for role in ("hip_yaw", "hip_roll", "hip_pitch", "ankle_pitch", "ankle_roll"):
        lower, upper = leg.ranges[role]
        angle = getattr(posture, role)
        margin = margins.ankle if role.startswith("ankle") else margins.hip
        clearances[role.replace("_", " ")] = np.minimum(angle - lower, upper - angle) - margin
    return clearances
