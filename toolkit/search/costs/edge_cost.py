"""Costs of the edges of the contact search, and the least cost of the way to the goal (paper, Eq. 4 and 5).

A new term is a method of `EdgeCost` that `known` adds up, with its weight in `CostConfig`. A lower bound of the term
may be added to `least_of_edge` and `to_go`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.search.costs.heuristic import Distance
from toolkit.search.moves.candidates import Candidates
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

_LEAST_RESERVE = 0.02  # part of the friction; contacts that slide cost no more than those that barely hold
_ARRIVAL = 0.01  # m; plans end this far inside the goal, as robots land a little beside their plans


@dataclass(frozen=True)
class CostConfig:
    """Weights of the terms of the edge cost.

    Attributes:
        step: Weight w_s of the paper.
        dynamics: Weight w_dyn of the paper.
        time: Cost per s. It counts only where the planner may choose between timings; otherwise slower would always
            look better.
        steep: Weight of (`reserve` over the part of its friction that resting leaves) - 1 of a foot's new contact. A
            contact that nearly slides is feasible but leaves the motion no room, so the search avoids it. Does not
            count where no way leads over resting ground.
        reserve: Part of its friction that resting leaves where a contact costs nothing.
        stagger: Cost per m that one foot is ahead of the other in the final stance.
    """

    step: float = 3.0
    dynamics: float = 0.1
    time: float = 5.0
    steep: float = 200.0
    reserve: float = 0.5
    stagger: float = 5.0


class EdgeCost:
    """Costs of one search: way + step + time * duration + steep + stagger, known at once, + dynamics * objective.

    Args:
        config: Weights.
        table: Contacts.
        timings: The timings to choose from.
        goal: The goal.
        distance: Distance to the goal.
        longest: The farthest, in m, that the mean of the feet moves in one transition.

    Attributes:
        dynamics: Cost of a dynamics objective of 1.
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
        self._radius = max(goal.radius - _ARRIVAL, 0.5 * goal.radius)
        self.dynamics = config.dynamics

    def known(self, candidates: Candidates) -> np.ndarray:
        """(n,) cost of transitions without their dynamics."""
        cost = self.least_of_edge(candidates)
        for term in (self._time, self._steep, self._stagger):
            cost = cost + term(candidates)
        return cost

    def least_of_edge(self, candidates: Candidates) -> np.ndarray:
        """(n,) least cost of transitions, which every one of them has."""
        return candidates.way + self._config.step

    def to_go(self, centre: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n,) least cost to the goal for the mean of the feet (n, 3) m with headings (n,) rad, by Eq. 5 of the paper.

        It counts at least one transition where the goal is not reached.
        """
        distance = self._distance(centre, yaw)
        return distance + self._config.step * np.maximum(distance / self._longest, ~self.at_goal(centre))

    @property
    def per_metre(self) -> float:
        """Increase of `to_go` per m of way."""
        return 1.0 + self._config.step / self._longest

    def at_goal(self, centre: np.ndarray) -> np.ndarray:
        """(n,) bool; whether a plan may end with the mean of the feet at (n, 3) m."""
        return np.hypot(*(centre[:, :2] - self._goal.position[:2]).T) <= self._radius

    def _time(self, candidates: Candidates) -> np.ndarray | float:
        return self._config.time * self._durations[candidates.timing] if len(self._durations) > 1 else 0.0

    def _steep(self, candidates: Candidates) -> np.ndarray | float:
        """(n,) cost of feet on contacts that leave little friction."""
        if self._config.steep == 0.0:
            return 0.0
        cost, feet = np.zeros(len(candidates)), np.flatnonzero(candidates.limb <= Limb.RIGHT_FOOT)
        reserve = np.maximum(1.0 - self._table.steepness(candidates.number[feet]), _LEAST_RESERVE)
        cost[feet] = self._config.steep * np.maximum(self._config.reserve / reserve - 1.0, 0.0)
        return cost

    def _stagger(self, candidates: Candidates) -> np.ndarray | float:
        """(n,) cost of one foot ahead of the other where the goal is reached."""
        at_goal = self.at_goal(candidates.centre)
        if not at_goal.any():
            return 0.0
        left, right = (self._table.position[candidates.contacts[:, foot]] for foot in (0, 1))
        apart = left - right
        ahead = np.abs(np.cos(candidates.yaw) * apart[:, 0] + np.sin(candidates.yaw) * apart[:, 1])
        return np.where(at_goal, self._config.stagger * ahead, 0.0)
