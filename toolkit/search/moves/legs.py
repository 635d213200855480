"""Compiled leg checks: the closed form of `toolkit.contacts.reach`, one leg at a time, for thousands of candidates.

The tests hold it against `leg_clearances`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.contacts.reach import ReachMargins
from toolkit.geometry.limb import FEET
from toolkit.robot.model import RobotModel

LIMITS = ("leg length", "ankle roll", "ankle pitch", "hip yaw", "hip roll", "hip pitch")
_ROLES = ("ankle_roll", "ankle_pitch", "hip_yaw", "hip_roll", "hip_pitch")


class Legs(NamedTuple):
    """Both legs as arrays, margins taken off.

    Attributes:
        hip: (2, 3) m; in the CoM's frame with the heading of the base.
        ankle: (2, 3) m; in the sole's frame.
        links: (2, 2) m; thigh and shin.
        length: (2, 2) m; shortest and longest.
        ranges: (2, 5, 2) rad; in the order of `LIMITS` after the length.
    """

    hip: np.ndarray
    ankle: np.ndarray
    links: np.ndarray
    length: np.ndarray
    ranges: np.ndarray


def legs_of(robot: RobotModel, margins: ReachMargins) -> Legs:
    """Arrays of a robot's legs, `margins` inside their limits."""
    legs = [robot.legs[limb] for limb in FEET]
    inward = np.array([1.0, -1.0])
    return Legs(
        hip=np.array([leg.hip_in_com for leg in legs]),
        ankle=np.array([leg.ankle_in_sole for leg in legs]),
        links=np.array([[leg.thigh, leg.shin] for leg in legs]),
        length=np.array([[leg.min_length, leg.max_length] for leg in legs]) + margins.length * inward,
        ranges=np.array(
            [
                [
                    np.array(leg.ranges[role]) + (margins.ankle if role.startswith("ankle") else margins.hip) * inward
                    for role in _ROLES
                ]
                for leg in legs
            ]
        ),
    )


@compiled(kept=True)
def _outside(ranges, k, angle):
    return angle < ranges[k, 0] or angle > ranges[k, 1]


@compiled(kept=True)
def violated(legs, side, cx, cy, cz, yaw, position, rotation):
    """Index in `LIMITS` of the first limit that a leg breaks, -1 where it reaches.

    Args:
        legs: both legs.
        side: 0 left, 1 right.
        cx: m; CoM, world.
        cy: m.
        cz: m.
        yaw: rad; heading of the base.
        position: (3,) m; centre of the sole.
        rotation: (3, 3); world_from_sole.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    hip, tip, r = legs.hip[side], legs.ankle[side], rotation
    hx, hy, hz = cx + c * hip[0] - s * hip[1], cy + s * hip[0] + c * hip[1], cz + hip[2]
    ax = position[0] + r[0, 0] * tip[0] + r[0, 1] * tip[1] + r[0, 2] * tip[2]
    ay = position[1] + r[1, 0] * tip[0] + r[1, 1] * tip[1] + r[1, 2] * tip[2]
    az = position[2] + r[2, 0] * tip[0] + r[2, 1] * tip[1] + r[2, 2] * tip[2]
    dx, dy, dz = hx - ax, hy - ay, hz - az
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if length < legs.length[side, 0] or length > legs.length[side, 1]:
        return 0
    ranges = legs.ranges[side]
    u = r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz
    v = r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz
    w = r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz
    roll = np.arctan2(v, w)
    if _outside(ranges, 0, roll):
        return 1
    thigh, shin = legs.links[side, 0], legs.links[side, 1]
    span = min(max(length, abs(thigh - shin) + 1e-9), thigh + shin - 1e-9)
    cosine = (span * span + shin * shin - thigh * thigh) / (2.0 * shin * span)
    lean = np.arctan2(u, np.sqrt(v * v + w * w)) + np.arccos(min(max(cosine, -1.0), 1.0))
    if _outside(ranges, 1, -lean):
        return 2
    cr, sr, cl, sl = np.cos(roll), np.sin(roll), np.cos(lean), np.sin(lean)
    # Axis of the pitch joints, and the shin's direction, in the world.
    yx, yy, yz = r[0, 1] * cr - r[0, 2] * sr, r[1, 1] * cr - r[1, 2] * sr, r[2, 1] * cr - r[2, 2] * sr
    tx = dx - shin * (r[0, 0] * sl + r[0, 1] * sr * cl + r[0, 2] * cr * cl)
    ty = dy - shin * (r[1, 0] * sl + r[1, 1] * sr * cl + r[1, 2] * cr * cl)
    tz = dz - shin * (r[2, 0] * sl + r[2, 1] * sr * cl + r[2, 2] * cr * cl)
    norm = np.sqrt(tx * tx + ty * ty + tz * tz)
    xz = (yx * ty - yy * tx) / norm  # z of axis x thigh
    if _outside(ranges, 2, np.arctan2(-(c * yx + s * yy), -s * yx + c * yy)):
        return 3
    if _outside(ranges, 3, np.arcsin(min(max(yz, -1.0), 1.0))):
        return 4
    if _outside(ranges, 4, np.arctan2(-xz, tz / norm)):
        return 5
    return -1
