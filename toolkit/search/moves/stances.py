"""Which stances legs can take under a CoM: every limit kept, and no leg in the other's way."""

from __future__ import annotations

import numpy as np

from toolkit.compiled import compiled
from toolkit.search.moves.legs import LIMITS, Legs, violated
from toolkit.search.moves.shanks import Shanks, leg_points, legs_apart

ENTANGLED = len(LIMITS)  # both legs reach, but hit each other


@compiled(kept=True)
def _stances_violated(legs, shanks, com, drops, yaw, left, left_rotation, right, right_rotation, result):
    """Fill the result of `stances_violated`."""
    a, b = np.empty((3, 3)), np.empty((3, 3))
    for row in range(len(com)):
        first = -1
        for k in range(len(drops)):
            x, y, z = com[row, 0], com[row, 1], com[row, 2] - drops[k]
            broken = violated(legs, 0, x, y, z, yaw[row], left[row], left_rotation[row])
            if broken < 0:
                broken = violated(legs, 1, x, y, z, yaw[row], right[row], right_rotation[row])
            if broken < 0:
                leg_points(legs, 0, x, y, z, yaw[row], left[row], left_rotation[row], a)
                leg_points(legs, 1, x, y, z, yaw[row], right[row], right_rotation[row], b)
                if not legs_apart(shanks, a, b):
                    broken = 6
            if broken < 0:
                first = -1
                break
            if k == 0:
                first = broken
        result[row] = first


def stances_violated(
    legs: Legs,
    shanks: Shanks,
    com: np.ndarray,
    drops: np.ndarray,
    yaw: np.ndarray,
    left: np.ndarray,
    left_rotation: np.ndarray,
    right: np.ndarray,
    right_rotation: np.ndarray,
) -> np.ndarray:
    """Per stance the first limit broken by either leg, -1 where both reach with some drop of the CoM.

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
        (n,) int; index in `LIMITS` or `ENTANGLED` for the first drop, or -1.
    """
    result = np.empty(len(com), np.int64)
    _stances_violated(legs, shanks, com, drops, yaw, left, left_rotation, right, right_rotation, result)
    return result
