"""Graphs that are given by what can be reached from where, and what a search in them finds."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

State = TypeVar("State", bound=Hashable)


class Edge(NamedTuple, Generic[State]):
    """A way out of a state.

    Attributes:
        state: where it leads.
        cost: >= 0.
        payload: anything the caller wants to find in the path.
        delay: >= 0; added to the state's h for the order of expansion: pruning and bounds keep the true h.
    """

    state: State
    cost: float
    payload: Any = None
    delay: float = 0.0


class SearchProblem(Protocol[State]):
    """A graph, given by what can be reached from where."""

    def start(self) -> State:
        """The state in which the search begins."""
        ...

    def expand(self, state: State, slack: float) -> Sequence[Edge[State]] | None:
        """Edges out of a state; None where there is no time left to find them.

        Edges with cost + heuristic >= slack cannot improve and may be left out.
        """
        ...

    def heuristic(self, states: Sequence[State]) -> Sequence[float] | np.ndarray:
        """Estimates >= 0 of the cost from each state to the goal; inf where it cannot be reached."""
        ...

    def is_goal(self, states: Sequence[State]) -> Sequence[bool] | np.ndarray:
        """Whether each state is a goal."""
        ...

    def crowd(self, states: Sequence[State]) -> Sequence[Hashable]:
        """What each state has in common with those like it."""
        ...


Judge = Callable[[Sequence[State], Sequence[Any], Edge[State]], Edge[State] | None]
"""Of an edge that reaches a goal, told the states before it and the payloads of the edges between them."""


@dataclass(frozen=True)
class Path(Generic[State]):
    """A solution.

    Attributes:
        states: from the start to a goal.
        payloads: of the len(states) - 1 edges between them.
        cost: sum of the edge costs.
        bound: the cost is at most so many times the least one, by what was known when it was found; inf where the
            heuristic says nothing.
        seconds: since the search began.
        expansions: before it was found.
    """

    states: tuple[State, ...]
    payloads: tuple[Any, ...]
    cost: float
    bound: float
    seconds: float
    expansions: int


@dataclass(frozen=True)
class Progress(Generic[State]):
    """How a search is going.

    Attributes:
        seconds: since it began.
        expansions: so far.
        open: states waiting.
        cost: of the best solution, inf without one.
        bound: of the best solution when it was found.
        state: expanded last.
    """

    seconds: float
    expansions: int
    open: int
    cost: float
    bound: float
    state: State

    def __str__(self) -> str:
        """One line for a terminal."""
        found = f"cost {self.cost:.1f} (at most {self.bound:.1f} x optimal)" if self.cost < math.inf else "none yet"
        return f"{self.expansions} expansions, {found}"
