"""Whether a search may end: after the last transition the robot stands at rest.

The paper asks that of the last transition alone, which a robot that arrives fast cannot do. Where it cannot, the last
few transitions and a moment on the final stance are optimised together, as they will be in the whole sequence.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.search.anytime.graph import Edge
from toolkit.search.costs.cost import CostConfig
from toolkit.search.moves.reasons import Reason
from toolkit.search.problem import ContactProblem
from toolkit.search.states.state import is_pending


class Arrival:
    """Judge of the last transition, for ANA*; the objective of the last edge is replaced by what coming to rest takes.

    Args:
        problem: the search.
        evaluator: judges one transition as the last one. Where it has a method `halt` (see `OptimiserEvaluator`),
            that judges several.
        cost: of edges.
        windows: numbers of transitions that are optimised together, in the order in which they are tried.
        rest: s on the final stance that are optimised with them.
    """

    def __init__(
        self,
        problem: ContactProblem,
        evaluator: TransitionEvaluator,
        cost: CostConfig,
        windows: Sequence[int] = (1, 3, 6),
        rest: float = 0.6,
    ):
        self._problem, self._evaluator, self._cost = problem, evaluator, cost
        self._windows, self._rest = windows, rest

    def __call__(self, states: Sequence[bytes], payloads: Sequence[Any], edge: Edge[bytes]) -> Edge[bytes] | None:
        """See `toolkit.search.anytime.graph.Judge`."""
        problem = self._problem
        last = problem.transition(edge.state, edge.payload)
        batch = self._evaluator.evaluate(*problem.origin(states[-1]), [last])
        objective = float(batch.objective[0]) if batch.feasible[0] else self._together(states, payloads, edge)
        if objective is None:
            problem.rejected[Reason.DYNAMICS] += 1
            return None
        cost = edge.cost + self._cost.dynamics * (objective - edge.payload[0])
        return edge._replace(cost=cost, payload=(objective, edge.payload[1]))

    def _together(self, states: Sequence[bytes], payloads: Sequence[Any], edge: Edge[bytes]) -> float | None:
        """What of the objective of coming to rest falls to the last edge; None where that is infeasible."""
        halt = getattr(self._evaluator, "halt", None)
        if halt is None:
            return None
        problem = self._problem
        judged = [payload for payload in payloads if payload is not None]
        passed = [state for state in states if not is_pending(state)]
        transitions = [problem.transition(edge.state, edge.payload)]
        transitions += [problem.transition(*step) for step in zip(passed[:0:-1], judged[::-1], strict=True)]
        for count in self._windows:
            if count > len(transitions):
                break
            objective = halt(*problem.origin(passed[-count]), transitions[count - 1 :: -1], self._rest)
            if objective is not None:
                return max(objective - sum(payload[0] for payload in judged[len(judged) - count + 1 :]), 0.0)
        return None
