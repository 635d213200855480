"""What makes states wait for others: an estimate for the order of expansion, never a verdict.

A transition not yet judged waits the longer the more it would have to bend the motion (`toolkit.search.moves.drift`).
Where feet slide and cannot brake, a motion that runs ahead of its feet waits as well.

The capture point c + v / w, w^2 = g / h, of an inverted pendulum is where the robot would have to step to come to rest.
The farther it lies ahead of the foremost foot, the longer the next stride has to be, until no stride is long enough.
On ground steeper than its friction angle the robot moreover gains v^2 = 2 a with every metre, whatever it does, so that
whoever is fast early is too fast for its legs later: v^2 / 2 a is the way by which it is too far on. And legs that
turn in fast swings touch each other.

Reference:
    Koolen, de Boer, Rebula, Goswami, Pratt: Capturability-based analysis and control of legged locomotion, IJRR 2012.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.problem import GRAVITY
from toolkit.geometry.heading import wrapped
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.moves.candidates import Candidates
from toolkit.search.moves.drift import Drift
from toolkit.search.states.contact_table import ContactTable


@dataclass(frozen=True)
class HasteConfig:
    """Weights.

    Attributes:
        capture: per m that the capture point lies ahead of the foremost foot, in the h of 1 m of way.
        early: per m that v^2 / 2 a is long, likewise; with 1 or more nothing would be gained by going on.
        turn: per rad between the feet's headings, likewise.
    """

    capture: float = 1.0
    early: float = 0.7
    turn: float = 0.5


class Haste:
    """Delays of the states of one search.

    Args:
        table: contacts.
        com_height: m; of the CoM above the feet, for the pendulum.
        forced: m/s^2; a.
        per_metre: the search's h of 1 m of way.
        config: weights.
    """

    def __init__(self, table: ContactTable, com_height: float, forced: float, per_metre: float, config: HasteConfig):
        self._table = table
        self._capture = config.capture * per_metre
        self._turn = config.turn * per_metre
        self._energy = config.early * per_metre / (2.0 * forced) if forced > 0.0 else 0.0
        self._time = float(np.sqrt(-com_height / GRAVITY[2]))

    def delay(self, contacts: np.ndarray, com: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """(n,) delays.

        Args:
            contacts: (n, 4) int; contact numbers.
            com: (n, 3) m.
            velocity: (n, 3) m/s.
        """
        position, velocity = self._table.position[:, :2], velocity[:, :2]
        square = (velocity**2).sum(1)
        ahead = velocity / np.maximum(np.sqrt(square), 1e-9)[:, None]
        foremost = np.maximum(*((position[contacts[:, foot]] * ahead).sum(1) for foot in (0, 1)))
        capture = ((com[:, :2] + self._time * velocity) * ahead).sum(1) - foremost
        turn = self._table.yaw[contacts[:, 0]] - self._table.yaw[contacts[:, 1]]
        turn = np.abs(wrapped(turn))
        return self._capture * np.maximum(capture, 0.0) + self._energy * square + self._turn * turn


class Delay:
    """How long the states of one search wait, in units of cost.

    Args:
        config: Weights of what waits to be judged.
        drift: Of the CoM.
        haste: Of motions that run ahead of their feet; None where that is no matter.
    """

    def __init__(self, config: CostConfig, drift: Drift, haste: Haste | None):
        self._config, self._drift, self._haste = config, drift, haste

    def of_states(self, contacts: np.ndarray, com: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """(n,) delays of states with contact numbers (n, 4), CoM (n, 3) m and velocity (n, 3) m/s."""
        return np.zeros(len(contacts)) if self._haste is None else self._haste.delay(contacts, com, velocity)

    def of_waiting(
        self, contacts: np.ndarray, com: np.ndarray, velocity: np.ndarray, candidates: Candidates, *, doubted: bool
    ) -> np.ndarray:
        """(n,) delays of transitions that are not judged yet.

        Args:
            contacts: (4,) int; contact numbers of the state that they lead out of.
            com: (3,) m; its CoM.
            velocity: (3,) m/s; its velocity.
            candidates: The n transitions.
            doubted: Whether one judge has already rejected them.
        """
        miss = self._drift.miss(contacts, com, velocity, candidates)
        doubt = self._config.doubt if doubted else 0.0
        return doubt + self._config.miss * miss + self.of_states(contacts[None], com[None], velocity[None])
