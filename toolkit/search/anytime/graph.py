"""Graphs that are given by the edges out of each state, and what a search in them finds."""

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
        state: The state to which it leads.
        cost: Cost, >= 0.
        payload: Anything that the caller wants to find in the path.
        delay: Number >= 0, added to the state's h for the order of expansion. Pruning and bounds keep the true h.
    """

    state: State
    cost: float
    payload: Any = None
    delay: float = 0.0


class SearchProblem(Protocol[State]):
    """A graph, given by the edges out of each state."""

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
        """A key for each state; similar states share it."""
        ...


class Fault(NamedTuple):
    """Why a path to a goal is none: its edge into the state with this number, counted from the start of the path."""

    state: int


Judge = Callable[[Sequence[State], Sequence[Any], Edge[State]], Edge[State] | Fault | None]
"""Judges an edge to a goal; also gets the states before it and the payloads between them. See `AnaStar`.

It gives the edge with its true cost, None where the path may not end there, or the edge because of which it may not.
"""


@dataclass(frozen=True)
class Path(Generic[State]):
    """A solution.

    Attributes:
        states: States from the start to a goal.
        payloads: Payloads of the len(states) - 1 edges between them.
        cost: Sum of the edge costs.
        bound: The cost is at most this multiple of the least one; inf where the heuristic says nothing.
        seconds: Time from the start of the search until it was found.
        expansions: Number of expansions until it was found.
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
        seconds: Time since it began.
        expansions: Number of expansions so far.
        open: Number of states that wait.
        cost: Cost of the best solution; inf without one.
        bound: Bound of the best solution when it was found.
        state: The state that was expanded last.
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
