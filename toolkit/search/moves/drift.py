"""Drift of the CoM while a limb moves, by the inverted pendulum: how far a transition must bend the motion.

With the weight on a point p of the ground at height h below the CoM, x'' = (x - p) g / h. With p_1 during the shift
and p_2 during the swing the CoM ends at

    x = x_0 cosh(w T) + v_0 sinh(w T) / w - p_1 (cosh(w T) - cosh(w T_2)) - p_2 (cosh(w T_2) - 1),  w^2 = g / h

so that the CoMs within reach, p_1 and p_2 anywhere under the feet, are an interval along each axis. Transitions whose
feet lie elsewhere are hardly feasible. Nor are slow ones on ground steeper than its friction angle, where a robot on
one foot gains at least g (sin a - mu cos a) downhill. The estimate orders the transitions to judge; it rejects nothing.
"""

from __future__ import annotations

import numpy as np

from toolkit.centroidal.problem import GRAVITY
from toolkit.geometry.limb import FEET
from toolkit.robot.model import RobotModel
from toolkit.search.moves.candidates import Candidates
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.timing import Timing

_SLOW = 6.0  # w T beyond which everything is within reach
# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_CENTRED = 0.02  # m; miss of feet at the edge of what is within reach; in its middle it is 0
_BEHIND = 0.25  # m; the farthest that the mean of the feet may stay behind a CoM that slides


class Drift:
    """Drift of the CoM in the transitions of one search, with its contacts and the timings to choose from."""

    def __init__(self, robot: RobotModel, table: ContactTable, timings: tuple[Timing, ...]):
        self._table = table
        self._centred, self._behind = robot.scale.length * _CENTRED, robot.scale.length * _BEHIND
        self._sole = float(robot.half_sizes[FEET[0]].max())
        self._shift, self._swing = (np.array([getattr(t, name) for t in timings]) for name in ("shift", "swing"))
        rate = float(np.sqrt(-GRAVITY[2] / robot.com_height))
        total = np.minimum(rate * (self._shift + self._swing), _SLOW)
        swing = np.minimum(rate * self._swing, total)
        self._from_com, self._from_velocity = np.cosh(total), np.sinh(total) / rate
        self._from_shift, self._from_swing = np.cosh(total) - np.cosh(swing), np.cosh(swing) - 1.0

    def miss(self, contacts: np.ndarray, com: np.ndarray, velocity: np.ndarray, candidates: Candidates) -> np.ndarray:
        """(n,) m; distance of the mean of the feet afterwards from where the CoM can drift, and from its middle.

        The n candidates lead out of contact numbers (4,) with the CoM (3,) m and its velocity (3,) m/s.
        """
        table, k = self._table, candidates.timing
        feet = table.position[contacts[:2], :2]
        # While a foot moves, the other one carries the robot; while a palm moves, both feet do.
        foot = candidates.limb <= 1
        other = feet[np.where(foot, 1 - candidates.limb, 0)]
        low = np.where(foot[:, None], other, feet.min(0)) - self._sole
        high = np.where(foot[:, None], other, feet.max(0)) + self._sole
        free = self._from_com[k, None] * com[:2] + self._from_velocity[k, None] * velocity[:2]
        shift, swing = self._from_shift[k, None], self._from_swing[k, None]
        least = free - shift * (feet.max(0) + self._sole) - swing * high
        most = free - shift * (feet.min(0) - self._sole) - swing * low
        centre = candidates.centre[:, :2]
        outside = np.maximum(np.maximum(least - centre, centre - most), 0.0)
        off = np.minimum(np.abs(2 * centre - least - most) / (most - least), 1.0)
        slide = self._slide(contacts, com, velocity, candidates)
        return np.hypot(*outside.T) + self._centred * np.hypot(*off.T) + slide

    def _slide(self, contacts: np.ndarray, com: np.ndarray, velocity: np.ndarray, candidates: Candidates) -> np.ndarray:
        """(n,) m; distance that the CoM must slide beyond the feet."""
        downhill, gain = self._table.slide(contacts[:2])
        result = np.zeros(len(candidates))
        if not gain.any() or (contacts[2:] >= 0).any():
            return result
        both = bool(gain.all())  # a robot with one foot at rest need not slide
        for foot in FEET:
            rows = np.flatnonzero(candidates.limb == foot)
            stand, k = int(foot.mirrored), candidates.timing[rows]
            t = self._swing[k]
            way = gain[stand] * t**2 / 2
            if both:
                shift = self._shift[k]
                way += (velocity[:2] @ downhill[stand]) * (shift + t) + gain.min() * (shift**2 / 2 + shift * t)
            ahead = (com[:2] - candidates.centre[rows, :2]) @ downhill[stand] - self._behind
            result[rows] = np.maximum(ahead + way, 0.0)
        return result
