"""Labels in bulk: the judgement of `OptimiserEvaluator` in less than half of its time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal import fast
from toolkit.centroidal.arrays import ProblemArrays
from toolkit.centroidal.build import transition_problem
from toolkit.centroidal.residual import evaluate
from toolkit.contacts.category import category_of
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.learning.samples import Samples
from toolkit.learning.sensitivity import canonical, unknown_sensitivity
from toolkit.prediction.evaluator import TransitionBatch
from toolkit.prediction.features import TARGETS, encode
from toolkit.prediction.reach import within_reach
from toolkit.robot.model import RobotModel


@dataclass(frozen=True)
class Labels(TransitionBatch):
    """The optimiser's judgement of n transitions, and the derivatives of its objective.

    Attributes:
        sensitivity: The n derivatives in the world. One is None where the transition is infeasible, or where the CoM
            had to be moved within reach, so that a slightly different problem was solved.
    """

    sensitivity: tuple[fast.Sensitivity | None, ...]


def label(
    robot: RobotModel, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: list[ContactTransition]
) -> Labels:
    """Solve n transitions out of a stance; the compiled residual check confirms each that is feasible.

    Args:
        robot: The robot.
        stance: The stance before the transitions.
        com: (n, 3) Initial CoM of each transition in the world, in m.
        com_velocity: (n, 3) Initial CoM velocities in m/s.
        transitions: The transitions.

    Returns:
        The labels; the objective is infinite where a transition is infeasible.
    """
    n = len(transitions)
    feasible, objective = np.zeros(n, bool), np.full(n, np.inf)
    final_com, velocity = np.array(com, float), np.zeros((n, 3))
    sensitivity: list[fast.Sensitivity | None] = [None] * n
    start = within_reach(robot, stance, com)
    for row, transition in enumerate(transitions):
        problem = transition_problem(robot, stance, start[row], com_velocity[row], transition)
        found = fast.sensitive_wrenches(problem)
        if found is None:
            continue
        motion, derivatives = found
        residuals, costs = evaluate(ProblemArrays.of(problem), motion)
        if residuals.within():
            feasible[row], objective[row] = True, costs.sum()
            final_com[row], velocity[row] = motion.com[-1], motion.linear_momentum[-1] / problem.mass
            if (start[row] == com[row]).all():
                sensitivity[row] = derivatives
    return Labels(feasible, objective, final_com, velocity, tuple(sensitivity))


def samples_of(
    stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: list[ContactTransition], labels: Labels
) -> Samples:
    """Labelled transitions of ONE category by the same limb, as a data set stores them; see `label` for arguments."""
    n, category = len(transitions), category_of(stance, transitions[0])
    frame, features = encode(stance, com, com_velocity, transitions)
    good = labels.feasible
    targets = np.zeros((n, TARGETS), np.float32)
    targets[good, 0] = labels.objective[good]
    targets[good, 1:4] = frame.point(labels.com[good])
    targets[good, 4:7] = frame.vector(labels.com_velocity[good])
    known = unknown_sensitivity(category, n)
    for row, found in enumerate(labels.sensitivity):
        if found is not None:
            known[row] = canonical(frame, category, found)
    return Samples(features.astype(np.float32), good, targets, known)
