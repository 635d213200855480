"""Whether a search may end: after the last transition the robot stands at rest.

The paper asks this of the last transition alone, but a robot that arrives fast cannot do it. In that case the last few
transitions and a moment on the final stance are optimised together, as they will be in the whole sequence.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.search.anytime.graph import Edge
from toolkit.search.costs.edge_cost import EdgeCost
from toolkit.search.judging import Tally
from toolkit.search.moves.reasons import Reason
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import is_pending

_WINDOWS = (1, 3, 6)  # transitions that are optimised together, in the order in which they are tried
_REST = 0.6  # s on the final stance that are optimised with them


class Arrival:
    """Judge of the last transition, for ANA*; the objective of the last edge becomes the cost of coming to rest.

    The evaluator judges one transition as the last one, and whether several come to rest; `tally` counts rejections.
    """

    def __init__(self, evaluator: TransitionEvaluator, reader: StateReader, cost: EdgeCost, tally: Tally):
        self._evaluator, self._reader, self._cost, self._tally = evaluator, reader, cost, tally

    def __call__(self, states: Sequence[bytes], payloads: Sequence[Any], edge: Edge[bytes]) -> Edge[bytes] | None:
        """See `toolkit.search.anytime.graph.Judge`."""
        last = self._reader.transition(edge.state, edge.payload)
        batch = self._evaluator.evaluate(*self._reader.origin(states[-1]), [last])
        objective = float(batch.objective[0]) if batch.feasible[0] else self._together(states, payloads, edge)
        if objective is None:
            self._tally.rejected[Reason.DYNAMICS] += 1
            return None
        cost = edge.cost + self._cost.dynamics * (objective - edge.payload[0])
        return edge._replace(cost=cost, payload=(objective, edge.payload[1]))

    def _together(self, states: Sequence[bytes], payloads: Sequence[Any], edge: Edge[bytes]) -> float | None:
        """The last edge's part of the objective of coming to rest; None where that is infeasible."""
        judged = [payload for payload in payloads if payload is not None]
        passed = [state for state in states if not is_pending(state)]
        transitions = [self._reader.transition(edge.state, edge.payload)]
        transitions += [self._reader.transition(*step) for step in zip(passed[:0:-1], judged[::-1], strict=True)]
        for count in _WINDOWS:
            if count > len(transitions):
                break
            start = self._reader.origin(passed[-count])
            objective = self._evaluator.halt(*start, transitions[count - 1 :: -1], _REST)
            if objective is not None:
                return max(objective - sum(payload[0] for payload in judged[len(judged) - count + 1 :]), 0.0)
        return None
