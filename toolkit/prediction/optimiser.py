"""OptimiserEvaluator: transitions judged by the centroidal optimiser itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.centroidal import fast
from toolkit.centroidal.build import sequence_problem, transition_problem
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.prediction.reach import within_reach
from toolkit.robot.model import RobotModel


class OptimiserEvaluator(TransitionEvaluator):
    """Solves the centroidal problem of every transition, which takes about a millisecond each.

    Args:
        robot: The robot.
        final_at_rest: Whether the CoM must be at rest after the transition, as at the goal.
    """

    costly = True

    def __init__(self, robot: RobotModel, *, final_at_rest: bool = False):
        self._robot, self._final_at_rest = robot, final_at_rest

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """Judge transitions; see `TransitionEvaluator`.

        An infeasible transition has an infinite objective and no motion. A CoM that is out of reach by no more than the
        errors of rounding and prediction is moved to where it is within reach first (`within_reach`).
        """
        n = len(transitions)
        feasible, objective = np.zeros(n, bool), np.full(n, np.inf)
        final_com, velocity = np.tile(np.asarray(com, float), (n, 1)), np.zeros((n, 3))
        com = within_reach(self._robot, stance, np.asarray(com, float)[None])[0]
        for index, transition in enumerate(transitions):
            problem = transition_problem(
                self._robot, stance, com, com_velocity, transition, final_at_rest=self._final_at_rest
            )
            motion = fast.solve(problem)
            if motion.feasible:
                feasible[index], objective[index] = True, motion.objective
                final_com[index], velocity[index] = motion.com[-1], motion.linear_momentum[-1] / problem.mass
        return TransitionBatch(feasible, objective, final_com, velocity)

    def halt(
        self,
        stance: Stance,
        com: np.ndarray,
        com_velocity: np.ndarray,
        transitions: Sequence[ContactTransition],
        rest: float,
    ) -> float | None:
        """Objective of coming to rest; see `TransitionEvaluator`."""
        com = within_reach(self._robot, stance, np.asarray(com, float)[None])[0]
        schedule = ContactSchedule.of(ContactSequence(stance, tuple(transitions)), final_rest=rest)
        motion = fast.solve(sequence_problem(self._robot, schedule, com, com_velocity))
        return motion.objective if motion.feasible else None
