"""What a contact search found, in the words of contacts; or why it found nothing."""

from __future__ import annotations

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from toolkit.search.anytime.graph import Path
from toolkit.search.moves.reasons import Reason
from toolkit.search.problem import ContactProblem
from toolkit.search.result import Solution
from toolkit.search.states.state import COM, VELOCITY, is_pending, unpack


def solution_of(problem: ContactProblem, path: Path[bytes]) -> Solution:
    """A path as a contact sequence with its predicted motion."""
    states = [state for state in path.states if not is_pending(state)]
    payloads = [payload for payload in path.payloads if payload is not None]
    rows = unpack(states)
    steps = list(zip(states[1:], payloads, strict=True))
    return Solution(
        sequence=ContactSequence(
            problem.stance(states[0]), tuple(problem.transition(state, payload) for state, payload in steps)
        ),
        cost=path.cost,
        bound=path.bound,
        seconds=path.seconds,
        com=rows[:, COM] / 1000.0,
        com_velocity=rows[:, VELOCITY] / 1000.0,
        objective=np.array([payload[0] for payload in payloads]),
    )


def reason_of(stopped_by: str, seconds: float, expansions: int, rejected: np.ndarray, dynamics: str) -> str:
    """One line on why there is no solution and what rejected most candidates, the choice of palms apart."""
    how = {
        "exhausted": f"every stance that can be reached was looked at ({expansions})",
        "time": f"the time limit of {seconds:.3g} s was reached after {expansions} expansions; a longer one may help",
        "expansions": f"the limit of {expansions} expansions was reached; a higher one may help",
        "memory": f"the limit on memory was reached after {expansions} expansions",
    }[stopped_by]
    rejected = np.where([reason.of_palm for reason in Reason], 0, rejected)
    total = int(rejected.sum())
    if total == 0:
        return f"no contact sequence found: {how}"
    order = np.argsort(-rejected, kind="stable")[:4]
    shares = ", ".join(
        f"{dynamics if code == Reason.DYNAMICS else Reason(code).words} {100 * rejected[code] / total:.0f} %"
        for code in order
        if rejected[code] > 0
    )
    return f"no contact sequence found: {how}; candidates were rejected for: {shares}"
