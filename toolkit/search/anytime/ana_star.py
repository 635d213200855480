"""Epsilon-greedy ANA*, for any graph: anytime search without a parameter for its greed.

ANA* keeps the cost G of the best solution and always expands the open state with the largest

    e(s) = (G - g(s)) / h(s)

that is, the one that most probably improves on G. With h admissible, a solution is at most max_open e(s) times as
costly as the best one. With probability epsilon a random open state is expanded instead, which leaves the guarantees
alone and helps out of cul-de-sacs. States reopen when a cheaper path to them is found. A search that runs to
exhaustion therefore ends with the cheapest path, whether or not h is consistent; one with a judge may miss it, as it
asks about no more than a few goals out of a state.

Beyond the paper, similar states can be made to wait for each other (`AnaStarConfig.crowding`). Each expansion in a
crowd adds to the h by which the other states of the crowd are ordered. Pruning and bounds keep the true h.

Reference:
    van den Berg, Shah, Huang, Goldberg: ANA*: Anytime Nonparametric A*, AAAI 2011; the paper, Sec. V.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, Generic

import numpy as np

from toolkit.search.anytime.graph import Edge, Fault, Judge, Path, Progress, SearchProblem, State
from toolkit.search.anytime.open_list import OpenList

_TINY = 1e-9  # divisor in place of h = 0
_LACKS = 10  # paths to goals, the last ones, whose costs tell what the judge adds at least
_REFUSALS = 4  # goals out of one state, the cheapest first, that are of no use until the others count as refused
_REFUSAL = 0.4  # units; added to h, for the order of expansion, where the judge refused a goal
_MAX_STATES = 700_000  # a search that knows so many states ends, to bound its memory
_REPORT_INTERVAL = 0.1  # s between calls of the observer, solutions apart


@dataclass(frozen=True)
class AnaStarConfig:
    """Settings of the search.

    Attributes:
        epsilon: Probability of expanding a random open state.
        layer: Width of the intervals of h, in units. A random draw takes the best state of a random interval; inf: any
            state.
        initial_cost: Stands for G before there is a solution, for the order of expansion only; nothing is pruned by it.
            inf expands the least h (depth first, fastest); a smaller value weighs the cost so far as well. It doubles
            as often as `patience` expansions, and then twice as many each time, have found no solution.
        crowding: Added to h for the order of expansion, in units, per state already expanded in the same crowd. While
            there is no solution it grows by the same amount with every `patience` expansions.
        patience: See `crowding`.
        max_expansions: Limit on the expansions; None: no limit.
        persistence: Multiple of that limit up to which a search without solution goes on where no other one follows.
        settled: Expansions in a row without a better solution that end a search once there is one; None: it goes on.
        first_only: Whether the first solution ends the search.
        unit: A cost that matters little beside that of a whole path, such as the least cost of a step's way.
    """

    epsilon: float = 0.1
    layer: float = math.inf
    initial_cost: float = math.inf
    crowding: float = 0.04
    patience: int = 200
    max_expansions: int | None = None
    persistence: int = 1
    settled: int | None = None
    first_only: bool = False
    unit: float = 1.0


@dataclass(frozen=True)
class AnaStarResult(Generic[State]):
    """Outcome of one search.

    Attributes:
        paths: Every solution, in the order in which they were found; their costs fall strictly.
        stopped_by: "exhausted" (nothing left that could improve), "time", "expansions", "settled", "memory" or
            "solution".
        lower_bound: No path can cost less, if h is admissible.
        seconds: Wall-clock time of the search.
        expansions: Number of states that were expanded.
        states: Number of states that became known.
        expanded: States in their order of expansion.
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
        problem: The graph.
        rng: Generator of the random expansions.
        config: Settings; the default ones where None.
        judge: Asked about every edge that reaches a goal. It returns that edge, or another edge in its place (with a
            different cost or payload), or None. After None the search goes on from there.
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
        self._best = math.inf  # cost of the best path
        self._bar = math.inf  # G: that cost, or what the path would have cost without the judge where that is more
        self._missing = -math.inf  # cost that the judge added to the last edge to a goal out of the same state
        self._lacks: deque[float] = deque(maxlen=_LACKS)  # the same as parts of the paths' costs, of any state
        self._assumed, self._doubled_at = self._config.initial_cost, self._config.patience
        self._index: dict[State, int] = {}
        self._edge: list[Edge[State]] = []  # by which each node was reached
        self._g: list[float] = []
        self._h: list[float] = []
        self._parent: list[int] = []
        self._crowd: list[Hashable] = []
        self._expanded_in: dict[Hashable, int] = {}
        self._open = OpenList(self._g, self._h, self._config.layer * self._config.unit)
        self._crowding = self._config.crowding
        self._forbidden: set[tuple[State, State]] = set()
        self._broken: set[tuple[int, int]] = set()  # edges between nodes that no path may take

    def run(
        self, time_limit: float = math.inf, observer: Callable[[Progress[State]], None] | None = None
    ) -> AnaStarResult[State]:
        """Search until nothing can improve, or a limit is reached.

        Args:
            time_limit: Wall-clock limit in s.
            observer: Told of every solution, and of progress every 0.1 s.
        """
        began = time.perf_counter()
        config, paths, expanded = self._config, [], []
        most = config.max_expansions
        start = self._problem.start()
        reported = 0.0
        if self._problem.is_goal([start])[0]:
            paths.append(Path((start,), (), 0.0, 1.0, 0.0, 0))
            self._best = self._bar = 0.0
        else:
            h = float(self._problem.heuristic([start])[0])
            self._improve(Edge(start, 0.0), 0.0, h, -1, self._problem.crowd([start])[0])
        stopped_by = "exhausted"
        while self._open:
            now = time.perf_counter() - began
            idle = len(expanded) - (paths[-1].expansions if paths else 0)
            if now >= time_limit:
                stopped_by = "time"
            elif config.first_only and paths:
                stopped_by = "solution"
            elif most is not None and len(expanded) >= (most if paths else config.persistence * most):
                stopped_by = "expansions"
            elif config.settled is not None and paths and idle >= config.settled:
                stopped_by = "settled"
            elif len(self._edge) >= _MAX_STATES:
                stopped_by = "memory"
            if stopped_by != "exhausted":
                break
            if not paths and len(expanded) >= self._doubled_at and self._assumed < math.inf:
                self._assumed, self._doubled_at = 2.0 * self._assumed, 2 * self._doubled_at
                self._prune()
            node = self._next()
            goals = self._expand(node)
            if goals is None:
                self._open.add(node, self._priority(node))
                stopped_by = "time"
                break
            expanded.append(self._edge[node].state)
            crowd = self._crowd[node]
            self._expanded_in[crowd] = self._expanded_in.get(crowd, 0) + 1
            if not paths:
                self._crowding = config.crowding * (1.0 + len(expanded) / config.patience)
            self._missing = -math.inf
            path = self._reach_one_of(node, goals, began, len(expanded))
            if path is not None:
                paths.append(path)
            if observer is not None and (now - reported >= _REPORT_INTERVAL or (paths and goals)):
                reported = now
                bound = paths[-1].bound if paths else math.inf
                observer(Progress(now, len(expanded), len(self._open), self._best, bound, expanded[-1]))
        seconds = time.perf_counter() - began
        return AnaStarResult(
            tuple(paths), stopped_by, self._lower_bound(), seconds, len(expanded), len(self._edge), tuple(expanded)
        )

    def _expand(self, node: int) -> list[Edge[State]] | None:
        """Open the children that may improve and return the edges to goals; None where the problem had no time left."""
        g, state = self._g[node], self._edge[node].state
        edges = self._problem.expand(state, self._bar - g)
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
        if not g + h < self._bar or h == math.inf:
            return
        node = self._index.get(edge.state)
        if node is None:
            node = len(self._edge)
            self._index[edge.state] = node
            self._edge.append(edge)
            self._g.append(g)
            self._h.append(h)
            self._parent.append(parent)
            self._crowd.append(crowd)
        elif g < self._g[node] and (parent, node) not in self._broken:
            self._g[node], self._parent[node], self._edge[node] = g, parent, edge
        else:
            return
        self._open.add(node, self._priority(node))

    def _priority(self, node: int) -> float:
        """A number that falls as e(s) rises."""
        g, h = self._g[node], self._h[node] + self._edge[node].delay
        if self._config.crowding > 0:
            h += self._crowding * self._config.unit * self._expanded_in.get(self._crowd[node], 0)
        target = self._bar if self._bar < math.inf else self._assumed
        if target == math.inf:
            return h
        margin = target - g
        return -margin / max(h, _TINY) if margin > 0 else -margin * h  # second case: only before a solution

    def _next(self) -> int:
        """Close and return the node to expand; one to which no path leads any more where nothing else is open."""
        while True:
            if self._config.epsilon > 0 and self._rng.random() < self._config.epsilon:
                node = self._open.take_random(self._rng, self._priority)
            else:
                node = self._open.take_best(self._priority)
            if not self._open or not self._cut_off(node):
                return node

    def _cut_off(self, node: int) -> bool:
        """Whether the path to a node takes a broken edge."""
        if self._broken:
            while node >= 0:
                if (self._parent[node], node) in self._broken:
                    return True
                node = self._parent[node]
        return False

    def _break(self, node: int, states: list[State], number: int) -> None:
        """Break the edge into the state with this number on the path of `states` to a node."""
        for _ in range(len(states) - 1 - number):
            node = self._parent[node]
        self._broken.add((self._parent[node], node))
        self._g[node] = math.inf  # other ways to it may be longer

    def _reach_one_of(self, node: int, goals: list[Edge[State]], began: float, expansions: int) -> Path[State] | None:
        """Take the cheapest edge to a goal out of a node that `_reach` takes, if any.

        Where the judge refuses the cheapest few, or makes them too dear, it seldom does better by another one: the
        fault is how the node was reached. The others are then opened, unasked, as states on the way to other goals.
        """
        refused = 0
        for edge in sorted(goals, key=lambda goal: goal.cost):
            if refused >= _REFUSALS:
                self._refuse(node, edge)
                continue
            path = self._reach(node, edge, began, expansions)
            if path is not None:
                return path
            if self._cut_off(node):
                return None  # the judge has found a fault on the way to all of them
            refused += 1
        return None

    def _reach(self, node: int, edge: Edge[State], began: float, expansions: int) -> Path[State] | None:
        """Take an edge to a goal if it improves on the best solution and the judge agrees.

        Edges to goals out of one state are judged in the order of their costs. What the judge added to the one before
        is assumed to be missing in the next one too, and the least part that it added to any of the last few in all.
        """
        cost = self._g[node] + edge.cost
        if not (cost < self._bar and cost + max(self._missing, cost * self._usual_lack()) < self._best):
            return None
        states, payloads, cost = self._trail(node)
        asked = edge
        if self._judge is not None:
            key = (self._edge[node].state, edge.state)
            if key in self._forbidden:
                return None
            judged = self._judge(states, payloads, edge)
            if isinstance(judged, Fault) and 0 < judged.state < len(states):
                self._break(node, states, judged.state)
                return None
            if judged is None or isinstance(judged, Fault):
                self._forbidden.add(key)
                self._refuse(node, edge)
                return None
            self._missing = judged.cost - edge.cost
            self._lacks.append(self._missing / max(self._g[node] + edge.cost, _TINY))
            edge = judged
        cost += edge.cost
        if not cost < self._best:
            return None
        seconds = time.perf_counter() - began
        self._best, self._bar = cost, max(cost, self._g[node] + asked.cost)
        self._crowding = self._config.crowding
        bound = cost / max(self._lower_bound(), _TINY) if cost > 0 else 1.0
        self._prune()
        return Path((*states, edge.state), (*payloads, edge.payload), cost, bound, seconds, expansions)

    def _usual_lack(self) -> float:
        """The least part of a path's cost that the judge added to any of the last few; 0 for too few."""
        least = min(self._lacks, default=0.0)
        return least if len(self._lacks) >= _LACKS // 2 else min(least, 0.0)

    def _trail(self, node: int) -> tuple[list[State], list[Any], float]:
        """States from the start to a node, payloads between them and the sum of the edge costs.

        The sum may be less than g, since an ancestor may have reopened in the meantime.
        """
        edges: list[Edge[State]] = []
        cost = 0.0
        while node >= 0:
            edges.append(self._edge[node])
            cost += edges[-1].cost
            node = self._parent[node]
        return [edge.state for edge in edges[::-1]], [edge.payload for edge in edges[-2::-1]], cost

    def _refuse(self, node: int, edge: Edge[State]) -> None:
        """Open a goal at which the judge would not end, as a state on the way to another one."""
        h = float(self._problem.heuristic([edge.state])[0])
        crowd = self._problem.crowd([edge.state])[0]
        later = edge._replace(delay=edge.delay + _REFUSAL * self._config.unit)
        self._improve(later, self._g[node] + edge.cost, h, node, crowd)

    def _lower_bound(self) -> float:
        """Least g + h of the open states, or G: no path costs less.

        G over it never exceeds ANA*'s own bound max e(s), since G <= g + e h <= e (g + h) for e >= 1.
        """
        return min(self._best, min((self._g[node] + self._h[node] for node in self._open), default=math.inf))

    def _prune(self) -> None:
        """Close what cannot improve on the new G and sort the rest by the new e."""
        self._open.reset([n for n in self._open if self._g[n] + self._h[n] < self._bar], self._priority)
