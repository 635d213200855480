"""From a motion plan to a whole-body plan: swing paths, inverse kinematics, checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import mujoco
import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.failure import Failure
from toolkit.contacts.schedule import ContactSchedule
from toolkit.errors import PlanningError
from toolkit.geometry.limb import Limb
from toolkit.mjcf import warnings_refused
from toolkit.robot.model import RobotModel
from toolkit.wholebody.arms_ahead import ArmsAhead
from toolkit.wholebody.avoidance import BODY, CLOSE, FAR, Avoidance, Damper
from toolkit.wholebody.check import CheckReport, check
from toolkit.wholebody.ik import WholeBodyIK, first_guess
from toolkit.wholebody.ik_config import SUBSTEPS
from toolkit.wholebody.lean import Lean, lean_ahead
from toolkit.wholebody.limb_paths import LimbPaths, limb_paths
from toolkit.wholebody.swing_task import LIFT
from toolkit.wholebody.trajectory import WholeBodyTrajectory

RATE = 50.0  # Hz for a body of the usual size (`toolkit.robot.scale`); samples of the trajectory
PASSES = 4  # most solutions, each of which leans ahead of the one before, until one passes its checks


@dataclass(frozen=True)
class WholeBodyPlan(MotionPlan):
    """A motion plan with what the whole-body stage added: all that an execution needs.

    Attributes:
        scene: Robot and world in one MuJoCo model, as composed. Copy it before changing it.
        paths: Planned poses of each limb's patch.
        trajectory: Joint trajectories; `trajectory.feasible` says whether every check passed.
    """

    scene: mujoco.MjModel = field(repr=False)
    paths: LimbPaths = field(repr=False)
    trajectory: WholeBodyTrajectory


@dataclass(frozen=True)
class Manner:
    """How a whole-body motion is made; lengths are those of a body of the usual size (`toolkit.robot.scale`).

    Attributes:
        foot_lift: m; guarded motion of feet along the surface normal.
        links: How all links but those of arms and the last ones of feet are kept apart.
        turning: Factor on the weight of the planned angular momentum about the vertical.
    """

    foot_lift: float = LIFT
    links: Damper = BODY
    turning: float = 1.0


WIDE = Manner(foot_lift=0.08, links=FAR)
"""For motions that touched something in execution: it strays from what was planned."""
LEVEL = Manner(turning=5.0)
"""For motions whose soles slipped: trunk and arms turn against the swinging leg, so that the standing sole need not."""


@warnings_refused("the whole-body motion", PlanningError)
def whole_body(plan: MotionPlan, scene: mujoco.MjModel, manner: Manner = Manner()) -> WholeBodyPlan:
    """Find swing paths and a whole-body trajectory for a motion plan.

    Args:
        plan: Contacts and motion, with a final rest.
        scene: The plan's robot and world in one model (`toolkit.world.scene.compose_scene`).
        manner: How the motion is made.

    Returns:
        The plan with paths and trajectory; `trajectory.feasible` says whether every check passed.
    """
    begin = perf_counter()
    duration, rate = plan.schedule.duration, RATE / plan.robot.scale.time
    times = np.linspace(0.0, duration, max(int(round(duration * rate)), 2) + 1)
    paths = limb_paths(plan.robot, plan.world, plan.schedule, plan.motion, manner.foot_lift)
    if not plan.motion.feasible:
        failure = Failure(f"the centroidal motion is not feasible: {plan.motion.outcome}")
        trajectory = replace(_without_postures(plan.robot, paths, times), failure=failure)
    else:
        trajectory = _trajectory(plan, scene, paths, times, manner)
    trajectory = replace(trajectory, seconds=perf_counter() - begin)
    return WholeBodyPlan(plan.robot, plan.world, plan.sequence, plan.schedule, plan.motion, scene, paths, trajectory)


def solve_ik(
    robot: RobotModel,
    paths: LimbPaths,
    motion: CentroidalMotion,
    times: np.ndarray,
    scene: mujoco.MjModel | None = None,
    lean: Lean | None = None,
    manner: Manner = Manner(),
    ahead: ArmsAhead | None = None,
) -> np.ndarray:
    """(T, 7 + n) qpos on a uniform time grid (T,) in s; all links keep clear in `scene` unless it is None.

    The base is upright with the heading of the feet where nothing is in the way, or as `lean` wants it. With `ahead`
    arms give way early.

    Raises:
        PlanningError: A quadratic program has no solution.
    """
    tick = float(times[1] - times[0]) / SUBSTEPS
    avoidance = None if scene is None else Avoidance(robot, scene, manner.links)
    solver = WholeBodyIK(robot, tick, avoidance, lean, manner.turning, ahead)
    qpos = np.empty((len(times), len(robot.home)))
    qpos[0] = solver.start(first_guess(robot, paths, motion), paths, motion)
    for index in range(1, len(times)):
        for substep in range(1, SUBSTEPS + 1):
            state = solver.advance(times[index - 1] + substep * tick, paths, motion)
        qpos[index] = state
    return qpos


def _qvel_of(model: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """(T, nv) velocities by central differences in MuJoCo's conventions; zero at both ends."""
    qvel = np.zeros((len(times), model.nv))
    for index in range(1, len(times) - 1):
        span = times[index + 1] - times[index - 1]
        mujoco.mj_differentiatePos(model, qvel[index], span, qpos[index - 1], qpos[index + 1])
    return qvel


def _limb_arrays(paths: LimbPaths, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses (T, 4, 7), velocities (T, 4, 6) and contacts (T, 4) of the limbs on a time grid."""
    pose, velocity = np.full((len(times), 4, 7), np.nan), np.full((len(times), 4, 6), np.nan)
    contact = np.zeros((len(times), 4), bool)
    for index, time in enumerate(times):
        for limb in Limb:
            sample = paths.sample(limb, time)
            contact[index, limb] = sample.in_contact
            if sample.pose is not None:
                pose[index, limb] = np.concatenate([sample.pose.position, sample.pose.quaternion_wxyz])
                velocity[index, limb] = sample.velocity
    return pose, velocity, contact


def _trajectory(
    plan: MotionPlan, scene: mujoco.MjModel, paths: LimbPaths, times: np.ndarray, manner: Manner
) -> WholeBodyTrajectory:
    """The postures with the results of their checks."""
    robot = plan.robot
    (blocked, folded), trajectory = _faulty(plan.schedule, paths), _without_postures(robot, paths, times)
    try:
        passes = [manner] if blocked else [*PASSES * [manner], replace(manner, links=CLOSE)]
        qpos, report = _checked(plan, scene, paths, times, passes)
    except PlanningError as error:
        return replace(trajectory, failure=Failure("; ".join([*(each.reason for each in blocked), str(error)])))
    return replace(
        trajectory,
        qpos=qpos,
        qvel=_qvel_of(robot.mujoco_model, times, qpos),
        torque=report.torque,
        max_position_error=report.max_position_error,
        max_orientation_error=report.max_orientation_error,
        limits_respected=report.limits_respected,
        failure=_joined(blocked, folded, report.findings, plan.schedule),
    )


def _checked(
    plan: MotionPlan, scene: mujoco.MjModel, paths: LimbPaths, times: np.ndarray, passes: Sequence[Manner]
) -> tuple[np.ndarray, CheckReport]:
    """The postures (T, 7 + n) with their checks: of the first pass that holds, or else of the first one.

    Each pass leans ahead of what the base did in the one before, unless links are kept apart in another way. Where arms
    touched the world in the first one, they give way early in the others.
    """
    robot, motion = plan.robot, plan.motion
    found: list[tuple[np.ndarray, CheckReport]] = []
    lean, before, ahead = None, None, None
    for manner in passes:
        if manner is before and lean is None and (ahead is None or len(found) > 1):
            continue
        if manner is before and len(found) == PASSES - 1 and _hard_or_touching(found[-1][1].findings):
            continue  # the last one is for legs that meet
        lean = lean if manner is before else None
        qpos = solve_ik(robot, paths, motion, times, scene, lean, manner, ahead)
        found.append((qpos, check(robot, scene, paths, motion, times, qpos)))
        if not found[-1][1].findings:
            return found[-1]
        lean, before = lean_ahead(paths, times, qpos, robot.scale.time, lean), manner
        if len(found) == 1 and (arms := ArmsAhead(robot, scene, times, qpos)).touch:
            ahead = arms
    return found[0]


def _hard_or_touching(findings: Sequence[Failure]) -> bool:
    """Whether joints that turn too hard and links that touch the world are all that was found."""
    return all(each.too_fast or each.at_any_pace for each in findings)


def _faulty(schedule: ContactSchedule, paths: LimbPaths) -> tuple[list[Failure], list[Failure]]:
    """A failure for each swing without a clear way, and for each whose leg would have to fold too much."""
    starts = {(phase.swing, phase.transition): phase.start for phase in schedule.phases}
    blocked = [
        Failure(
            f"{limb.label} finds no way clear of the world in transition {transition}",
            starts[limb, transition],
            at_any_pace=not limb.is_foot,
        )
        for limb, transition in paths.blocked
    ]
    folded = [
        Failure(
            f"{limb.label} would have to come closer to its hip in transition {transition} than its knee can fold",
            starts[limb, transition],
        )
        for limb, transition in paths.folded
    ]
    return blocked, folded


def _joined(
    blocked: Sequence[Failure], folded: Sequence[Failure], found: Sequence[Failure], schedule: ContactSchedule
) -> Failure | None:
    """All findings as one failure at the place of the first that others may come from.

    Others may come from blocked swings, and those in a transition from the leg that does not fold so much in it, which
    is no failure where nothing else is: the base gave way. Joints that turn too hard make no link touch the world.
    """

    def transition_of(failure: Failure) -> int | None:
        return None if failure.time is None else schedule.phase_at(failure.time).transition

    harmed = {transition_of(each) for each in found}
    folded = [each for each in folded if transition_of(each) in harmed]
    findings, touches = [*blocked, *folded, *found], [each for each in found if each.at_any_pace]
    if not findings:
        return None
    causes = blocked or folded or (_hard_or_touching(found) and touches) or findings
    transition, reason = transition_of(causes[0]), "; ".join(each.reason for each in findings)
    too_fast, at_any_pace = all(each.too_fast for each in causes), all(each.at_any_pace for each in causes)
    return replace(causes[0], reason=reason, transition=transition, too_fast=too_fast, at_any_pace=at_any_pace)


def _without_postures(robot: RobotModel, paths: LimbPaths, times: np.ndarray) -> WholeBodyTrajectory:
    """The planned paths of the limbs; everything about the joints is NaN."""
    pose, velocity, contact = _limb_arrays(paths, times)
    count, joints = len(times), len(robot.joint_names)
    return WholeBodyTrajectory(
        times=times,
        qpos=np.full((count, 7 + joints), np.nan),
        qvel=np.full((count, 6 + joints), np.nan),
        torque=np.full((count, joints), np.nan),
        limb_pose=pose,
        limb_velocity=velocity,
        in_contact=contact,
        max_position_error=float("inf"),
        max_orientation_error=float("inf"),
        limits_respected=False,
        seconds=0.0,
    )
