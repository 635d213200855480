"""The solver of whole sequences and the reference that it is held against; nothing else knows which they are."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.build import initial_com, sequence_problem
from toolkit.centroidal.layout import Landing
from toolkit.centroidal.problem import CentroidalMotion, CentroidalProblem
from toolkit.centroidal.program import Program
from toolkit.centroidal.sequence import SequenceConfig, guess, optimise
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.pipeline.config import PipelineConfig
from toolkit.robot.model import RobotModel
from validation.reference import sequence as ipopt


@dataclass(frozen=True)
class Solution:
    """A motion and what it took.

    Attributes:
        motion: The motion.
        seconds: s; processor time of the process, everything from the contacts to the checked motion.
    """

    motion: CentroidalMotion
    seconds: float


def solve(
    robot: RobotModel, sequence: ContactSequence, room: np.ndarray | None = None, *, by_reference: bool = False
) -> Solution:
    """Optimise a sequence from rest to rest with the limits, margins and rests of the pipeline.

    Args:
        robot: The robot.
        sequence: The contacts.
        room: (transitions, 2, 2) m; see `toolkit.centroidal.sequence.optimise`. None: contacts stay as planned.
        by_reference: Whether Ipopt solves it, from the same guess.
    """
    config = PipelineConfig()
    began = time.process_time()
    schedule = ContactSchedule.of(sequence, **config.rests(robot.scale))
    com = initial_com(robot, sequence.start)
    if by_reference:
        motion = _by_reference(robot, schedule, com, config.sequence, room)
    else:
        motion = optimise(robot, schedule, com, np.zeros(3), config=config.sequence, room=room)
    return Solution(motion, time.process_time() - began)


def _by_reference(
    robot: RobotModel, schedule: ContactSchedule, com: np.ndarray, config: SequenceConfig, room: np.ndarray | None
) -> CentroidalMotion:
    problem = sequence_problem(robot, schedule, com, np.zeros(3), config=config.problem)
    landings = None if room is None else _landings(problem, schedule, room)
    program = Program(problem, robot, config.body, config.regularisers, landings)
    return ipopt.solve(program, guess(program))


def _landings(problem: CentroidalProblem, schedule: ContactSchedule, room: np.ndarray) -> list[Landing]:
    """Where the feet may land, in the room of each transition's contact."""
    return [
        Landing(phase.swing, int(np.argmin(np.abs(problem.times - phase.start))), *room[phase.transition])
        for phase in schedule.phases
        if phase.swing is not None and phase.swing.is_foot
    ]
