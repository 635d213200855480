"""One sequence of contacts with the paper's friction pyramid and with the exact cone: motions, and their fates.

The pyramid |fx| + |fy| <= sqrt(2) mu fz goes around the cone and is 41 % wider along the axes. Both motions have the
paper's weights and no margins, so that nothing but the cone differs.
"""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from toolkit.centroidal.body import BodyMargins, body_residuals
from toolkit.centroidal.build import ProblemConfig, initial_com, sequence_problem
from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.problem import STANDARD_GRAVITY, CentroidalMotion, Margins
from toolkit.centroidal.program import Program, Regularisers
from toolkit.centroidal.residual import TOLERANCE, check
from toolkit.centroidal.sequence import guess
from toolkit.centroidal.verdict import BODY_TOLERANCE
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import PlanningError
from toolkit.pipeline.config import PipelineConfig
from toolkit.robot.model import RobotModel
from toolkit.world.timing import Timing
from toolkit.world.world import World
from validation.ablation_trial import run_plan
from validation.cases import Case, kind_of
from validation.jobs import Record, reason_of
from validation.motion_figures import motion_figures
from validation.options import TrialSettings
from validation.rivals.even_steps import even_steps
from validation.rivals.footsteps import footsteps_of
from validation.run_trial import make_planner, robot_of
from validation.searched import make_ready

PYRAMID, CONE = "pyramid", "cone"
PAPERS_TIMING = Timing(1.0, 1.0)
_PER_METRE = 10.0  # steps per m of way on a slope: the paper shows 31 for 3 m


def pyramid_trial(settings: TrialSettings, case: Case, simulate: bool) -> Record:
    """A record: both motions of one sequence, and whether the simulation accepts them.

    Args:
        settings: Of the planner of the sequences.
        case: World and seed. On a slope the steps are even ones, elsewhere those of the planner.
        simulate: Whether the motions are carried out.
    """
    robot, world = robot_of(settings.robot, settings.robots), case.world()
    record: Record = {"kind": case.kind, "seed": case.seed, "stage": "planning", "passed": False}
    try:
        sequence = contacts_of(settings, robot, world, case)
    except PlanningError as error:
        return record | {"reason": reason_of(error), "motions": {}}
    if sequence is None:
        return record | {"reason": "no contact sequence found", "motions": {}}
    motions: dict[str, Any] = {}
    for name in (CONE, PYRAMID):
        began = time.perf_counter()
        plan = motion_under(robot, world, sequence, pyramid=name == PYRAMID)
        motions[name] = {"feasible": plan.motion.feasible, "seconds": time.perf_counter() - began}
        if not plan.motion.feasible:
            motions[name]["reason"] = plan.motion.outcome
            continue
        motions[name] |= {
            "objective": plan.motion.objective,
            "beyond_cone": beyond_cone(plan.motion),
            "figures": asdict(motion_figures(plan.motion)),
        }
        if simulate:
            motions[name] |= run_plan(settings, robot, world, plan)
    return record | {
        "stage": "done",
        "passed": True,
        "reason": "",
        "transitions": len(sequence.transitions),
        "walking_seconds": sequence.duration,
        "motions": motions,
    }


def contacts_of(settings: TrialSettings, robot: RobotModel, world: World, case: Case) -> ContactSequence | None:
    """The contacts of a trial, at the paper's timing; None where the planner finds none."""
    planning = replace(settings.planning, timing=(PAPERS_TIMING,))
    settings = replace(settings, planning=planning)
    if kind_of(case.kind).generator == "slope":
        planner = make_planner(settings, world, "kinematic")
        length = float(np.hypot(*(world.goal.position - world.start.position)[:2]))
        count = round(_PER_METRE * kind_of(case.kind).options.get("length", length)) + 1
        return even_steps(replace(footsteps_of(robot, world, planner, count), timing=PAPERS_TIMING))
    make_ready(settings, settings.planner)
    found = make_planner(settings, world).search(np.random.default_rng(case.seed), settings.planning.time_limit)
    if not found.solutions:
        return None
    return min(found.solutions, key=lambda solution: solution.cost).sequence


def motion_under(robot: RobotModel, world: World, sequence: ContactSequence, *, pyramid: bool) -> MotionPlan:
    """The motion that Ipopt finds with the paper's weights and no margins, and the verdict by the same cone."""
    from validation.reference.sequence import solve

    config = PipelineConfig()
    schedule = ContactSchedule.of(sequence, **config.rests(robot.scale))
    com = initial_com(robot, sequence.start)
    problem = sequence_problem(robot, schedule, com, np.zeros(3), config=ProblemConfig())
    program = Program(problem, robot, BodyMargins(), Regularisers(), None)
    motion = solve(program, guess(program), pyramid)
    if pyramid:
        motion = replace(motion, kept=Margins())
        motion = replace(motion, feasible=holds_pyramid(motion, robot), failure=None)
    return MotionPlan(robot, world, sequence, schedule, motion)


def holds_pyramid(motion: CentroidalMotion, robot: RobotModel) -> bool:
    """Whether a motion keeps all constraints of its problem, with the pyramid in place of the cone."""
    residuals = check(motion)
    others = max(value for name, value in residuals._asdict().items() if name != "friction")
    body = body_residuals(motion, robot).largest
    return others <= TOLERANCE and _beyond_pyramid(motion) <= TOLERANCE and body <= BODY_TOLERANCE


def beyond_cone(motion: CentroidalMotion) -> float:
    """Most lateral force over what friction holds, of all loaded contacts and steps; above 1 beyond the cone."""
    local = _local_force(motion)
    p = motion.problem
    held = p.friction * local[..., 2]
    loaded = p.active & (local[..., 2] > 0.01)
    return float(np.max(np.hypot(local[..., 0], local[..., 1])[loaded] / held[loaded], initial=0.0))


def _beyond_pyramid(motion: CentroidalMotion) -> float:
    """Largest |fx| + |fy| - sqrt(2) mu fz in weights."""
    local, p = _local_force(motion), motion.problem
    beyond = np.abs(local[..., :2]).sum(-1) - np.sqrt(2.0) * p.friction * local[..., 2]
    return float(np.max(beyond[p.active], initial=0.0))


def _local_force(motion: CentroidalMotion) -> np.ndarray:
    """(N, 4, 3) forces in the contact frames, in weights."""
    p = motion.problem
    return np.einsum("tlji,tlj->tli", p.rotation, motion.force) / (p.mass * STANDARD_GRAVITY)
