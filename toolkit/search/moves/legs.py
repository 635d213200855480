"""Compiled leg checks: which stances the legs can take under a CoM, one at a time, for thousands of candidates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.geometry.limb import FEET
from toolkit.physics.leg import (
    LIMITS,
    LegPosture,
    ReachMargins,
    ankle_at,
    distance,
    hip_at,
    posture_between,
    quantities,
)
from toolkit.robot.model import RobotModel
from toolkit.search.moves.reasons import OF_LIMIT, Reason
from toolkit.search.moves.shanks import legs_apart

_FIELD = tuple(LegPosture._fields.index(limit.quantity) for limit in LIMITS)  # of each limit
_LENGTH = [limit.quantity for limit in LIMITS].index("length")


class Legs(NamedTuple):
    """Both legs as arrays, margins taken off.

    Attributes:
        hip: (2, 3) m; in the CoM's frame with the heading of the base.
        ankle: (2, 3) m; in the sole's frame.
        links: (2, 2) m; thigh and shin.
        ranges: (2, k, 2) m or rad; in the order of `LIMITS`.
    """

    hip: np.ndarray
    ankle: np.ndarray
    links: np.ndarray
    ranges: np.ndarray


def legs_of(robot: RobotModel, margins: ReachMargins) -> Legs:
    """Arrays of a robot's legs, `margins` inside their limits."""
    legs = [robot.legs[limb] for limb in FEET]
    inward = np.array([[getattr(margins, limit.margin)] for limit in LIMITS]) * [1.0, -1.0]
    return Legs(
        hip=np.array([leg.hip_in_com for leg in legs]),
        ankle=np.array([leg.ankle_in_sole for leg in legs]),
        links=np.array([[leg.thigh, leg.shin] for leg in legs]),
        ranges=np.array([[limit.range_of(leg) for limit in LIMITS] + inward for leg in legs]),
    )


@compiled(kept=True)
def reach(legs, side, com, yaw, position, rotation):
    """The first limit that a leg breaks, as a `Reason`, and its hip, knee and ankle in m, zeros where it is too long.

    Args:
        legs: both legs.
        side: 0 left, 1 right.
        com: three numbers in m; CoM, world.
        yaw: rad; heading of the base.
        position: (3,) m; centre of the sole.
        rotation: (3, 3); world_from_sole.
    """
    heading, ranges = (np.cos(yaw), np.sin(yaw)), legs.ranges[side]
    hip, ankle = hip_at(com, heading, legs.hip[side]), ankle_at(position, rotation, legs.ankle[side])
    length, nowhere = distance(hip, ankle), (0.0, 0.0, 0.0)
    if length < ranges[_LENGTH, 0] or length > ranges[_LENGTH, 1]:
        return OF_LIMIT[_LENGTH], (nowhere, nowhere, nowhere)
    posture = posture_between(hip, ankle, rotation, heading, legs.links[side, 0], legs.links[side, 1])
    points = (posture.hip_point, posture.knee_point, posture.ankle_point)
    values = quantities(posture)
    for k in range(len(OF_LIMIT)):
        value = values[_FIELD[k]]
        if value < ranges[k, 0] or value > ranges[k, 1]:
            return OF_LIMIT[k], points
    return 0, points


@compiled(kept=True)
def stances_violated(legs, shanks, com, drops, yaw, left, left_rotation, right, right_rotation):
    """Per stance why the legs cannot take it, with no drop of the CoM.

    Args:
        legs: both legs.
        shanks: capsules inside them.
        com: (n, 3) m.
        drops: (k,) m; the CoM may be lower by any of these.
        yaw: (n,) rad.
        left: (n, 3) m; sole centres.
        left_rotation: (n, 3, 3).
        right: (n, 3) m.
        right_rotation: (n, 3, 3).

    Returns:
        (n,) int; the `Reason` with the first drop, 0 where both legs reach with some drop.
    """
    result = np.zeros(len(com), np.int64)
    for row in range(len(com)):
        for k in range(len(drops)):
            place = (com[row, 0], com[row, 1], com[row, 2] - drops[k])
            reason, a = reach(legs, 0, place, yaw[row], left[row], left_rotation[row])
            if reason == 0:
                reason, b = reach(legs, 1, place, yaw[row], right[row], right_rotation[row])
                if reason == 0 and not legs_apart(shanks, a, b):
                    reason = Reason.KNEES
            if reason == 0:
                result[row] = 0
                break
            if k == 0:
                result[row] = reason
    return result
