"""Clearance: accelerations that keep pairs of bodies apart."""

from __future__ import annotations

import numpy as np

RATE = 25.0  # 1/s for a body of the usual size (`toolkit.robot.scale`); speed of an approach, per m of distance
MAX_ACCELERATION = 100.0  # m/s^2; most that is asked of two bodies


class Clearance:
    """Bounds on the accelerations at which pairs of bodies part.

    With d the distance of two bodies beyond the one that they keep, and r the rate, `d'' >= -r^2 d - 2 r d'` keeps
    d >= 0 once `d' >= -r d` holds (a barrier of second order), with `d'' = J qdd` at the nearest points; what their
    motion along the surfaces adds is left out.

    Attributes:
        count: Number of pairs that are near.
        rows: (k, nv) Jacobians J of their distances, of at most k pairs; the first `count` rows count.
        lower: (k,) m/s^2; least accelerations.
    """

    def __init__(self, pairs: int, nv: int):
        """Start empty, for at most so many pairs: those that approach their limit fastest."""
        self.count, self.rows, self.lower = 0, np.zeros((pairs, nv)), np.zeros(pairs)

    def _take(self, bounds: list[tuple[np.ndarray, float]]) -> None:
        """Keep the foremost of some bounds: Jacobians (nv,) and least accelerations."""
        bounds.sort(key=lambda pair: -pair[1])
        self.count = min(len(bounds), len(self.lower))
        for row, (jacobian, lower) in enumerate(bounds[: self.count]):
            self.rows[row], self.lower[row] = jacobian, min(lower, MAX_ACCELERATION)


def least_acceleration(room: float, speed: float, rate: float) -> float:
    """Least acceleration in m/s^2 of a distance with so much `room` in m, which grows at a speed in m/s.

    The rate in 1/s is r of `Clearance`.
    """
    return -rate * (rate * room + 2.0 * speed)


def nearest(keys: np.ndarray, distance: np.ndarray) -> list[int]:
    """Of entries with the same key (k,), the one with the least distance (k,); in the order of their distances."""
    order = np.argsort(distance, kind="stable")
    _, first = np.unique(keys[order], return_index=True)
    return order[np.sort(first)].tolist()
