"""What a feasible transition is, and the judge of it.

A transition is feasible if a motion of it exists alone, whatever comes after it: from the CoM state at its beginning,
within the contacts' cones and the limits of legs and arms, to some state of the final set. The final set holds all
velocities, and those CoMs in the box of `ProblemConfig.moving_half_size` at which legs and arms reach all contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal import fast
from toolkit.centroidal.build import ProblemConfig, transition_problem
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.pose import rotation_about_z
from toolkit.physics.leg import PLANNED, ReachMargins, leg_clearances, leg_posture
from toolkit.prediction.reach import SLACK, within_reach
from toolkit.robot.model import RobotModel

_GRID = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * 3, indexing="ij"), -1).reshape(-1, 3)  # of the final box
_AT_START = ReachMargins(length=-SLACK, ankle=-0.02, hip=-0.02)  # a given CoM may be this far out of reach, by rounding
_AT_END = ReachMargins(ankle=0.0)


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
    """Whether a transition is feasible.

    Legs and arms are asked at both ends alone, and between them only for their greatest length. So what is called
    infeasible is, while a motion that needs the limits in between may be missing.
    """
    robot, stance, transition = problem.robot, problem.stance, problem.transition
    if not _reached(robot, stance, problem.com[None], _AT_START)[0]:
        return False
    after = transition.apply(stance)
    feet = after.mean_feet
    box = np.array(ProblemConfig().moving_half_size)
    ends = feet.position + [0.0, 0.0, robot.com_height] + (box * _GRID) @ rotation_about_z(feet.yaw).T
    if not _reached(robot, after, ends, _AT_END).any():
        return False
    com = within_reach(robot, stance, problem.com[None])[0]
    return fast.solve(transition_problem(robot, stance, com, problem.com_velocity, transition)).feasible


def _reached(robot: RobotModel, stance: Stance, com: np.ndarray, margins: ReachMargins) -> np.ndarray:
    """(n,) bool; whether legs and arms reach all contacts of a stance with the CoMs (n, 3) m."""
    n, yaw = len(com), stance.mean_feet.yaw
    good = np.ones(n, bool)
    for contact in stance.contacts:
        position, rotation = contact.pose.position, contact.pose.rotation
        if contact.limb.is_foot:
            leg = robot.legs[contact.limb]
            posture = leg_posture(leg, com, np.full(n, yaw), np.tile(position, (n, 1)), np.tile(rotation, (n, 1, 1)))
            clearances = leg_clearances(leg, posture, margins)
            good &= np.all([clearances[limit.name] >= 0.0 for limit in PLANNED], axis=0)
        else:
            arm = robot.arms[contact.limb]
            length = np.linalg.norm(com + rotation_about_z(yaw) @ arm.shoulder_in_com - position, axis=1)
            good &= (length >= arm.min_reach + margins.length) & (length <= arm.max_reach - margins.length)
    return good
