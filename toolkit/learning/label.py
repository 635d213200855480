"""Labels: what each transition costs in the motion of its whole sequence, and the CoM's state after it there.

The motion is optimised as an executed plan's is, with the same weights, limits and rests, so the labels of a sequence
add up to the objective of what is executed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.centroidal.intervals import Intervals, intervals
from toolkit.centroidal.sequence import optimise
from toolkit.contacts.category import Category, category_of
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.learning.feasible import TransitionProblem
from toolkit.learning.samples import Samples
from toolkit.prediction.features import TARGETS, encode
from toolkit.robot.model import RobotModel

INITIAL_REST, FINAL_REST = 0.4, 1.0
"""Rests in s at the start and at the end of a labelled sequence, for a body of the usual size (`toolkit.robot.scale`);
those of executed plans."""


@dataclass(frozen=True)
class LabelledSequence:
    """A contact sequence with a feasible whole motion.

    Attributes:
        robot: The robot.
        sequence: The contacts and their timing.
        parts: The motion, cut at the ends of the transitions.
    """

    robot: RobotModel
    sequence: ContactSequence
    parts: Intervals

    @property
    def goal(self) -> np.ndarray:
        """(3,) m; mean of the feet at the end."""
        return self.sequence.stances[-1].mean_feet.position

    def problem(self, index: int) -> TransitionProblem:
        """One transition, from the state that the whole motion has at its beginning."""
        parts, sequence = self.parts, self.sequence
        com, velocity = parts.com[index], parts.com_velocity[index]
        return TransitionProblem(self.robot, sequence.stances[index], com, velocity, sequence.transitions[index])

    def outcome(self, index: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Objective of one transition, and CoM (3,) m and velocity (3,) m/s after it."""
        parts = self.parts
        return float(parts.objective[index]), parts.com[index + 1], parts.com_velocity[index + 1]


def label(robot: RobotModel, sequence: ContactSequence) -> LabelledSequence | None:
    """Optimise the motion of a whole sequence; None where none is feasible, or there are no transitions."""
    if not sequence.transitions:
        return None
    pace = robot.scale.time
    schedule = ContactSchedule.of(sequence, initial_rest=pace * INITIAL_REST, final_rest=pace * FINAL_REST)
    motion = optimise(robot, schedule, initial_com(robot, sequence.start), np.zeros(3))
    return LabelledSequence(robot, sequence, intervals(motion, schedule)) if motion.feasible else None


def sample_of(
    problem: TransitionProblem,
    feasible: bool,
    outcome: tuple[float, np.ndarray, np.ndarray] | None,
    goal: np.ndarray,
    world: int,
) -> tuple[Category, Samples]:
    """One judged transition as a data set stores it.

    Args:
        problem: The transition.
        feasible: Whether it is feasible.
        outcome: Objective, CoM (3,) m and velocity (3,) m/s after it, world frame; None where unknown.
        goal: (3,) m; mean of the feet at the end of its sequence, world frame.
        world: Number of the world.
    """
    stance, transition = problem.stance, problem.transition
    frame, features = encode(stance, problem.com, problem.com_velocity, [transition])
    targets = np.full((1, TARGETS), np.nan, np.float32)
    if outcome is not None:
        objective, com, velocity = outcome
        targets[0] = np.concatenate([[objective], frame.point(com), frame.vector(velocity)])
    samples = Samples(
        features.astype(np.float32),
        np.array([feasible]),
        targets,
        frame.point(goal)[None].astype(np.float32),
        np.array([world], np.int32),
    )
    return category_of(stance, transition), samples
