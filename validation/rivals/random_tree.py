"""A rapidly exploring random tree over the moves of the search.

Reference:
    LaValle: Rapidly-exploring random trees, 1998.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from toolkit.search.anytime.graph import Edge, SearchProblem, State
from validation.rivals.best_first import Accept, Found, Limits, Tree

_TO_GOAL = 0.1  # probability of a sample at the goal


def random_tree(
    problem: SearchProblem[State],
    place: Callable[[Sequence[State]], np.ndarray],
    box: np.ndarray,
    goal: np.ndarray,
    accept: Accept[State],
    rng: np.random.Generator,
    limits: Limits,
) -> Found[State]:
    """Grow a tree by the edge that leads from the state nearest to a random point nearest to that point.

    Args:
        problem: The graph; its heuristic is not asked, except for dead ends.
        place: (n, 2) m; where states are.
        box: (2, 2) m; corners of the points that are drawn.
        goal: (2,) m.
        accept: Asked about every path to a goal; the tree grows on after a refusal.
        rng: Draws the points.
        limits: When to give up.
    """
    began, start = time.perf_counter(), problem.start()
    tree, states, expansions = Tree(start), [start], 0
    places = np.array(place([start]))
    waiting: dict[State, list[Edge[State]]] = {}
    spent = np.zeros(1, bool)
    stopped = "exhausted"
    if problem.is_goal([start])[0] and accept([start], []):
        return Found((start,), (), 0.0, 0, time.perf_counter() - began, "solution")
    while not spent.all():
        if expansions >= limits.expansions or time.perf_counter() - began > limits.seconds:
            stopped = "expansions" if expansions >= limits.expansions else "time"
            break
        point = goal if rng.random() < _TO_GOAL else rng.uniform(*box)
        nearest = int(np.argmin(np.where(spent, math.inf, ((places - point) ** 2).sum(1))))
        state = states[nearest]
        if state not in waiting:
            edges = problem.expand(state, math.inf)
            if edges is None:
                stopped = "time"
                break
            expansions += 1
            waiting[state] = _leading_on(problem, edges)
        left = [edge for edge in waiting[state] if edge.state not in tree.g]
        if not left:
            spent[nearest], waiting[state] = True, []
            continue
        ends = np.array(place([edge.state for edge in left]))
        chosen = int(np.argmin(((ends - point) ** 2).sum(1)))
        edge = left.pop(chosen)
        waiting[state] = left
        tree.enter(edge.state, tree.g[state] + edge.cost, state, edge.payload)
        states.append(edge.state)
        places, spent = np.vstack([places, ends[chosen]]), np.append(spent, False)
        if problem.is_goal([edge.state])[0]:
            way, payloads = tree.way(edge.state)
            if accept(way, payloads):
                seconds = time.perf_counter() - began
                cost = tree.g[edge.state]
                return Found(tuple(way), tuple(payloads), cost, expansions, seconds, "solution")
    return Found((), (), math.inf, expansions, time.perf_counter() - began, stopped)


def _leading_on(problem: SearchProblem[State], edges: Sequence[Edge[State]]) -> list[Edge[State]]:
    """The edges to states from which the goal may be reached."""
    if not edges:
        return []
    h = problem.heuristic([edge.state for edge in edges])
    return [edge for edge, value in zip(edges, h, strict=True) if value < math.inf]
