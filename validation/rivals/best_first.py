"""Plain A* on any graph of the search: what is left of ANA* when nothing is anytime about it."""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic

from toolkit.search.anytime.graph import SearchProblem, State

Accept = Callable[[Sequence[State], Sequence[Any]], bool]
"""Whether a path of states, with the payloads between them, may end."""


@dataclass(frozen=True)
class Limits:
    """When a search gives up.

    Attributes:
        seconds: s; wall-clock.
        expansions: States expanded.
    """

    seconds: float = math.inf
    expansions: int = 10_000


@dataclass(frozen=True)
class Found(Generic[State]):
    """A path, or why there is none.

    Attributes:
        states: From the start to a goal; empty without a path.
        payloads: Of the edges between them.
        cost: Of the path; inf without one.
        expansions: States expanded.
        seconds: s; wall-clock, with what `accept` took.
        stopped_by: "solution", "exhausted", "expansions" or "time".
    """

    states: tuple[State, ...]
    payloads: tuple[Any, ...]
    cost: float
    expansions: int
    seconds: float
    stopped_by: str


class Tree(Generic[State]):
    """Cheapest known ways to states.

    Attributes:
        g: Cost of the way to each state.
    """

    def __init__(self, start: State):
        """A tree of the start alone."""
        self.g: dict[State, float] = {start: 0.0}
        self._before: dict[State, tuple[State, Any]] = {}

    def enter(self, state: State, cost: float, before: State, payload: Any) -> bool:
        """Enter a way to a state; False where one as cheap is known."""
        if cost >= self.g.get(state, math.inf):
            return False
        self.g[state], self._before[state] = cost, (before, payload)
        return True

    def way(self, state: State) -> tuple[list[State], list[Any]]:
        """States from the start to a state and the payloads between them."""
        states, payloads = [state], []
        while state in self._before:
            state, payload = self._before[state]
            states.append(state)
            payloads.append(payload)
        return states[::-1], payloads[::-1]


def a_star(
    problem: SearchProblem[State], accept: Accept[State], limits: Limits = Limits(), weight: float = 1.0
) -> Found[State]:
    """Expand the open state with the least g + weight * h until a goal is the best and accepted.

    With a weight of 1 and a heuristic that is nowhere too large, the accepted path is the cheapest one.

    Args:
        problem: The graph.
        accept: Asked about every path to a goal; the search goes on after a refusal.
        limits: When to give up.
        weight: Factor on h.
    """
    began, start = time.perf_counter(), problem.start()
    tree, expansions, number = Tree(start), 0, 0
    waiting: list[tuple[float, int, float, State]] = [(0.0, 0, 0.0, start)]
    stopped = "exhausted"
    while waiting:
        _, _, g, state = heapq.heappop(waiting)
        if g > tree.g[state]:
            continue
        if problem.is_goal([state])[0]:
            states, payloads = tree.way(state)
            if accept(states, payloads):
                seconds = time.perf_counter() - began
                return Found(tuple(states), tuple(payloads), g, expansions, seconds, "solution")
        if expansions >= limits.expansions or time.perf_counter() - began > limits.seconds:
            stopped = "expansions" if expansions >= limits.expansions else "time"
            break
        edges = problem.expand(state, math.inf)
        if edges is None:
            stopped = "time"
            break
        expansions += 1
        states = [edge.state for edge in edges]
        for edge, h in zip(edges, problem.heuristic(states) if states else [], strict=True):
            cost = g + edge.cost
            if h < math.inf and tree.enter(edge.state, cost, state, edge.payload):
                number += 1
                heapq.heappush(waiting, (cost + weight * float(h), number, cost, edge.state))
    return Found((), (), math.inf, expansions, time.perf_counter() - began, stopped)
