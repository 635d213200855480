"""Epsilon-greedy ANA*, for any graph: anytime search without a parameter for its greed.

ANA* keeps the cost G of the best solution and always expands the open state with the largest

    e(s) = (G - g(s)) / h(s)

that is, the one that most probably improves on G. With h admissible, a solution is at most max_open e(s) times as
costly as the best one. With probability epsilon a random open state is expanded instead, which leaves the guarantees
alone and helps out of cul-de-sacs. States reopen when a cheaper path to them is found, so that the search, run to
exhaustion, ends with the cheapest path whether or not h is consistent.

Beyond the paper, states that are alike can be made to wait for each other (`AnaStarConfig.crowding`): each expansion
in a crowd adds to the h by which the others in it are ordered, as if the valley there filled up. Pruning and bounds
keep the true h.

Reference:
    van den Berg, Shah, Huang, Goldberg: ANA*: Anytime Nonparametric A*, AAAI 2011; the paper, Sec. V.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, Generic

import numpy as np

from toolkit.search.anytime.graph import Edge, Judge, Path, Progress, SearchProblem, State
from toolkit.search.anytime.open_list import OpenList

_TINY = 1e-9  # divisor in place of h = 0


@dataclass(frozen=True)
class AnaStarConfig:
    """Settings of the search.

    Attributes:
        epsilon: probability of expanding a random open state.
        layer: random draws take the best state of a random interval of h, so wide; inf: they are uniform.
        initial_cost: stands for G before there is a solution, for the order of expansion only: inf expands the least
            h (depth first, fastest), a smaller value weighs the cost so far as well. Nothing is pruned by it.
        crowding: added to h for the order of expansion, per state already expanded in the same crowd. While there is no
            solution it grows, by as much again with every `patience` expansions.
        patience: see `crowding`.
        refusal: added to h for the order of expansion where the judge refused a goal.
        max_expansions: ends the search; None for no limit.
        first_only: the first solution ends the search.
        max_states: ends the search, to bound memory.
        report_interval: s between calls of the observer, solutions apart.
    """

    epsilon: float = 0.1
    layer: float = math.inf
    initial_cost: float = math.inf
    crowding: float = 0.3
    patience: int = 200
    refusal: float = 3.0
    max_expansions: int | None = None
    first_only: bool = False
    max_states: int = 700_000
    report_interval: float = 0.1


@dataclass(frozen=True)
class AnaStarResult(Generic[State]):
    """Outcome.

    Attributes:
        paths: every solution, in the order of their finding; costs fall strictly.
        stopped_by: "exhausted" (nothing left that could improve), "time", "expansions", "memory" or "solution".
        lower_bound: no path can cost less (with h admissible).
        seconds, expansions, states: spent and known.
        expanded: states in order of expansion.
    """

    paths: tuple[Path[State], ...]
    stopped_by: str
    lower_bound: float
    seconds: float
    expansions: int
    states: int
    expanded: tuple[State, ...] = field(repr=False)


class AnaStar(Generic[State]):
    """One search. Make it, call `run` once.

    Args:
        problem: the graph.
        rng: for the random expansions.
        config: settings.
        judge: has the last word on an edge that reaches a goal: returns it, or another edge in its place (a different
            cost or payload), or None: then the search goes on from there.
    """

    def __init__(
        self,
        problem: SearchProblem[State],
        rng: np.random.Generator,
        config: AnaStarConfig | None = None,
        judge: Judge[State] | None = None,
    ):
        self._problem, self._rng, self._judge = problem, rng, judge
        self._config = config or AnaStarConfig()
        self._best = math.inf  # G
        self._index: dict[State, int] = {}
        self._state: list[State] = []
        self._g: list[float] = []
        self._h: list[float] = []
        self._parent: list[int] = []
        self._edge_cost: list[float] = []  # from the parent
        self._payload: list[Any] = []
        self._delay: list[float] = []
        self._crowd: list[Hashable] = []
        self._expanded_in: dict[Hashable, int] = {}
        self._open = OpenList(self._g, self._h, self._config.layer)
        self._crowding = self._config.crowding
        self._forbidden: set[tuple[State, State]] = set()

    def run(
        self, time_limit: float = math.inf, observer: Callable[[Progress[State]], None] | None = None
    ) -> AnaStarResult[State]:
        """Search until nothing can improve, or a limit is reached.

        Args:
            time_limit: s.
            observer: told of every solution, and of progress now and then.
        """
        began = time.perf_counter()
        config, paths, expanded = self._config, [], []
        start = self._problem.start()
        reported = 0.0
        if self._problem.is_goal([start])[0]:
            paths.append(Path((start,), (), 0.0, 1.0, 0.0, 0))
            self._best = 0.0
        else:
            h = float(self._problem.heuristic([start])[0])
            self._improve(Edge(start, 0.0), 0.0, h, -1, self._problem.crowd([start])[0])
        stopped_by = "exhausted"
        while self._open:
            now = time.perf_counter() - began
            if now >= time_limit:
                stopped_by = "time"
            elif config.first_only and paths:
                stopped_by = "solution"
            elif config.max_expansions is not None and len(expanded) >= config.max_expansions:
                stopped_by = "expansions"
            elif len(self._state) >= config.max_states:
                stopped_by = "memory"
            if stopped_by != "exhausted":
                break
            node = self._next()
            goals = self._expand(node)
            if goals is None:
                self._open.add(node, self._priority(node))
                stopped_by = "time"
                break
            expanded.append(self._state[node])
            crowd = self._crowd[node]
            self._expanded_in[crowd] = self._expanded_in.get(crowd, 0) + 1
            if not paths:
                self._crowding = config.crowding * (1.0 + len(expanded) / config.patience)
            for edge in sorted(goals, key=lambda goal: goal.cost):
                path = self._reach(node, edge, began, len(expanded))
                if path is not None:
                    paths.append(path)
                    break
            if observer is not None and (now - reported >= config.report_interval or (paths and goals)):
                reported = now
                bound = paths[-1].bound if paths else math.inf
                observer(Progress(now, len(expanded), len(self._open), self._best, bound, expanded[-1]))
        seconds = time.perf_counter() - began
        return AnaStarResult(
            tuple(paths), stopped_by, self._lower_bound(), seconds, len(expanded), len(self._state), tuple(expanded)
        )

    def _expand(self, node: int) -> list[Edge[State]] | None:
        """Open the children of a node that may improve; returns the edges to goals instead of opening them.

        None where the problem had no time left.
        """
        g, state = self._g[node], self._state[node]
        edges = self._problem.expand(state, self._best - g)
        if not edges:
            return None if edges is None else []
        states = [edge.state for edge in edges]
        goals = []
        problem = self._problem
        for edge, h, is_goal, crowd in zip(
            edges, problem.heuristic(states), problem.is_goal(states), problem.crowd(states), strict=True
        ):
            if is_goal:
                goals.append(edge)
            else:
                self._improve(edge, g + edge.cost, float(h), node, crowd)
        return goals

    def _improve(self, edge: Edge[State], g: float, h: float, parent: int, crowd: Hashable) -> None:
        """Open a state, or reopen it, where the path to it is the cheapest so far and may lead to a better solution."""
        if not g + h < self._best or h == math.inf:
            return
        node = self._index.get(edge.state)
        if node is None:
            node = len(self._state)
            self._index[edge.state] = node
            self._state.append(edge.state)
            self._g.append(g)
            self._h.append(h)
            self._parent.append(parent)
            self._edge_cost.append(edge.cost)
            self._payload.append(edge.payload)
            self._delay.append(edge.delay)
            self._crowd.append(crowd)
        elif g < self._g[node]:
            self._g[node], self._parent[node] = g, parent
            self._edge_cost[node], self._payload[node] = edge.cost, edge.payload
            self._delay[node] = edge.delay
        else:
            return
        self._open.add(node, self._priority(node))

    def _priority(self, node: int) -> float:
        """Falls as e(s) rises."""
        g, h = self._g[node], self._h[node] + self._delay[node]
        if self._config.crowding > 0:
            h += self._crowding * self._expanded_in.get(self._crowd[node], 0)
        target = self._best if self._best < math.inf else self._config.initial_cost
        if target == math.inf:
            return h
        margin = target - g
        return -margin / max(h, _TINY) if margin > 0 else -margin * h  # second case: only before a solution

    def _next(self) -> int:
        """Close and return the node to expand."""
        if self._config.epsilon > 0 and self._rng.random() < self._config.epsilon:
            return self._open.take_random(self._rng, self._priority)
        return self._open.take_best(self._priority)

    def _reach(self, node: int, edge: Edge[State], began: float, expansions: int) -> Path[State] | None:
        """Take an edge to a goal if it improves on the best solution and the judge agrees."""
        if not self._g[node] + edge.cost < self._best:
            return None
        states, payloads, cost = self._trail(node)
        if self._judge is not None:
            key = (self._state[node], edge.state)
            if key in self._forbidden:
                return None
            judged = self._judge(states, payloads, edge)
            if judged is None:
                self._forbidden.add(key)
                self._refuse(node, edge)
                return None
            edge = judged
        cost += edge.cost
        if not cost < self._best:
            return None
        seconds = time.perf_counter() - began
        self._best = cost
        self._crowding = self._config.crowding
        bound = cost / max(self._lower_bound(), _TINY) if cost > 0 else 1.0
        self._prune()
        return Path((*states, edge.state), (*payloads, edge.payload), cost, bound, seconds, expansions)

    def _trail(self, node: int) -> tuple[list[State], list[Any], float]:
        """States from the start to a node, payloads between them and the sum of the edge costs.

        The sum may be less than g: an ancestor may have reopened since.
        """
        states: list[State] = []
        payloads: list[Any] = []
        cost = 0.0
        while node >= 0:
            states.append(self._state[node])
            payloads.append(self._payload[node])
            cost += self._edge_cost[node]
            node = self._parent[node]
        return states[::-1], payloads[-2::-1], cost

    def _refuse(self, node: int, edge: Edge[State]) -> None:
        """Open a goal at which the judge would not end, as a state on the way to another one."""
        h = float(self._problem.heuristic([edge.state])[0])
        crowd = self._problem.crowd([edge.state])[0]
        later = edge._replace(delay=edge.delay + self._config.refusal)
        self._improve(later, self._g[node] + edge.cost, h, node, crowd)

    def _lower_bound(self) -> float:
        """Least g + h of the open states, or G: no path costs less.

        G over it is never above ANA*'s own bound max e(s), since G <= g + e h <= e (g + h) for e >= 1.
        """
        return min(self._best, min((self._g[node] + self._h[node] for node in self._open), default=math.inf))

    def _prune(self) -> None:
        """Close what cannot improve on the new G and sort the rest by the new e."""
        self._open.reset([n for n in self._open if self._g[n] + self._h[n] < self._best], self._priority)
