"""The solver of whole sequences and the reference that it is held against; nothing else knows which they are."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.sequence import optimise as reference
from toolkit.centroidal.sequence import optimise as solver
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.pipeline.config import PipelineConfig
from toolkit.robot.model import RobotModel

DISTINCT = reference is not solver
"""Whether there are two of them to compare."""


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
        by_reference: Whether the reference solves it.
    """
    config = PipelineConfig()
    began = time.process_time()
    schedule = ContactSchedule.of(sequence, initial_rest=config.initial_rest, final_rest=config.final_rest)
    com = initial_com(robot, sequence.start)
    optimise = reference if by_reference else solver
    motion = optimise(robot, schedule, com, np.zeros(3), config=config.sequence, room=room)
    return Solution(motion, time.process_time() - began)
