"""The contact search as a graph for ANA*: states, the transitions out of them, and their costs (paper, Sec. V).

Where judging a transition takes long, transitions wait to be judged until they are the best to go on with. The graph
then has, between two states, one that stands for the transition not yet judged (`state.pack_pending`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.prediction.evaluator import TransitionBatch
from toolkit.search.anytime.graph import Edge
from toolkit.search.costs.delay import Delay
from toolkit.search.costs.edge_cost import EdgeCost
from toolkit.search.judging import Judging, Tally
from toolkit.search.moves.candidates import CandidateGenerator, Candidates, mean_feet
from toolkit.search.moves.reasons import Reason
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.search.states.contact_table import ContactTable
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import (
    CONTACTS,
    LAST,
    SIZE,
    TIMING,
    is_pending,
    origin_of,
    pack_pending,
    speed_of,
    unpack,
    unpack_all,
)

_CROWD, _PACE = 0.1, 0.25  # m, m/s for a body of the usual size (`toolkit.robot.scale`); states of a crowd differ less


@dataclass(frozen=True)
class Parts:
    """Parts of a contact search.

    Attributes:
        table: Contacts.
        reader: Reads states.
        candidates: Makes the transitions out of a state, before they are judged.
        judging: Asks the judge of transitions.
        lazy: Whether they wait to be judged; see `Strategy`.
        cost: Costs of edges, and to the goal.
        delay: Delays of the states.
        tally: Counts the rejections.
        screen: The same screens for sequences that the search did not make.
    """

    table: ContactTable
    reader: StateReader
    candidates: CandidateGenerator
    judging: Judging
    lazy: bool
    cost: EdgeCost
    delay: Delay
    tally: Tally
    screen: SequenceScreen


class ContactProblem:
    """Graph of one search; see `search.anytime.graph.SearchProblem`. Edge payloads are (objective, timing index).

    Args:
        parts: The parts of the search; several graphs may share them.
        start: The state in which it begins.
    """

    def __init__(self, parts: Parts, start: bytes):
        self._parts, self._start = parts, start
        self._asked: Sequence[bytes] | None = None
        self._answer = (np.zeros((0, SIZE), np.int32), np.zeros((0, 3)), np.zeros(0))

    def start(self) -> bytes:
        """See `SearchProblem`."""
        return self._start

    def heuristic(self, states: Sequence[bytes]) -> np.ndarray:
        """See `SearchProblem` and `EdgeCost.to_go`."""
        return self._parts.cost.to_go(*self._seen(states)[1:])

    def is_goal(self, states: Sequence[bytes]) -> np.ndarray:
        """See `SearchProblem`."""
        judged = np.array([not is_pending(state) for state in states])
        return judged & self._parts.cost.at_goal(self._seen(states)[1])

    def crowd(self, states: Sequence[bytes]) -> list[tuple]:
        """See `SearchProblem`: states of similar speed with the mean of the feet in the same small square."""
        rows, centre, _ = self._seen(states)
        place = np.floor(centre[:, :2] / (self._parts.reader.scale.length * _CROWD))
        speed = np.floor(speed_of(rows) / _PACE)
        kind = [is_pending(state) for state in states]
        return list(map(tuple, np.column_stack([place, speed, kind]).astype(int).tolist()))

    def _seen(self, states: Sequence[bytes]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows of states, and `mean_feet` of them; kept for the next question about the same ones."""
        if states is not self._asked:
            rows = unpack_all(states)
            self._asked, self._answer = states, (rows, *mean_feet(self._parts.table, rows[:, CONTACTS]))
        return self._answer

    def expand(self, state: bytes, slack: float) -> list[Edge[bytes]] | None:
        """See `SearchProblem`: screens all children, then judges them in one query."""
        parts, row = self._parts, unpack([state])[0]
        if is_pending(state):
            candidate = self._pending(row)
            judged = parts.judging(row, candidate)
            return None if judged is None else self._edges(candidate, *judged, pending=True)
        candidates = parts.candidates.out_of(row[CONTACTS], int(row[LAST]))
        if candidates is None:
            return []
        h = parts.cost.to_go(candidates.centre, candidates.yaw)
        promising = parts.cost.least_of_edge(candidates) + h < slack
        parts.tally.rejected[Reason.COSTLY] += len(promising) - int(promising.sum())
        candidates = parts.candidates.timed(row[CONTACTS], candidates.select(promising))
        if not len(candidates):
            return []
        if parts.lazy:
            return self._postponed(row, candidates)
        judged = parts.judging(row, candidates)
        return None if judged is None else self._edges(candidates, *judged, pending=False)

    def _edges(
        self, candidates: Candidates, batch: TransitionBatch, codes: np.ndarray, *, pending: bool
    ) -> list[Edge[bytes]]:
        """Edges of the candidates that passed; pending ones have already paid the known part of the cost."""
        kept = np.flatnonzero(codes == 0)
        if not len(kept):
            return []
        candidates, objective = candidates.select(kept), batch.objective[kept]
        com, velocity = batch.com[kept], batch.com_velocity[kept]
        cost = self._parts.cost.dynamics * objective
        if not pending:
            cost = cost + self._parts.cost.known(candidates)
        states = self._parts.reader.states(candidates.contacts, candidates.limb, com, velocity)
        payloads = zip(objective.tolist(), candidates.timing.tolist(), strict=True)
        delay = self._parts.delay.of_states(candidates, com, velocity)
        return [Edge(*item) for item in zip(states, cost.tolist(), payloads, delay.tolist(), strict=True)]

    def _postponed(self, row: np.ndarray, candidates: Candidates) -> list[Edge[bytes]]:
        """Edges to pending states, which cost the known part."""
        com, velocity = self._parts.reader.motion(row)
        states = pack_pending(row, candidates.contacts, candidates.limb, candidates.timing)
        cost = self._parts.cost.known(candidates)
        delay = self._parts.delay.of_waiting(row[CONTACTS], com, velocity, candidates)
        return [Edge(*item) for item in zip(states, cost.tolist(), [None] * len(states), delay.tolist(), strict=True)]

    def _pending(self, row: np.ndarray) -> Candidates:
        """The one candidate of a pending state."""
        before, after = origin_of(row)[None, CONTACTS], row[None, CONTACTS]
        return Candidates.of(self._parts.table, before, row[LAST : LAST + 1], after, row[TIMING : TIMING + 1])
