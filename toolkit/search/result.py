"""Results of a contact search: contact sequences, or the reason why none was found."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.sequence import ContactSequence
from toolkit.search.anytime.graph import Path
from toolkit.search.judging import Tally
from toolkit.search.moves.reasons import Reason
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import CONTACTS, is_pending, unpack
from toolkit.world.timing import Timing


@dataclass(frozen=True)
class Solution:
    """A contact sequence that the search found.

    Attributes:
        sequence: Start stance and transitions.
        cost: Cost of the sequence: the true one where the search has optimised it, else the predicted one.
        bound: Upper bound on cost / optimal cost that was known when it was found; inf where unknown.
        seconds: Time from the start of the search until it was found.
        com: (len(transitions) + 1, 3) m; predicted CoM at the start and after each transition.
        com_velocity: Same shape, m/s; predicted velocity of the CoM.
        objective: (len(transitions),) predicted dynamics objective of each transition; NaN where none is predicted.
        predicted: Sum of the edge costs as the search predicted them; NaN where no search has.
        plan: The sequence with its motion; None where the search has not optimised it.
    """

    sequence: ContactSequence
    cost: float
    bound: float
    seconds: float
    com: np.ndarray
    com_velocity: np.ndarray
    objective: np.ndarray
    predicted: float = np.nan
    plan: MotionPlan | None = field(default=None, repr=False)

    @classmethod
    def of(cls, reader: StateReader, path: Path[bytes]) -> Solution:
        """A path as a contact sequence with its predicted motion."""
        states = [state for state in path.states if not is_pending(state)]
        payloads = [payload for payload in path.payloads if payload is not None]
        rows = unpack(states)
        transitions = tuple(reader.transition(*step) for step in zip(states[1:], payloads, strict=True))
        arrived = next((each for payload in payloads[-1:] for each in payload[2:]), None)
        com, velocity = reader.motion(rows)
        return cls(
            sequence=ContactSequence(reader.stance(rows[0, CONTACTS]), transitions),
            cost=path.cost,
            bound=path.bound,
            seconds=path.seconds,
            com=com,
            com_velocity=velocity,
            objective=np.array([payload[0] for payload in payloads]),
            predicted=path.cost - (0.0 if arrived is None else arrived.missing),
            plan=None if arrived is None else arrived.plan,
        )


@dataclass(frozen=True)
class SearchResult:
    """All solutions of one search, oldest first, and how it went.

    Attributes:
        solutions: Solutions in the order in which they were found. Costs fall.
        seconds: Wall-clock time of the search.
        heuristic_seconds: Time for building the heuristic, not part of `seconds`.
        expansions: Number of states expanded.
        exhausted: Whether every reachable state was looked at.
        expanded: (k, 3) x m, y m, yaw rad; mean of the feet of the expanded states in their order, for display.
        reason: One line where there is no solution, else "".
        warning: One line where the judgements are less reliable, else "".
        slides: Whether no way leads over resting ground alone; see `CostConfig.where`.
        paced: Whether the planner chose the timing; see there.
        calmer: The calmest timing of every pace to come, the fastest pace first; empty where the pace is not the
            planner's to choose, or none is left.
        brisker: Whether a brisker pace is left, that of `calmer` = -1 in `ContactPlanner.search`.
        screen: The screens of the search, for sequences that are made from what it found; None where there are none.
    """

    solutions: tuple[Solution, ...]
    seconds: float
    heuristic_seconds: float
    expansions: int
    exhausted: bool
    expanded: np.ndarray = field(repr=False)
    reason: str
    warning: str = ""
    slides: bool = False
    paced: bool = False
    calmer: tuple[Timing, ...] = ()
    brisker: bool = False
    screen: SequenceScreen | None = field(default=None, repr=False, compare=False)


def feet_at(position: np.ndarray) -> str:
    """Where feet are whose mean is at (3,) m, in words."""
    x, y, z = position
    return f"with the feet at {x:.2f} {y:.2f} {z:.2f} m"


def reason_of(stopped_by: str, seconds: float, expansions: int, tally: Tally, dynamics: str, nearest: str) -> str:
    """One line on why there is no solution.

    Args:
        stopped_by: What ended the search; see `AnaStarResult`.
        seconds: How long it took.
        expansions: Number of states expanded.
        tally: What was rejected. Sequences that lead to the goal say more than single candidates do; of those, the
            choice of palms is not counted.
        dynamics: What it means that a judge rejects a transition.
        nearest: Where the search came nearest to the goal (`feet_at`).
    """
    how = {
        "exhausted": f"every stance that can be reached was looked at ({expansions})",
        "time": f"the time limit of {seconds:.3g} s was reached after {expansions} expansions; a longer one may help",
        "expansions": f"the limit of {expansions} expansions was reached; a higher one may help",
        "memory": f"the limit on memory was reached after {expansions} expansions",
    }[stopped_by]
    how = f"no contact sequence found: {how}"
    if tally.refused:
        last = f"; the last is {tally.refusal}" if tally.refusal else ""
        return f"{how}; sequences that lead to the goal, but have no motion: {tally.refused}{last}"
    rejected = np.where([reason.of_palm for reason in Reason], 0, tally.rejected)
    total = int(rejected.sum())
    if total == 0:
        return how
    order = np.argsort(-rejected, kind="stable")[:4]
    shares = ", ".join(
        f"{dynamics if code == Reason.DYNAMICS else Reason(code).words} {100 * rejected[code] / total:.0f} %"
        for code in order
        if rejected[code] > 0
    )
    return f"{how}; it came nearest to the goal {nearest}; candidates were rejected for: {shares}"
