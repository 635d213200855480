"""Delays: estimates by which states wait for others in the order of expansion. They reject nothing.

A transition that is not yet judged waits longer, the more it would have to bend the motion
(`toolkit.search.moves.drift`). States that do not face the way ahead wait, so that robots turn while they walk. Where
feet slide and cannot brake, a motion that runs ahead of its feet waits as well.

The capture point c + v / w, w^2 = g / h, of an inverted pendulum is where the robot would have to step to come to rest.
The farther it lies ahead of the foremost foot, the longer the next stride has to be, until no stride is long enough.
On ground steeper than its friction angle the robot also gains v^2 = 2 a with every metre. A motion that is fast early
becomes too fast for its legs later: v^2 / 2 a is the distance by which it is ahead. Legs that turn in fast swings touch
each other.

Reference:
    Koolen, de Boer, Rebula, Goswami, Pratt: Capturability-based analysis and control of legged locomotion, IJRR 2012.
"""

from __future__ import annotations

import numpy as np

from toolkit.centroidal.problem import GRAVITY
from toolkit.geometry.heading import wrapped
from toolkit.search.costs.edge_cost import FORWARD, backwards
from toolkit.search.costs.heuristic import Distance
from toolkit.search.moves.candidates import Candidates
from toolkit.search.moves.drift import Drift
from toolkit.search.states.contact_table import ContactTable

# All weights are in the h of 1 m of way, those that are not per m in that of a body of the usual size
# (`toolkit.robot.scale`). Those of haste:
_CAPTURE = 1.0  # per m that the capture point lies ahead of the foremost foot
_EARLY = 0.8  # per m of v^2 / 2 a; with 1 or more nothing would be gained by going on
_TURN = 0.5  # per rad between the feet's headings
# That of states that do not face the way ahead:
_FACE = 0.5  # per rad that is missing
# Those of transitions that are not judged yet:
_MISS = 4.0  # per m by which a transition would have to bend the motion


class Haste:
    """Delays of states that run ahead of their feet.

    Args:
        table: Contacts.
        com_height: Height in m of the CoM above the feet, for the pendulum.
        forced: The acceleration a in m/s^2.
        per_metre: The search's h of 1 m of way.
        scale: Factor on lengths.
    """

    def __init__(self, table: ContactTable, com_height: float, forced: float, per_metre: float, scale: float = 1.0):
        self._table = table
        self._capture = _CAPTURE * per_metre
        self._turn = scale * _TURN * per_metre
        self._energy = _EARLY * per_metre / (2.0 * forced) if forced > 0.0 else 0.0
        self._time = float(np.sqrt(-com_height / GRAVITY[2]))

    def delay(self, contacts: np.ndarray, com: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """(n,) delays of states with contact numbers (n, 4), CoM (n, 3) m and velocity (n, 3) m/s."""
        position, velocity = self._table.position[:, :2], velocity[:, :2]
        square = (velocity**2).sum(1)
        ahead = velocity / np.maximum(np.sqrt(square), 1e-9)[:, None]
        foremost = np.maximum(*((position[contacts[:, foot]] * ahead).sum(1) for foot in (0, 1)))
        capture = ((com[:, :2] + self._time * velocity) * ahead).sum(1) - foremost
        turn = self._table.yaw[contacts[:, 0]] - self._table.yaw[contacts[:, 1]]
        turn = np.abs(wrapped(turn))
        return self._capture * np.maximum(capture, 0.0) + self._energy * square + self._turn * turn


class Facing:
    """Delays of states that do not face the way ahead: what turning, or else the rest of the way as it is, may cost.

    Args:
        distance: Distance to the goal.
        heading: Cost of 1 m of way that is walked backwards.
        per_metre: The search's h of 1 m of way.
        scale: Factor on lengths.
    """

    def __init__(self, distance: Distance, heading: float, per_metre: float, scale: float = 1.0):
        self._distance, self._heading = distance, heading
        self._turn = scale * _FACE * per_metre

    def delay(self, centre: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n,) delays of states with the mean of the feet at (n, 3) m and headings (n,) rad."""
        delay = np.zeros(len(yaw))
        if self._heading > 0.0 and len(yaw):
            angle = np.abs(wrapped(self._distance.ahead(centre, yaw) - yaw))
            (rows,) = np.nonzero(angle > FORWARD)  # not where it is NaN
            if len(rows):
                going_on = self._heading * backwards(angle[rows]) * self._distance(centre[rows], yaw[rows])
                delay[rows] = np.minimum(self._turn * (angle[rows] - FORWARD), going_on)
        return delay


class Delay:
    """Delays of the states of one search, in units of cost.

    Args:
        drift: Drift of the CoM.
        facing: Delays of states that do not face the way ahead.
        haste: Delays of motions that run ahead of their feet; None: these do not wait.
        per_metre: The search's h of 1 m of way.
    """

    def __init__(self, drift: Drift, facing: Facing, haste: Haste | None, per_metre: float):
        self._drift, self._facing, self._haste, self._per_metre = drift, facing, haste, per_metre

    def of_states(self, candidates: Candidates, com: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """(n,) delays of the states after n candidates, with CoM (n, 3) m and velocity (n, 3) m/s."""
        delay = self._facing.delay(candidates.centre, candidates.yaw)
        return delay if self._haste is None else delay + self._haste.delay(candidates.contacts, com, velocity)

    def of_waiting(
        self, contacts: np.ndarray, com: np.ndarray, velocity: np.ndarray, candidates: Candidates
    ) -> np.ndarray:
        """(n,) delays of transitions that are not judged yet.

        The n candidates lead out of contact numbers (4,) with the CoM (3,) m and its velocity (3,) m/s.
        """
        miss = self._drift.miss(contacts, com, velocity, candidates)
        return self._facing.delay(candidates.centre, candidates.yaw) + self._per_metre * _MISS * miss
