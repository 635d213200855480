"""From a centroidal motion to a whole-body trajectory: swing paths, inverse kinematics, checks."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.schedule import ContactSchedule
from toolkit.errors import PlanningError
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel
from toolkit.wholebody.avoidance import ArmAvoidance
from toolkit.wholebody.check import CheckReport, check
from toolkit.wholebody.finding import Finding
from toolkit.wholebody.ik import WholeBodyIK, first_guess
from toolkit.wholebody.ik_config import IKConfig
from toolkit.wholebody.limb_paths import LimbPaths, limb_paths
from toolkit.wholebody.swing_task import SwingConfig
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.world import World


@dataclass(frozen=True)
class WholeBodyConfig:
    """Settings of the whole-body stage.

    Attributes:
        rate: Hz; samples of the trajectory.
        swing, ik: see the classes.
    """

    rate: float = 50.0
    swing: SwingConfig = field(default_factory=SwingConfig)
    ik: IKConfig = field(default_factory=IKConfig)


def whole_body(
    robot: RobotModel,
    world: World,
    schedule: ContactSchedule,
    motion: CentroidalMotion,
    config: WholeBodyConfig | None = None,
) -> WholeBodyTrajectory:
    """Whole-body trajectory of a centroidal motion.

    Args:
        robot: the robot.
        world: to keep clear of.
        schedule: the phases that `motion` was optimised for, with a final rest.
        motion: centre of mass, momentum and wrenches.
        config: settings.

    Returns:
        The trajectory; `feasible` says whether every check passed, `reason` which did not.
    """
    config = config or WholeBodyConfig()
    begin = perf_counter()
    paths = limb_paths(robot, world, schedule, motion, config.swing)
    count = max(int(round(schedule.duration * config.rate)), 2) + 1
    times = np.linspace(0.0, schedule.duration, count)
    blocked = [
        Finding(
            f"{limb.label} finds no way clear of the world in transition {transition}",
            next(phase.start for phase in schedule.phases if phase.transition == transition and phase.swing == limb),
        )
        for limb, transition in paths.blocked
    ]
    if not motion.feasible:
        reason = f"the centroidal motion is not feasible: {motion.status}"
        return _failed(robot, paths, times, reason, perf_counter() - begin)
    try:
        qpos = solve_ik(robot, paths, motion, times, config.ik, world)
    except PlanningError as error:
        reason = "; ".join([*(finding.text for finding in blocked), str(error)])
        return _failed(robot, paths, times, reason, perf_counter() - begin)
    report = check(robot, world, paths, motion, times, qpos)
    return _trajectory(robot, paths, times, qpos, report, blocked, begin)


def solve_ik(
    robot: RobotModel,
    paths: LimbPaths,
    motion: CentroidalMotion,
    times: np.ndarray,
    config: IKConfig,
    world: World | None = None,
) -> np.ndarray:
    """(T, 7 + n) qpos on a uniform time grid; the arms keep clear of `world` where there is one.

    Raises:
        PlanningError: if a quadratic program has no solution.
    """
    tick = float(times[1] - times[0]) / config.substeps
    avoidance = None if world is None else ArmAvoidance(robot, world)
    solver = WholeBodyIK(robot, config, tick, avoidance)
    qpos = np.empty((len(times), len(robot.home)))
    qpos[0] = solver.start(first_guess(robot, paths, motion), paths, motion)
    for index in range(1, len(times)):
        for substep in range(1, config.substeps + 1):
            state = solver.advance(times[index - 1] + substep * tick, paths, motion)
        qpos[index] = state
    return qpos


def qvel_of(model: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """(T, nv) velocities by central differences in MuJoCo's conventions; at rest at both ends."""
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
    robot: RobotModel,
    paths: LimbPaths,
    times: np.ndarray,
    qpos: np.ndarray,
    report: CheckReport,
    blocked: list[Finding],
    begin: float,
) -> WholeBodyTrajectory:
    findings = [*blocked, *report.findings]
    pose, velocity, contact = _limb_arrays(paths, times)
    return WholeBodyTrajectory(
        times=times,
        qpos=qpos,
        qvel=qvel_of(robot.mujoco_model, times, qpos),
        torque=report.torque,
        limb_pose=pose,
        limb_velocity=velocity,
        in_contact=contact,
        max_position_error=report.max_position_error,
        max_orientation_error=report.max_orientation_error,
        limits_respected=report.limits_respected,
        feasible=not findings,
        reason="; ".join(finding.text for finding in findings),
        seconds=perf_counter() - begin,
        failure_time=findings[0].time if findings else None,
    )


def _failed(robot: RobotModel, paths: LimbPaths, times: np.ndarray, reason: str, seconds: float) -> WholeBodyTrajectory:
    """A trajectory without postures, because the inverse kinematics gave up."""
    pose, velocity, contact = _limb_arrays(paths, times)
    joints = len(robot.joint_names)
    return WholeBodyTrajectory(
        times=times,
        qpos=np.full((len(times), 7 + joints), np.nan),
        qvel=np.full((len(times), 6 + joints), np.nan),
        torque=np.full((len(times), joints), np.nan),
        limb_pose=pose,
        limb_velocity=velocity,
        in_contact=contact,
        max_position_error=float("inf"),
        max_orientation_error=float("inf"),
        limits_respected=False,
        feasible=False,
        reason=reason,
        seconds=seconds,
    )
