"""What a feasible transition is, and the judge of it.

A transition is feasible if a motion of it exists alone, whatever comes after it: from the CoM state at its beginning,
within the contacts' cones and the limits of legs and arms, to some state of the final set. The final set holds all
velocities, and those CoMs in the box of `ProblemConfig.moving_half_size` at which legs and arms reach all contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.sequence import optimise_transition
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.prediction.reach import within_reach
from toolkit.robot.model import RobotModel


@dataclass(frozen=True)
class TransitionProblem:
    """One transition from a given state; world frame.

    Attributes:
        robot: The robot.
        stance: The contacts before the transition.
        com: (3,) m; CoM at its beginning.
        com_velocity: (3,) m/s; its velocity.
        transition: The transition.
    """

    robot: RobotModel
    stance: Stance
    com: np.ndarray
    com_velocity: np.ndarray
    transition: ContactTransition


def transition_feasible(problem: TransitionProblem) -> bool:
    """Whether a transition is feasible."""
    robot, stance = problem.robot, problem.stance
    com = within_reach(robot, stance, problem.com[None])[0]
    return optimise_transition(robot, stance, com, problem.com_velocity, problem.transition).feasible
