"""MotionPlan: a contact sequence with the motion that was optimised for it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.sequence import SequenceConfig, optimise
from toolkit.centroidal.surroundings import Surroundings
from toolkit.contacts.room import RoomConfig, landing_room, moved_sequence
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.seats import laid
from toolkit.contacts.sequence import ContactSequence
from toolkit.robot.model import RobotModel
from toolkit.world.world import World

_LEAN_ROUNDING = 1e-3  # rad
FRICTION_ROUNDING = 0.01  # smaller differences of the friction factor do not decide between motions


@dataclass(frozen=True)
class MotionConfig:
    """Settings of the motion of a contact sequence from rest to rest.

    Attributes:
        initial_rest, final_rest: s at rest before the first transition and after the last one.
        landing: How far feet may land from where the sequence has them; None for not at all.
        optimiser: Settings of the optimiser.
    """

    initial_rest: float
    final_rest: float
    landing: RoomConfig | None = None
    optimiser: SequenceConfig = field(default_factory=SequenceConfig)


@dataclass(frozen=True)
class MotionPlan:
    """Contacts and centroidal motion of a robot in a world.

    Attributes:
        robot: The robot.
        world: The world.
        sequence: The contacts, as in the motion.
        schedule: The times of the contacts.
        motion: The motion of CoM, momentum and contact forces, with its verdict.
        config: The settings with which `plan_motion` made it; None where something else did.
    """

    robot: RobotModel
    world: World
    sequence: ContactSequence
    schedule: ContactSchedule
    motion: CentroidalMotion
    config: MotionConfig | None = field(default=None, kw_only=True)


def plan_motion(
    robot: RobotModel,
    world: World,
    sequence: ContactSequence,
    config: MotionConfig,
    surroundings: Surroundings | None = None,
) -> MotionPlan:
    """Optimise the motion of a contact sequence from rest to rest.

    Where the planned contacts do not allow the wanted margins, feet may land elsewhere on their surfaces; the plan then
    has its contacts where they landed.

    Args:
        robot: The robot.
        world: The world, for the surfaces and the goal.
        sequence: The contacts, as the search proposes them.
        config: Settings.
        surroundings: What limits where the body may be; None: nothing does.

    Returns:
        The plan; `motion.feasible` says whether there is a motion.
    """
    landing, optimiser = config.landing, config.optimiser
    schedule = ContactSchedule.of(sequence, initial_rest=config.initial_rest, final_rest=config.final_rest)
    com, rest = initial_com(robot, sequence.start), np.zeros(3)
    if surroundings is not None:
        com[2] -= surroundings.sink(sequence.start)
    motion = optimise(robot, schedule, com, rest, config=optimiser, surroundings=surroundings)
    plan = MotionPlan(robot, world, sequence, schedule, motion, config=config)
    if landing is None or (motion.feasible and motion.kept is None):
        return plan
    moved = slid(plan, landing, optimiser, surroundings=surroundings)
    if moved is None or not moved.motion.feasible or (motion.feasible and not keeps_margins(moved, plan)):
        return plan
    return replace(moved, config=config)


def slid(
    plan: MotionPlan,
    landing: RoomConfig,
    config: SequenceConfig,
    share: np.ndarray | None = None,
    surroundings: Surroundings | None = None,
) -> MotionPlan | None:
    """The plan with landing points where the optimiser moves them, and the motion to it.

    Args:
        plan: The plan, with a feasible motion or without.
        landing: How far feet may land from where the plan has them.
        config: Settings of the optimiser.
        share: (transitions,) part of this room that each transition's contact has; None for all of it.
        surroundings: What limits where the body may be; None: nothing does.

    Returns:
        The new plan; `motion.feasible` says whether there is a motion. None where no contact has room to move.
    """
    robot, world, schedule, problem = plan.robot, plan.world, plan.schedule, plan.motion.problem
    hits = None if surroundings is None else surroundings.foot_hits
    room = landing_room(robot, world.surfaces, plan.sequence, landing, world.goal, hits)
    if share is not None:
        room *= share[:, None, None]
    if not room.any():
        return None
    given = robot, schedule, problem.com, problem.com_velocity
    moved = optimise(*given, config=config, room=room, surroundings=surroundings)
    sequence = moved_sequence(plan.sequence, schedule, moved.problem.times, moved.solved.position)
    on_ground = laid(sequence, world.surfaces, robot.half_sizes)
    schedule = schedule.through(on_ground)
    if on_ground is not sequence or _leans_less(moved, surroundings):
        moved = optimise(robot, schedule, *given[2:], config=config, surroundings=surroundings)
    return MotionPlan(robot, world, on_ground, schedule, moved)


def _leans_less(moved: CentroidalMotion, surroundings: Surroundings | None) -> bool:
    """Whether shins have less room where the feet of a motion landed than where they were planned."""
    leans = None if surroundings is None else surroundings.leans(moved.placed)
    planned = np.inf if moved.problem.lean is None else moved.problem.lean
    return leans is not None and bool((leans < planned - _LEAN_ROUNDING).any())


def keeps_margins(plan: MotionPlan, other: MotionPlan) -> bool:
    """Whether a plan's motion uses no more of the friction than another plan's, but for rounding."""
    used, most = (each.motion.solved.margins.friction for each in (plan, other))
    return used < most + FRICTION_ROUNDING
