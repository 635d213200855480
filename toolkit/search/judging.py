"""Queries of a search to a judge of transitions, as long as there is time; checks what the limbs reach as well."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.search.moves.candidates import Candidates
from toolkit.search.moves.reach_check import ReachCheck
from toolkit.search.moves.reasons import Reason
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import CONTACTS, origin_of


@dataclass
class Tally:
    """Counts of one search.

    Attributes:
        rejected: (len(Reason),) int; rejected candidates by reason.
        untrained: Number of transitions outside what their judge was trained for.
        refused: Number of sequences that lead to the goal, but have no motion.
        refusal: Why the last of them has none, and where; "" where that is unknown.
    """

    rejected: np.ndarray = field(default_factory=lambda: np.zeros(len(Reason), np.int64))
    untrained: int = 0
    refused: int = 0
    refusal: str = ""


class Judging:
    """Asks one judge on behalf of one search.

    Args:
        evaluator: The judge.
        reader: Reads the search's states.
        reach: Checks what legs and arms reach.
        tally: Counts the rejections.
        deadline: Time in s on the clock of `time.perf_counter`; no query that would end later is begun.
    """

    def __init__(
        self,
        evaluator: TransitionEvaluator,
        reader: StateReader,
        reach: ReachCheck,
        tally: Tally,
        deadline: float,
    ):
        self._evaluator, self._reader, self._reach = evaluator, reader, reach
        self._tally, self._deadline = tally, deadline
        self._pace = 0.0  # s per transition of the last query

    def __call__(self, row: np.ndarray, candidates: Candidates) -> tuple[TransitionBatch, np.ndarray] | None:
        """Judge n candidates out of the state of a row, or the one candidate of a pending state.

        Returns:
            The judgement, and codes (n,), 0 where the limbs reach as well; None where there is no time left.
        """
        contacts, (com, velocity) = origin_of(row)[CONTACTS], self._reader.motion(row)
        transitions = self._reader.transitions(candidates.limb, candidates.number, candidates.timing)
        stance = self._reader.stance(contacts)
        began = time.perf_counter()
        if began + self._pace * len(transitions) > self._deadline:
            return None
        batch = self._evaluator.evaluate(stance, com, velocity, transitions)
        self._pace = (time.perf_counter() - began) / len(transitions)
        codes = np.where(batch.feasible, 0, Reason.DYNAMICS)
        rows = np.flatnonzero(batch.feasible)
        if len(rows):
            chosen = candidates.select(rows)
            codes[rows] = self._reach.codes(contacts, com, velocity, chosen, batch.com[rows], batch.com_velocity[rows])
        self._tally.rejected += np.bincount(codes, minlength=len(Reason))
        self._tally.rejected[0] = 0
        self._tally.untrained += batch.untrained
        return batch, codes
