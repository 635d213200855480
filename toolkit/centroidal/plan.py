"""MotionPlan: a contact sequence with the motion that was optimised for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.sequence import SequenceConfig, optimise
from toolkit.contacts.room import RoomConfig, landing_room, moved_sequence
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.robot.model import RobotModel
from toolkit.world.world import World

FRICTION_ROUNDING = 0.01  # smaller differences of the friction factor do not decide between motions


@dataclass(frozen=True)
class MotionPlan:
    """Contacts and centroidal motion of a robot in a world.

    Attributes:
        robot: The robot.
        world: The world.
        sequence: The contacts, as in the motion.
        schedule: The times of the contacts.
        motion: The motion of CoM, momentum and contact forces, with its verdict.
    """

    robot: RobotModel
    world: World
    sequence: ContactSequence
    schedule: ContactSchedule
    motion: CentroidalMotion


def plan_motion(
    robot: RobotModel,
    world: World,
    sequence: ContactSequence,
    *,
    initial_rest: float,
    final_rest: float,
    landing: RoomConfig | None,
    config: SequenceConfig,
) -> MotionPlan:
    """Optimise the motion of a contact sequence from rest to rest.

    Where the planned contacts do not allow the wanted margins, feet may land elsewhere on their surfaces; the plan then
    has its contacts where they landed.

    Args:
        robot: The robot.
        world: The world, for the surfaces and the goal.
        sequence: The contacts, as the search proposes them.
        initial_rest: s at rest before the first transition.
        final_rest: s at rest after the last transition.
        landing: How far feet may land from where the sequence has them; None for not at all.
        config: Settings of the optimiser.

    Returns:
        The plan; `motion.feasible` says whether there is a motion.
    """
    schedule = ContactSchedule.of(sequence, initial_rest=initial_rest, final_rest=final_rest)
    com, rest = initial_com(robot, sequence.start), np.zeros(3)
    motion = optimise(robot, schedule, com, rest, config=config)
    plan = MotionPlan(robot, world, sequence, schedule, motion)
    if landing is None or (motion.feasible and motion.kept is None):
        return plan
    room = landing_room(robot, world.surfaces, sequence, landing, world.goal)
    if not room.any():
        return plan
    moved = optimise(robot, schedule, com, rest, config=config, room=room)
    tighter = moved.solved.margins.friction < motion.solved.margins.friction + FRICTION_ROUNDING
    if not moved.feasible or (motion.feasible and not tighter):
        return plan
    sequence = moved_sequence(sequence, schedule, moved.problem.times, moved.solved.position)
    schedule = ContactSchedule.of(sequence, initial_rest=initial_rest, final_rest=final_rest)
    return MotionPlan(robot, world, sequence, schedule, moved)
