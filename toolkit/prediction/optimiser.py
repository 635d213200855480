"""OptimiserEvaluator: transitions judged by the centroidal optimiser itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.centroidal.sequence import SequenceConfig, optimise_transition
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.prediction.reach import within_reach
from toolkit.robot.model import RobotModel


class OptimiserEvaluator(TransitionEvaluator):
    """Solves the centroidal problem of every transition, which takes about four milliseconds each.

    Args:
        robot: The robot.
        config: Settings of the optimiser; the default ones where None.
    """

    costly = True

    def __init__(self, robot: RobotModel, *, config: SequenceConfig | None = None):
        self._robot, self._config = robot, config or SequenceConfig()

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
            motion = optimise_transition(self._robot, stance, com, com_velocity, transition, config=self._config)
            if motion.feasible:
                feasible[index], objective[index] = True, motion.objective
                final_com[index], velocity[index] = motion.com[-1], motion.linear_momentum[-1] / self._robot.mass
        return TransitionBatch(feasible, objective, final_com, velocity)
