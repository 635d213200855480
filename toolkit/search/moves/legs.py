"""Compiled checks of the stances that the legs can take under a CoM, for thousands of candidates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.geometry.limb import FEET
from toolkit.physics.leg import (
    LIMITED,
    LIMITS,
    ReachMargins,
    ankle_at,
    distance,
    drop_to,
    hip_at,
    hip_joints,
    posture_between,
    quantities,
)
from toolkit.robot.model import RobotModel
from toolkit.search.moves.reasons import OF_LIMIT, Reason
from toolkit.search.moves.shanks import legs_apart

_LENGTH = [limit.quantity for limit in LIMITS].index("length")
_BARELY = 1e-6  # m; what a leg is bent more than at its greatest length, against rounding


class Legs(NamedTuple):
    """Both legs as arrays, with their margins taken off.

    Attributes:
        hip: (2, 3) m; hips in the CoM's frame with the heading of the base.
        ankle: (2, 3) m; ankles in the sole's frame.
        links: (20,); lengths of thigh and shin in m and numbers of the `HipJoints`, of one leg after the other.
        ranges: (2, k, 2) m or rad; least and greatest values in the order of `LIMITS`.
        toes: (2,) rad; least and greatest heading of the left sole less that of the right one. The base turns between
            the feet as it likes, so that only both hips' yaw together bounds them.
    """

    hip: np.ndarray
    ankle: np.ndarray
    links: np.ndarray
    ranges: np.ndarray
    toes: np.ndarray


def legs_of(robot: RobotModel, margins: ReachMargins) -> Legs:
    """Arrays of a robot's legs, whose ranges are narrower than the limits by the margins."""
    legs = [robot.legs[limb] for limb in FEET]
    left, right = (leg.ranges["hip_yaw"] for leg in legs)
    inward = np.array([[getattr(margins, limit.margin)] for limit in LIMITS]) * [1.0, -1.0]
    return Legs(
        hip=np.array([leg.hip_in_com for leg in legs]),
        ankle=np.array([leg.ankle_in_sole for leg in legs]),
        links=np.concatenate([leg.numbers[6:] for leg in legs]),
        ranges=np.array([[limit.range_of(leg) for limit in LIMITS] + inward for leg in legs]),
        toes=np.array([left[0] - right[1], left[1] - right[0]]),
    )


@compiled(kept=True)
def reach(legs, side, com, yaw, position, rotation, lean=np.inf):
    """The first limit that a leg breaks, as a `Reason`, and its hip, knee and ankle in m, zeros where it is too long.

    The leg of a side (0 left, 1 right) lies between the CoM com, three numbers in m in the world, and a sole with the
    centre position (3,) m and the rotation (3, 3) world_from_sole. The heading of the base is yaw in rad. The world
    lets the shin lean towards the toes by so many rad.
    """
    heading, ranges = (np.cos(yaw), np.sin(yaw)), legs.ranges[side]
    hip, ankle = hip_at(com, heading, legs.hip[side]), ankle_at(position, rotation, legs.ankle[side])
    length, nowhere = distance(hip, ankle), (0.0, 0.0, 0.0)
    if length < ranges[_LENGTH, 0] or length > ranges[_LENGTH, 1]:
        return OF_LIMIT[_LENGTH], (nowhere, nowhere, nowhere)
    at = side * (len(legs.links) // 2)
    thigh, shin, joints = legs.links[at], legs.links[at + 1], hip_joints(legs.links, at + 2)
    posture = posture_between(hip, ankle, rotation, heading, thigh, shin, joints)
    points = (posture.hip_point, posture.knee_point, posture.ankle_point)
    values = quantities(posture)
    for k in range(len(OF_LIMIT)):
        value = values[LIMITED[k]]
        if value < ranges[k, 0] or value > ranges[k, 1]:
            return OF_LIMIT[k], points
    if posture.ankle_pitch < -lean:
        return Reason.SHANK, points
    return 0, points


@compiled
def least_drop(legs, com, yaw, left, left_rotation, right, right_rotation):
    """By how many m a CoM has to be lower for both legs to reach their soles, bent as little as they may be.

    Below 0 where it may be higher, down to the ankles where they do not reach at any height; arguments: see `reach`.
    """
    heading, least = (np.cos(yaw), np.sin(yaw)), -np.inf
    for side in range(2):
        position, rotation = (left, left_rotation) if side == 0 else (right, right_rotation)
        hip, ankle = hip_at(com, heading, legs.hip[side]), ankle_at(position, rotation, legs.ankle[side])
        least = max(least, drop_to(hip, ankle, legs.ranges[side, _LENGTH, 1] - _BARELY))
    return least


@compiled
def _heading(rotation):
    """Heading in rad of a sole with the rotation (3, 3)."""
    return np.arctan2(rotation[1, 0], rotation[0, 0])


def any_lean(n: int) -> np.ndarray:
    """Leans of `stances_violated` where nothing stands before the feet of n stances."""
    return np.full((n, 2), np.inf)


@compiled(kept=True, allocates=True)
def stances_violated(legs, shanks, com, drops, yaw, left, left_rotation, right, right_rotation, leans):
    """(n,) int; why the legs cannot take each of n stances with the first drop, 0 where they can with some drop.

    The CoMs com (n, 3) m may be lower by any of the rising drops (k,) m, and by what the legs need to reach (see
    `least_drop`), which comes first where it lies between them; yaw (n,) rad is the heading of the base. The centres
    left and right (n, 3) m of the soles come with their rotations (n, 3, 3), and with how far both shins may lean,
    leans (n, 2) rad; shanks: see `Body`.
    """
    result = np.zeros(len(com), np.int64)
    for row in range(len(com)):
        toes = _heading(left_rotation[row]) - _heading(right_rotation[row])
        toes = (toes + np.pi) % (2.0 * np.pi) - np.pi
        if toes < legs.toes[0] or toes > legs.toes[1]:
            result[row] = Reason.HIP_YAW
            continue
        soles = (left[row], left_rotation[row], right[row], right_rotation[row])
        place = (com[row, 0], com[row, 1], com[row, 2])
        first = max(drops[0], least_drop(legs, place, yaw[row], *soles))
        if first > drops[-1]:
            result[row] = OF_LIMIT[_LENGTH]
            continue
        for k in range(-1, len(drops)):
            drop = first if k < 0 else drops[k]
            if k >= 0 and drop <= first:
                continue
            place = (com[row, 0], com[row, 1], com[row, 2] - drop)
            reason, a = reach(legs, 0, place, yaw[row], left[row], left_rotation[row], leans[row, 0])
            if reason == 0:
                reason, b = reach(legs, 1, place, yaw[row], right[row], right_rotation[row], leans[row, 1])
                if reason == 0 and not legs_apart(shanks, a, b):
                    reason = Reason.KNEES
            if reason == 0:
                result[row] = 0
                break
            if k < 0:
                result[row] = reason
    return result
