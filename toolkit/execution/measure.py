"""From a recorded run to an Execution: everything the verdict needs, measured."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.control.sampled_plan import Reference
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.recorder import Recorder
from toolkit.execution.result import Controls, Execution, Samples
from toolkit.execution.slip import BEARING_FORCE, CONTACT_GAP, SETTLE_TIME, ContactInterval, contact_intervals
from toolkit.execution.verdict import Measured, execution_checks, failure_reason
from toolkit.replanning.replanner import ReplanCounts
from toolkit.robot.model import RobotModel
from toolkit.wholebody.plan import WholeBodyPlan


@dataclass(frozen=True)
class RunLog:
    """What the loop itself knows of a run.

    Attributes:
        scene: compiled. qpos0, qvel0: initial state. final_qpos, final_qvel: after the last step.
        final_feet: (2, 3) m; foot patches in the final state.
        ctrl: (S, nu). tick_seconds: (C,) s. wall_seconds: of the loop.
        finished: the loop reached its end.
        solver_failures: ticks.
        com_aim: (C, 3) m; where the controller wanted the CoM: the plan, as replanned.
        replanning: as in `Execution`.
    """

    scene: mujoco.MjModel
    qpos0: np.ndarray
    qvel0: np.ndarray
    final_qpos: np.ndarray
    final_feet: np.ndarray
    ctrl: np.ndarray
    tick_seconds: np.ndarray
    wall_seconds: float
    finished: bool
    solver_failures: int
    com_aim: np.ndarray
    replanning: ReplanCounts


def measure(
    log: RunLog,
    recorder: Recorder,
    reference: Reference,
    plan: WholeBodyPlan,
    config: ExecutionConfig,
) -> Execution:
    """Measure a run.

    Args:
        log: what the loop knows.
        recorder: what was sampled.
        reference: the plan at the ticks.
        plan: what was executed.
        config: settings and limits.

    Returns:
        The execution with its checks.
    """
    robot, goal, count = plan.robot, plan.world.goal, recorder.count
    times = reference.times[:count]
    intervals = _intervals(recorder, robot, config)
    slip = _slip_by_stance(intervals, times, reference, len(plan.sequence.stances))
    touchdowns = _touchdowns(intervals, recorder, reference, config)
    missing = sum(swing.contact is not None for swing in reference.swings) - len(touchdowns)
    error = recorder.com[:count] - log.com_aim
    torque_ratio = (np.abs(recorder.torque[:count]) / robot.torque_limit).max(1)
    joints, speed = recorder.qpos[:count, 7:], np.abs(recorder.qvel[:count, 6:])
    excess = np.maximum(joints - robot.upper, robot.lower - joints).max()
    feet = log.final_feet.mean(0)[:2]
    distance = float(np.hypot(*(feet - goal.position[:2])))
    fell = bool(recorder.fall)
    measured = Measured(
        completed=log.finished and not fell,
        fall_reason=recorder.fall,
        max_slip=max(slip) if slip else float("inf"),
        com_rms_error=float(np.sqrt((error**2).sum(1).mean())),
        max_torque_ratio=float(torque_ratio.max()),
        max_velocity_ratio=float((speed / robot.velocity_limit).max()),
        range_excess=float(max(excess, 0.0)),
        final_goal_distance=distance,
        goal_radius=goal.radius,
        unplanned_contacts=len(recorder.meter.unplanned),
        friction_mismatches=recorder.meter.friction_mismatches,
        missed_touchdowns=missing,
    )
    checks = execution_checks(measured, config)
    when = _failure_time(fell, recorder, slip, times, reference, config)
    reason = failure_reason(checks, recorder.fall)
    transition = None if when is None else plan.schedule.phase_at(when).transition
    simulated = len(log.ctrl) * config.timestep
    mass = float(log.scene.body_subtreemass[0])
    return Execution(
        scene=log.scene,
        controls=Controls(config.timestep, log.qpos0, log.qvel0, log.ctrl, log.final_qpos),
        samples=Samples(
            tick_times=times,
            tick_seconds=log.tick_seconds,
            qpos=recorder.qpos[:count],
            qvel=recorder.qvel[:count],
            com=recorder.com[:count],
            com_planned=reference.com[:count],
            momentum=recorder.momentum[:count],
            momentum_planned=np.hstack([mass * reference.com_velocity[:count], reference.angular_momentum[:count]]),
            wrench=recorder.wrench[:count],
            wrench_planned=_world_wrench(reference, count),
            cop_margin=recorder.cop_margin[:count],
            limb_pose=recorder.limb_pose,
            torque=recorder.torque[:count],
            torque_ratio=torque_ratio,
        ),
        touchdowns=touchdowns,
        slip=slip,
        completed=measured.completed,
        fall=Failure(recorder.fall, float(times[-1])) if fell else None,
        goal_reached=not fell and distance <= goal.radius,
        final_goal_distance=distance,
        max_slip=measured.max_slip,
        max_touchdown_error=max((touchdown["position_error"] for touchdown in touchdowns), default=0.0),
        max_torque_ratio=measured.max_torque_ratio,
        max_velocity_ratio=measured.max_velocity_ratio,
        com_rms_error=measured.com_rms_error,
        solver_failures=log.solver_failures,
        unplanned_contacts=recorder.meter.unplanned_names,
        simulated_seconds=simulated,
        real_time_factor=simulated / log.wall_seconds,
        checks=checks,
        replayable=config.disturbance.replayable,
        failure=Failure(reason, when, transition) if reason else None,
        replanning=log.replanning,
    )


def _failure_time(
    fell: bool,
    recorder: Recorder,
    slip: tuple[float, ...],
    times: np.ndarray,
    reference: Reference,
    config: ExecutionConfig,
) -> float | None:
    """When the run went wrong, for whoever plans again: fall, unplanned contact, or the swing of the worst slip."""
    if fell:
        return float(times[-1])
    if recorder.meter.unplanned_time is not None:
        return recorder.meter.unplanned_time
    if slip and max(slip) > config.slip_limit:
        worst = int(np.argmax(slip))
        return next((swing.start for swing in reference.swings if swing.transition == worst), float(times[-1]))
    return None


def _intervals(recorder: Recorder, robot: RobotModel, config: ExecutionConfig) -> list[ContactInterval]:
    """Contacts of all limbs."""
    count, period = recorder.count, config.control_period
    found = []
    for limb, model in sorted(robot.limbs.items()):
        found += contact_intervals(
            limb,
            recorder.normal_force[:count, limb],
            recorder.limb_position[:count, limb],
            recorder.limb_rotation[:count, limb],
            model.half_size,
            threshold=BEARING_FORCE,
            gap=round(CONTACT_GAP / period),
            settle=round(SETTLE_TIME / period),
        )
    return found


def _slip_by_stance(
    intervals: list[ContactInterval], times: np.ndarray, reference: Reference, stances: int
) -> tuple[float, ...]:
    """Largest slip of the contacts that overlap each stance; stance k ends with transition k's swing.

    A contact that lasts over several stances counts with its whole slip in each of them: never less than what slipped
    in the stance alone.
    """
    ends = np.full(stances, np.inf)
    for swing in reference.swings:
        ends[swing.transition] = swing.end
    begins = np.r_[-np.inf, ends[:-1]]
    reached = [k for k in range(stances) if k == 0 or begins[k] <= times[-1]]
    slip = np.zeros(len(reached))
    for interval in intervals:
        first, last = times[interval.first], times[interval.last]
        for k in reached:
            if first < ends[k] and last >= begins[k]:
                slip[k] = max(slip[k], interval.slip)
    return tuple(float(each) for each in slip)


def _touchdowns(
    intervals: list[ContactInterval], recorder: Recorder, reference: Reference, config: ExecutionConfig
) -> tuple[dict, ...]:
    """The contact that each transition made: the first that begins after the middle of its swing."""
    settle = round(SETTLE_TIME / config.control_period)
    made = []
    for swing in reference.swings:
        if swing.contact is None:
            continue
        middle = 0.5 * (swing.start + swing.end)
        later = [each for each in intervals if each.limb == swing.limb and reference.times[each.first] >= middle]
        if not later:
            continue
        sample = min(later[0].first + settle, recorder.count - 1)
        error = recorder.limb_position[sample, swing.limb] - swing.contact.pose.position
        made.append(
            {
                "transition": swing.transition,
                "limb": swing.limb.label,
                "time": float(reference.times[later[0].first]),
                "planned_time": swing.end,
                "position_error": float(np.linalg.norm(error)),
            }
        )
    return tuple(made)


def _world_wrench(reference: Reference, count: int) -> np.ndarray:
    """(count, 4, 6) planned wrenches about the patches' centres in the world."""
    rotation, wrench = reference.limb_rotation[:count], reference.wrench[:count]
    return np.concatenate(
        [np.einsum("klij,klj->kli", rotation, wrench[..., part]) for part in (slice(0, 3), slice(3, 6))], axis=-1
    )
