"""measure: from a recorded run to an Execution with its verdict."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.control.sampled_plan import Reference
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.recorder import Recorder
from toolkit.execution.result import Controls, Execution, Samples
from toolkit.execution.slip import SETTLE_TIME, ContactInterval, contact_intervals
from toolkit.execution.verdict import execution_checks, failure_reason
from toolkit.replanning.replanner import ReplanCounts
from toolkit.wholebody.plan import WholeBodyPlan


def measure(
    recorder: Recorder,
    controls: Controls,
    reference: Reference,
    plan: WholeBodyPlan,
    config: ExecutionConfig,
    *,
    solver_failures: int,
    wall_seconds: float,
    replanning: ReplanCounts,
) -> Execution:
    """The execution with its checks, from a recorded run.

    Args:
        recorder: What was sampled.
        controls: What was applied.
        reference: The plan at the ticks.
        plan: What was executed.
        config: Settings and limits.
        solver_failures: Number of ticks whose QP was not solved.
        wall_seconds: Duration of the loop in s.
        replanning: How the run was replanned.
    """
    robot, goal, scene, count = plan.robot, plan.world.goal, recorder.scene, recorder.count
    times = reference.times[:count]
    intervals = []
    for limb, model in sorted(robot.limbs.items()):
        force, position = recorder.normal_force[:count, limb], recorder.limb_position[:count, limb]
        rotation = recorder.limb_rotation[:count, limb]
        intervals += contact_intervals(limb, force, position, rotation, model.half_size, config.control_period)
    slip = _slip_by_stance(intervals, times, reference, len(plan.sequence.stances))
    touchdowns = _touchdowns(intervals, recorder, reference, config)
    missing = sum(swing.contact is not None for swing in reference.swings) - len(touchdowns)
    error = recorder.com[:count] - recorder.com_aim[:count]
    torque_ratio = (np.abs(recorder.torque[:count]) / robot.torque_limit).max(1)
    joints, speed = recorder.qpos[:count, 7:], np.abs(recorder.qvel[:count, 6:])
    excess = np.maximum(joints - robot.upper, robot.lower - joints).max()
    feet = _feet(recorder, controls.final_qpos).mean(0)[:2]
    distance = float(np.hypot(*(feet - goal.position[:2])))
    fell = bool(recorder.fall)
    completed = count == len(reference.times) and not fell
    values = {
        "upright": float(fell),
        "completed": float(not completed),
        "touchdowns": float(missing),
        "goal_distance": distance,
        "unplanned_contacts": float(len(recorder.meter.unplanned)),
        "friction": float(recorder.meter.friction_mismatches),
        "slip": max(slip) if slip else float("inf"),
        "com_rms_error": float(np.sqrt((error**2).sum(1).mean())),
        "torque_ratio": float(torque_ratio.max()),
        "joint_range": float(max(excess, 0.0)),
        "velocity_ratio": float((speed / robot.velocity_limit).max()),
    }
    checks = execution_checks(values, goal.radius, config)
    when = _failure_time(fell, recorder, slip, times, reference, config)
    reason = failure_reason(checks, recorder.fall)
    transition = None if when is None else plan.schedule.phase_at(when).transition
    simulated = len(controls.ctrl) * config.timestep
    mass = float(scene.body_subtreemass[0])
    return Execution(
        scene=scene,
        controls=controls,
        samples=Samples(
            tick_times=times,
            tick_seconds=recorder.tick_seconds[:count],
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
        completed=completed,
        fall=Failure(recorder.fall, float(times[-1])) if fell else None,
        goal_reached=not fell and distance <= goal.radius,
        final_goal_distance=distance,
        max_slip=values["slip"],
        max_touchdown_error=max((touchdown["position_error"] for touchdown in touchdowns), default=0.0),
        max_torque_ratio=values["torque_ratio"],
        max_velocity_ratio=values["velocity_ratio"],
        com_rms_error=values["com_rms_error"],
        solver_failures=solver_failures,
        unplanned_contacts=recorder.meter.unplanned_names,
        simulated_seconds=simulated,
        real_time_factor=simulated / wall_seconds,
        checks=checks,
        replayable=config.disturbance.replayable,
        failure=Failure(reason, when, transition) if reason else None,
        replanning=replanning,
    )


def _failure_time(
    fell: bool,
    recorder: Recorder,
    slip: tuple[float, ...],
    times: np.ndarray,
    reference: Reference,
    config: ExecutionConfig,
) -> float | None:
    """Time in s at which the run went wrong: a fall, an unplanned contact, or the swing before the worst slip."""
    if fell:
        return float(times[-1])
    if recorder.meter.unplanned_time is not None:
        return recorder.meter.unplanned_time
    if slip and max(slip) > config.slip_limit:
        worst = int(np.argmax(slip))
        return next((swing.start for swing in reference.swings if swing.transition == worst), float(times[-1]))
    return None


def _slip_by_stance(
    intervals: list[ContactInterval], times: np.ndarray, reference: Reference, stances: int
) -> tuple[float, ...]:
    """Largest slip of the contacts that overlap each stance; stance k ends with transition k's swing.

    A contact that lasts over several stances counts with its whole slip in each of them.
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
    """Planned wrenches (count, 4, 6) about the patches' centres in the world frame."""
    rotation, wrench = reference.limb_rotation[:count], reference.wrench[:count]
    return np.concatenate(
        [np.einsum("klij,klj->kli", rotation, wrench[..., part]) for part in (slice(0, 3), slice(3, 6))], axis=-1
    )


def _feet(recorder: Recorder, qpos: np.ndarray) -> np.ndarray:
    """Positions (2, 3) in m of the foot patches in a state."""
    data = mujoco.MjData(recorder.scene)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(recorder.scene, data)
    return np.array([data.site_xpos[site] for limb, site in recorder.index.sites.items() if limb.is_foot])
