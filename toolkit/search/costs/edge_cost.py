"""Costs of the edges of the contact search, and the least cost of the way to the goal (paper, Eq. 4 and 5).

A new term is a method of `TransitionCost` and a field of `Terms`, with its weight in `CostConfig`; searches and the
cost of finished plans (`toolkit.search.costs.plan_cost`) then count it. A lower bound of the term may be added to
`least_of_edge` and `to_go`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.sequence import CALM
from toolkit.geometry.heading import wrapped
from toolkit.geometry.limb import Limb
from toolkit.robot.scale import USUAL, Scale
from toolkit.search.costs.heuristic import Distance
from toolkit.search.moves.candidates import Candidates
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

FORWARD = np.pi / 4
"""Angle in rad between the heading and the way up to which a robot walks forwards."""

_LEAST_RESERVE = 0.15  # part of the friction; a contact that leaves less costs no more than one that leaves so much
_SURE = 0.98  # part of the least momentum's cost that is counted: the objective takes it at the ends of steps
_LEAN = 0.3  # m for a body of the usual size; by so much less than the mean of the feet the CoM may move
_RESTS = 1.4  # s for the same; at both ends of a plan, in which it may move too
_ARRIVAL = 0.01  # m for the same; plans end this far inside the goal, as robots land a little beside their plans


@dataclass(frozen=True)
class CostConfig:
    """Weights of the terms of the edge cost, for a body of the usual size (`toolkit.robot.scale`).

    Attributes:
        step: Weight w_s of the paper.
        dynamics: Weight w_dyn of the paper.
        time: Cost per s. It always counts: the objective of the dynamics alone is least for the slowest walk.
        pace: The same where the planner chooses the timing, so that a transition's seconds are no part of the task: the
            price at which a robot walks briskly where it can.
        steep: Weight of (`reserve` over the part of its friction that resting leaves) - 1 of a foot's new contact. A
            contact that nearly slides is feasible but leaves the motion no room, so the search avoids it. Does not
            count where no way leads over resting ground.
        reserve: Part of its friction that resting leaves where a contact costs nothing.
        stagger: Cost per m that one foot is ahead of the other in the final stance.
        heading: Cost per m of way that is walked backwards, or in part so (`backwards`). It does not count either where
            no way leads over resting ground, on which a body turns as sliding asks it to.
    """

    step: float = 3.0
    dynamics: float = 0.1
    time: float = 20.0
    pace: float = 60.0
    steep: float = 200.0
    reserve: float = 0.5
    stagger: float = 5.0
    heading: float = 60.0

    def where(self, *, slides: bool, paced: bool) -> CostConfig:
        """The weights of one run.

        Args:
            slides: Whether no way leads over resting ground alone.
            paced: Whether the planner chooses the timing.
        """
        weights = replace(self, time=self.pace if paced else self.time)
        return replace(weights, steep=0.0, heading=0.0) if slides else weights

    def scaled(self, scale: Scale) -> CostConfig:
        """The weights with which a body of another size chooses the same plan in a world to scale.

        The cost of a way remains its length in m, so the others' go with the length. The objective is an integral over
        time, and the stagger and the way that is walked backwards are lengths themselves.
        """
        if scale == USUAL:
            return self
        per_second = scale.length / scale.time
        return replace(
            self,
            step=scale.length * self.step,
            dynamics=per_second * self.dynamics,
            time=per_second * self.time,
            pace=per_second * self.pace,
            steep=scale.length * self.steep,
        )


def arrival_radius(goal: Goal, scale: Scale = USUAL) -> float:
    """Distance in m from the middle of the goal within which the mean of the feet has to be in the end."""
    return max(goal.radius - scale.length * _ARRIVAL, 0.5 * goal.radius)


class Terms(NamedTuple):
    """Terms of the cost of n transitions that are known without their dynamics, (n,) each; see `CostConfig`."""

    way: np.ndarray
    step: np.ndarray
    time: np.ndarray
    steep: np.ndarray
    stagger: np.ndarray
    heading: np.ndarray


def backwards(angle: np.ndarray) -> np.ndarray:
    """(...,) part of a way that counts as walked backwards, at an angle (...,) in rad from the heading.

    None up to 45 degrees, half of it sideways, all of it beyond 135 degrees.
    """
    return np.clip((np.abs(wrapped(angle)) - FORWARD) / (np.pi - 2 * FORWARD), 0.0, 1.0)


class TransitionCost:
    """Costs of transitions: way + step + time * duration + steep + stagger + heading, known at once, and dynamics.

    Args:
        config: Weights.
        table: Contacts.
        timings: The timings to choose from.
        goal: The goal.
        scale: The size of the robot.

    Attributes:
        dynamics: Cost of a dynamics objective of 1.
        time: Cost per s.
    """

    def __init__(
        self,
        config: CostConfig,
        table: ContactTable,
        timings: tuple[Timing, ...],
        goal: Goal,
        scale: Scale = USUAL,
    ):
        config = config.scaled(scale)
        self._config, self._table, self._goal = config, table, goal
        self._durations = np.array([timing.shift + timing.swing for timing in timings])
        self._radius = arrival_radius(goal, scale)
        self.dynamics, self.time = config.dynamics, config.time

    def terms(self, candidates: Candidates) -> Terms:
        """Terms of the cost of transitions without their dynamics."""
        step = np.full(len(candidates), self._config.step)
        time = self.time * self._durations[candidates.timing]
        heading = self._config.heading * candidates.way * backwards(candidates.course - candidates.yaw)
        return Terms(candidates.way, step, time, self._steep(candidates), self._stagger(candidates), heading)

    def known(self, candidates: Candidates) -> np.ndarray:
        """(n,) cost of transitions without their dynamics."""
        return np.sum(self.terms(candidates), axis=0)

    def least_of_edge(self, candidates: Candidates) -> np.ndarray:
        """(n,) least cost of transitions, which every one of them has."""
        return candidates.way + self._config.step + self.time * self._durations.min()

    def at_goal(self, centre: np.ndarray) -> np.ndarray:
        """(n,) bool; whether a plan may end with the mean of the feet at (n, 3) m."""
        return self._goal.distance(centre) <= self._radius

    def _steep(self, candidates: Candidates) -> np.ndarray:
        """(n,) cost of feet on contacts that leave little friction."""
        cost = np.zeros(len(candidates))
        if self._config.steep == 0.0:
            return cost
        feet = np.flatnonzero(candidates.limb <= Limb.RIGHT_FOOT)
        reserve = np.maximum(1.0 - self._table.steepness(candidates.number[feet]), _LEAST_RESERVE)
        cost[feet] = self._config.steep * np.maximum(self._config.reserve / reserve - 1.0, 0.0)
        return cost

    def _stagger(self, candidates: Candidates) -> np.ndarray:
        """(n,) cost of one foot ahead of the other where the goal is reached."""
        at_goal = self.at_goal(candidates.centre)
        if not at_goal.any():
            return np.zeros(len(candidates))
        left, right = (self._table.position[candidates.contacts[:, foot]] for foot in (0, 1))
        apart = left - right
        ahead = np.abs(np.cos(candidates.yaw) * apart[:, 0] + np.sin(candidates.yaw) * apart[:, 1])
        return np.where(at_goal, self._config.stagger * ahead, 0.0)


class EdgeCost(TransitionCost):
    """Costs of one search: those of transitions, and the least cost of the way to the goal.

    Args:
        config, table, timings, goal: See `TransitionCost`.
        distance: Distance to the goal.
        longest: The farthest, in m, that the mean of the feet moves in one transition.
        mass: kg; of the robot whose motions the objectives are of. 0 where they are not those of motions.
        scale: The size of the robot.
    """

    def __init__(
        self,
        config: CostConfig,
        table: ContactTable,
        timings: tuple[Timing, ...],
        goal: Goal,
        distance: Distance,
        longest: float,
        mass: float = 0.0,
        scale: Scale = USUAL,
    ):
        super().__init__(config, table, timings, goal, scale)
        self._distance, self._longest, self._lean = distance, longest, scale.length * _LEAN
        self._length, self._rests = scale.length, scale.time * _RESTS
        self._momentum = _SURE * self.dynamics * CALM.scaled(scale).linear_momentum / 0.2 * mass**2
        self._slowest = float(self._durations.max())
        # Of one transition, as long as the slowest and as cheap as the shortest one.
        self._step = self._config.step + self.time * float(self._durations.min())

    def to_go(self, centre: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n,) least cost to the goal for the mean of the feet (n, 3) m with headings (n,) rad.

        Beside the way and the transitions of Eq. 5 of the paper, it counts what moving so far costs at least: the
        integral of the squared momentum over a time T is at least (m d)^2 / T for a way d. More transitions take more
        time and so less momentum; the cheapest number of them counts, at least one where the goal is not reached.
        """
        distance = self._distance(centre, yaw)
        reachable = np.isfinite(distance)
        least = self._least(np.where(reachable, distance, 0.0), ~self.at_goal(centre))
        return np.where(reachable, least, np.inf)

    @property
    def per_metre(self) -> float:
        """Increase of `to_go` per m of a long way."""
        near, far = self._least(self._length * np.array([10.0, 20.0]), np.ones(2, bool))
        return (far - near) / (10.0 * self._length)

    @property
    def unit(self) -> float:
        """The same for 1 m of way of a body of the usual size, to scale."""
        return self._length * self.per_metre

    def _least(self, distance: np.ndarray, away: np.ndarray) -> np.ndarray:
        """(n,) least cost of ways (n,) in m; `away` (n,) says where at least one transition is missing."""
        count = np.maximum(distance / self._longest, away)
        moved = np.maximum(distance - self._lean, 0.0)
        slack = self._rests + self._slowest * count
        time = np.maximum(slack, moved * np.sqrt(self._momentum * self._slowest / max(self._step, 1e-9)))
        return distance + self._step * (count + (time - slack) / self._slowest) + self._momentum * moved**2 / time
