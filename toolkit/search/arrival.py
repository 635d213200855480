"""Whether a search may end: the whole sequence has a motion that ends at rest, and what that motion costs.

So the cost of a solution is the true one, and a search goes on until it finds what is truly cheaper.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.sequence import ContactSequence
from toolkit.search.anytime.graph import Edge, Fault
from toolkit.search.costs.edge_cost import EdgeCost
from toolkit.search.judging import Tally
from toolkit.search.moves.exclusion import Blame
from toolkit.search.moves.reasons import Reason
from toolkit.search.result import feet_at
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import is_pending

Finish = Callable[[ContactSequence], MotionPlan]
"""The motion of a whole sequence from rest to rest, with its verdict."""


class Arrived(NamedTuple):
    """What the last payload of a path holds beside objective and timing where its sequence was optimised.

    Attributes:
        missing: Cost that the edges predict too little.
        plan: The sequence with its motion.
    """

    missing: float
    plan: MotionPlan


class Arrival:
    """Judge of the last transition, for ANA*; its cost becomes what is missing to the true cost of the sequence.

    Args:
        finish: Optimises whole sequences.
        reader: Reads states.
        cost: Costs of the search.
        tally: Counts rejections, and sequences without a motion.
        blame: Transitions that the search avoids; those to which failures lead again and again are added.
    """

    def __init__(
        self,
        finish: Finish,
        reader: StateReader,
        cost: EdgeCost,
        tally: Tally,
        blame: Blame,
    ):
        self._finish, self._reader, self._cost, self._tally = finish, reader, cost, tally
        self._blame = blame

    def __call__(
        self, states: Sequence[bytes], payloads: Sequence[Any], edge: Edge[bytes]
    ) -> Edge[bytes] | Fault | None:
        """See `toolkit.search.anytime.graph.Judge`."""
        judged = [payload for payload in payloads if payload is not None]
        passed = [state for state in states if not is_pending(state)]
        ends = [*passed[1:], edge.state]
        transitions = [self._reader.transition(*step) for step in zip(ends, [*judged, edge.payload], strict=True)]
        sequence = ContactSequence(self._reader.origin(passed[0])[0], tuple(transitions))
        at = self._blame.first_in(sequence)
        plan = self._finish(sequence) if at is None else None
        if plan is None or not plan.motion.feasible:
            self._tally.rejected[Reason.DYNAMICS] += 1
            if plan is not None:
                failure = plan.motion.failure
                at = None if failure is None else failure.transition
                self._blame.add(sequence, at)
                self._tally.refused += 1
                self._tally.refusal = "" if failure is None else failure.reason
                if at is not None:
                    self._tally.refusal += f", {feet_at(sequence.stances[at].mean_feet.position)}"
            return None if at is None or at + 1 >= len(passed) else Fault(list(states).index(passed[at + 1]))
        predicted = sum(payload[0] for payload in judged) + edge.payload[0]
        missing = self._cost.dynamics * (plan.motion.objective - predicted)
        return edge._replace(cost=edge.cost + missing, payload=(*edge.payload, Arrived(missing, plan)))
