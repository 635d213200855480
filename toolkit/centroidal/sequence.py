"""The whole-sequence optimisation: the motion that is executed.

The paper's objective is minimised under exact cones, the limits of the body (`toolkit.centroidal.body`) and margins, by
the stage-structured interior-point method of `toolkit.centroidal.stages`. The wanted margins may be relaxed at a price,
so they shrink where nothing else is feasible; the motion says how far.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from toolkit.centroidal.body import BodyMargins, rough_com
from toolkit.centroidal.build import ProblemConfig, sequence_problem, transition_problem
from toolkit.centroidal.layout import Landing, indices
from toolkit.centroidal.problem import (
    STANDARD_GRAVITY,
    CentroidalMotion,
    CentroidalProblem,
    Margins,
    Weights,
)
from toolkit.centroidal.program import Program, Regularisers
from toolkit.centroidal.stages.method import GAP, Options, Squares, Work, minimise
from toolkit.centroidal.stages.steps import WRENCH
from toolkit.centroidal.surroundings import Surroundings
from toolkit.centroidal.verdict import judged
from toolkit.contacts.failure import Failure
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.errors import InputError
from toolkit.geometry.limb import FEET
from toolkit.physics.wrench import pressure
from toolkit.robot.model import RobotModel

WANTED = Margins(friction=0.66, cop=(0.055, 0.045), yaw=0.6)
CALM = Weights(angular_momentum=20.0, angular_momentum_rate=1.0)
"""The paper's weights except for the angular momentum: with the paper's, no body can follow fast swings."""
WANTED_BODY = BodyMargins(length=0.015, ankle=0.1, hip=0.05, height=0.02, torque=0.75, most_torque=0.88)
CONVERGED = "converged"
TAKEN = 0.3  # most of a slack at the start
STILL = 1e-9  # m; a smaller displacement of a landing point is none


@dataclass(frozen=True)
class SequenceConfig:
    """Settings of the optimisation of a sequence.

    Attributes:
        problem: Discretisation, final box, weights and the wanted margins of the contacts.
        body: Wanted margins of legs and arms.
        regularisers: Small terms beside the paper's objective.
    """

    problem: ProblemConfig = field(default_factory=lambda: ProblemConfig(weights=CALM, margins=WANTED, min_dt=0.02))
    body: BodyMargins = WANTED_BODY
    regularisers: Regularisers = field(default_factory=Regularisers)


def optimise(
    robot: RobotModel,
    schedule: ContactSchedule,
    com: np.ndarray,
    com_velocity: np.ndarray,
    *,
    spin: np.ndarray | None = None,
    config: SequenceConfig = SequenceConfig(),
    room: np.ndarray | None = None,
    surroundings: Surroundings | None = None,
    at_rest: bool = True,
) -> CentroidalMotion:
    """Optimise the motion of a whole schedule, which ends at rest unless it is a part of a longer one.

    Args:
        robot: The robot, with its mass, patches, legs and arms.
        schedule: The phases; the last one has both feet in contact.
        com: (3,) m; initial CoM in the world.
        com_velocity: (3,) m/s.
        spin: (3,) kg m^2/s; initial angular momentum about the CoM; None: none.
        config: Settings.
        room: (transitions, 2, 2) m; lowest and highest displacement of each transition's contact along its own axes,
            where feet may land elsewhere; `CentroidalMotion.landed` says where they do. None: contacts stay as planned.
        surroundings: What limits where the CoM may be; None: nothing does.
        at_rest: Whether the CoM must be at rest at the end.

    Returns:
        The motion. Feasible where NumPy confirms it within the margins that it keeps and the body's limits; else its
        failure names the constraint that is violated most, and where.

    Raises:
        InputError: As `sequence_problem`, or a contact is not finite.
    """
    problem = sequence_problem(robot, schedule, com, com_velocity, config=config.problem, final_at_rest=at_rest)
    if spin is not None:
        problem = replace(problem, angular_momentum=np.array(spin, float))
    if surroundings is not None:
        problem = _confined(problem, surroundings)
    landings = None if room is None else _landings(problem, schedule, room)
    motion = _solved(robot, problem, config, landings)
    failure = None if motion.failure is None else _placed(motion.failure, problem, schedule)
    return replace(motion, failure=failure)


def optimise_transition(
    robot: RobotModel,
    stance: Stance,
    com: np.ndarray,
    com_velocity: np.ndarray,
    transition: ContactTransition,
    *,
    config: SequenceConfig = SequenceConfig(),
    final_at_rest: bool = False,
) -> CentroidalMotion:
    """Optimise the motion of one transition alone, under the limits and margins of whole sequences.

    It is feasible where a motion leads from the CoM state to some state whose CoM is in the final box of
    `ProblemConfig`, and at rest if that is wanted.

    Args:
        robot: The robot.
        stance: The contacts before the transition.
        com: (3,) m; initial CoM in the world.
        com_velocity: (3,) m/s.
        transition: The limb that moves, its new contact and the timing.
        config: Settings.
        final_at_rest: Whether the CoM must be at rest at the end.

    Raises:
        InputError: As `build.transition_problem`, or a contact is not finite.
    """
    given = robot, stance, com, com_velocity, transition
    problem = transition_problem(*given, config=config.problem, final_at_rest=final_at_rest)
    return _solved(robot, problem, config, None)


def _solved(
    robot: RobotModel, problem: CentroidalProblem, config: SequenceConfig, landings: list[Landing] | None
) -> CentroidalMotion:
    """The motion of a problem with its verdict."""
    start = time.perf_counter()
    program = Program(problem, robot, config.body, config.regularisers, landings)
    if not program.finite():
        raise InputError("a contact pose, a friction coefficient or a timing of the sequence is not finite")
    y, status, iterations = _solve(program)
    motion = motion_of(program, y, status)
    return replace(motion, iterations=iterations, seconds=time.perf_counter() - start)


def _confined(problem: CentroidalProblem, surroundings: Surroundings) -> CentroidalProblem:
    """The problem with the room that the world leaves to shins and CoM, which also ends as low as it must."""
    room, problem = surroundings.room(problem), replace(problem, lean=surroundings.leans(problem))
    if room is None:
        return problem
    return replace(problem, room=room, final_center=problem.final_center - [0.0, 0.0, room.sink[-1]])


def _placed(failure: Failure, problem: CentroidalProblem, schedule: ContactSchedule) -> Failure:
    """The failure with its transition, which the reason then names too."""
    if failure.knot is None or failure.time is None:
        return failure
    step = min(failure.knot, problem.steps - 1)
    transition = schedule.phase_at(failure.time).transition
    words = f"{failure.reason} in transition {transition}, {problem.times[step]:.2f} s"
    return replace(failure, reason=words, transition=transition)


def _solve(program: Program) -> tuple[np.ndarray, str, int]:
    """Variables (N + 1, m) of the stages at the solution, whether the solver converged, and its iterations."""
    layout, y = program.layout, guess(program)
    work = Work.of(len(layout.size), layout.states, y.shape[1])
    options = Options(program.problem.final_at_rest)
    found = minimise(program.steps, program.prices, Squares.none(), program.blocks, layout.size, y, work, options)
    converged, iterations, _ = found
    return y, CONVERGED if converged else "the solver stopped early", iterations


def guess(program: Program) -> np.ndarray:
    """Start of the solver: the CoM follows the mean of the feet, and the contacts share the weight."""
    p, layout = program.problem, program.layout
    n = p.steps
    y = np.zeros((n + 1, int(layout.size.max())))
    y[:, :3], y[:, 3:6] = rough_com(p)
    y[0, :3], y[0, 3:6], y[0, 6:9] = p.com, p.com_velocity, p.angular_momentum / p.mass
    # The weight is shared, as far as it is inside the cones: a palm on a wall starts with a light touch.
    up = p.rotation[..., 2, :] / np.maximum(p.active[:, :2].sum(1), 1)[:, None, None]
    normal = np.maximum(up[..., 2], 0.02)
    lateral = np.linalg.norm(up[..., :2], axis=-1)
    inside = np.minimum(1.0, 0.5 * p.friction * normal / np.maximum(lateral, 1e-9))
    local = np.concatenate([up[..., :2] * inside[..., None], normal[..., None]], -1)
    step, limb = np.nonzero(p.active)
    y[step[:, None], indices(layout.wrench[step, limb], 3)] = local[step, limb]
    program.start_slacks(y, GAP, TAKEN)
    return y


def _landings(problem: CentroidalProblem, schedule: ContactSchedule, room: np.ndarray) -> list[Landing]:
    """Where the feet of a schedule may land, given the room of each transition's contact."""
    landings = []
    for phase in schedule.phases:
        if phase.swing is not None and phase.swing.is_foot:
            step = int(np.searchsorted(problem.times, phase.start + 1e-9, side="right")) - 1
            lower, upper = room[phase.transition]
            landings.append(Landing(phase.swing, step, lower, upper))
    return landings


def _landed(program: Program, y: np.ndarray) -> np.ndarray | None:
    """(N, 4, 3) m; places of the contacts, moved by the variables; None where they cannot move."""
    p, layout = program.problem, program.layout
    if not layout.moving:
        return None
    position, step = p.position.copy(), np.arange(p.steps)
    for foot in FEET:
        shift = y[:-1, layout.pair(foot)]
        shift = np.where(np.abs(shift) > STILL, shift, 0.0)
        moved = np.einsum("tij,tj->ti", p.rotation[:, foot, :, :2], shift)
        on = p.active[:, foot]
        position[on, foot] += moved[on]
        held = np.maximum.accumulate(np.where(on, step, -1))  # a foot in the air has the contact that it left
        position[held >= 0, foot] = position[held[held >= 0], foot]
    return position


def motion_of(program: Program, y: np.ndarray, status: str) -> CentroidalMotion:
    """The motion of the variables (N + 1, m) of a program's stages, with its verdict; `status` is the solver's."""
    p, layout = program.problem, program.layout
    n, weight = p.steps, p.mass * STANDARD_GRAVITY
    local, moment = np.zeros((n, 4, 3)), np.zeros((n, 4, 3))
    step, limb = np.nonzero(p.active)
    wrench = weight * y[step[:, None], indices(layout.wrench[step, limb], WRENCH)]
    local[step, limb], moment[step, limb] = wrench[:, :3], wrench[:, 3:]
    load = np.where(local[..., 2] > 1e-7 * weight, local[..., 2], np.inf)
    *cop, torque = pressure((*np.moveaxis(local, -1, 0), *np.moveaxis(moment, -1, 0)), load)
    motion = CentroidalMotion(
        problem=p,
        feasible=False,
        status=status,
        com=y[:, :3].copy(),
        linear_momentum=p.mass * y[:, 3:6],
        angular_momentum=p.mass * y[:, 6:9],
        force=np.einsum("tlij,tlj->tli", p.rotation, local),
        cop=np.stack(cop, -1),
        yaw_torque=torque,
        landed=_landed(program, y),
    )
    return judged(motion, program.robot, y[np.arange(n + 1)[:, None], layout.slack])
