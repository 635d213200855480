"""What a contact search returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from toolkit.contacts.sequence import ContactSequence


@dataclass(frozen=True)
class Solution:
    """A contact sequence that the search found.

    Attributes:
        sequence: start stance and transitions.
        cost: sum of edge costs.
        bound: upper bound on cost / optimal cost known when it was reported (inf where unknown).
        seconds: since the search began.
        com: (len(transitions) + 1, 3) m; predicted CoM at the start and after each transition.
        com_velocity: same shape, m/s.
        objective: (len(transitions),) predicted dynamics objective of each transition.
    """

    sequence: ContactSequence
    cost: float
    bound: float
    seconds: float
    com: np.ndarray
    com_velocity: np.ndarray
    objective: np.ndarray


@dataclass(frozen=True)
class SearchResult:
    """All solutions of one search, oldest first, and how it went.

    Attributes:
        solutions: in the order in which they were found; costs fall, but where the search began anew (`restart`).
        seconds: wall-clock of the search; heuristic_seconds: of building the heuristic (not in `seconds`).
        expansions: states expanded.
        exhausted: every reachable state was looked at.
        expanded: (k, 3) float; x, y, yaw of the mean feet of expanded states, in order (for display).
        reason: one line where there is no solution, else "".
        warning: one line where the judgements need a grain of salt, else "".
        hasty: so many of the first solutions were only to come soon; better ones follow.
    """

    solutions: tuple[Solution, ...]
    seconds: float
    heuristic_seconds: float
    expansions: int
    exhausted: bool
    expanded: np.ndarray = field(repr=False)
    reason: str
    warning: str = ""
    hasty: int = 0
