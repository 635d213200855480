"""What an edge of the contact search costs, and what the way to the goal costs at least (paper, Eq. 4 and 5).

A new term is a method of `EdgeCost` that `known` adds up, with its weight in `CostConfig`. Where it has a lower bound,
that may be added to `least_of_edge` and `to_go`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.search.costs.heuristic import Distance
from toolkit.search.moves.candidates import Candidates
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

_Number = TypeVar("_Number", float, np.ndarray)
_LEAST_RESERVE = 0.02  # of friction; what slides costs no more than what barely holds


@dataclass(frozen=True)
class CostConfig:
    """Weights of the terms of the edge cost, and the limits that hold on edges.

    Attributes:
        step: w_s of the paper.
        dynamics: w_dyn of the paper.
        time: per s; counts only where the planner may choose between timings, lest slower always look better.
        steep: of a foot's new contact, times (`reserve` over the part of its friction that resting leaves) - 1: what
            nearly slides is feasible, but leaves the whole motion no room, so the search goes round it where it can.
            Not where no way leads over resting ground.
        reserve: part of its friction that resting leaves where a contact costs nothing.
        stagger: per m that one foot is ahead of the other in the final stance.
        swing_speed: m/s; a foot may not have to fly faster on average.
        arrival: m; a plan ends so far inside the goal, as robots land a little beside their plans (at most half of the
            goal's radius).
        miss: per m by which a transition not yet judged would have to bend the motion; only for the order in which
            transitions are judged.
        doubt: of a transition that the evaluator rejects and its stand-in has not judged yet; likewise.
    """

    step: float = 3.0
    dynamics: float = 0.1
    time: float = 5.0
    steep: float = 200.0
    reserve: float = 0.5
    stagger: float = 5.0
    swing_speed: float = 4.0
    arrival: float = 0.01
    miss: float = 30.0
    doubt: float = 3.0


class EdgeCost:
    """Costs of one search: way + step + time * duration + steep + stagger, known at once, + dynamics * objective.

    Args:
        config: Weights.
        table: Contacts.
        timings: The timings to choose from.
        goal: Where to.
        distance: To the goal.
        longest: m; the most that the mean of the feet moves in one transition.
    """

    def __init__(
        self,
        config: CostConfig,
        table: ContactTable,
        timings: tuple[Timing, ...],
        goal: Goal,
        distance: Distance,
        longest: float,
    ):
        self._config, self._table, self._goal, self._distance, self._longest = config, table, goal, distance, longest
        self._durations = np.array([timing.shift + timing.swing for timing in timings])
        self._radius = max(goal.radius - config.arrival, 0.5 * goal.radius)

    def known(self, candidates: Candidates) -> np.ndarray:
        """(n,) cost of transitions, dynamics apart."""
        cost = self.least_of_edge(candidates)
        for term in (self._time, self._steep, self._stagger):
            cost = cost + term(candidates)
        return cost

    def dynamics(self, objective: _Number) -> _Number:
        """Cost of dynamics objectives, one or (n,)."""
        return self._config.dynamics * objective

    def least_of_edge(self, candidates: Candidates) -> np.ndarray:
        """(n,) cost that transitions have whatever else they have."""
        return candidates.way + self._config.step

    def to_go(self, centre: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n,) least cost to the goal; Eq. 5 of the paper, with at least one transition where it is not reached.

        Args:
            centre: (n, 3) m; mean of the feet.
            yaw: (n,) rad; its heading.
        """
        distance = self._distance(centre, yaw)
        return distance + self._config.step * np.maximum(distance / self._longest, ~self.at_goal(centre))

    @property
    def per_metre(self) -> float:
        """What `to_go` grows by per m of way."""
        return 1.0 + self._config.step / self._longest

    def at_goal(self, centre: np.ndarray) -> np.ndarray:
        """(n,) bool; whether a plan may end with the mean of the feet at (n, 3) m."""
        return np.hypot(*(centre[:, :2] - self._goal.position[:2]).T) <= self._radius

    def _time(self, candidates: Candidates) -> np.ndarray | float:
        return self._config.time * self._durations[candidates.timing] if len(self._durations) > 1 else 0.0

    def _steep(self, candidates: Candidates) -> np.ndarray | float:
        """Of feet on contacts that leave little friction."""
        if self._config.steep == 0.0:
            return 0.0
        cost, feet = np.zeros(len(candidates)), np.flatnonzero(candidates.limb <= Limb.RIGHT_FOOT)
        reserve = np.maximum(1.0 - self._table.steepness(candidates.number[feet]), _LEAST_RESERVE)
        cost[feet] = self._config.steep * np.maximum(self._config.reserve / reserve - 1.0, 0.0)
        return cost

    def _stagger(self, candidates: Candidates) -> np.ndarray | float:
        """Of one foot ahead of the other where the goal is reached."""
        at_goal = self.at_goal(candidates.centre)
        if not at_goal.any():
            return 0.0
        left, right = (self._table.position[candidates.contacts[:, foot]] for foot in (0, 1))
        apart = left - right
        ahead = np.abs(np.cos(candidates.yaw) * apart[:, 0] + np.sin(candidates.yaw) * apart[:, 1])
        return np.where(at_goal, self._config.stagger * ahead, 0.0)
