"""measure: from a recorded run to an Execution with its verdict."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.execution.balance import unbalance
from toolkit.execution.recorder import Recorder
from toolkit.execution.result import Controls, Execution, Samples
from toolkit.execution.scuff import Scuff, scuffs
from toolkit.execution.slip import SETTLE_TIME, ContactInterval, bearing_force, contact_intervals
from toolkit.execution.standard import Move, Standard
from toolkit.execution.verdict import execution_checks, failure_reason, is_too_fast
from toolkit.replanning.replanner import ReplanCounts


class Planned(NamedTuple):
    """The plan at the control ticks of a run, at least as many as were run; see `Samples`."""

    com: np.ndarray
    momentum: np.ndarray
    wrench: np.ndarray


def measure(
    recorder: Recorder,
    controls: Controls,
    standard: Standard,
    planned: Planned,
    *,
    solver_failures: int,
    wall_seconds: float,
    replanning: ReplanCounts,
    replayable: bool,
) -> Execution:
    """The execution with its checks, from a recorded run.

    Args:
        recorder: What was sampled.
        controls: What was applied.
        standard: What the run is held against.
        planned: The plan at the ticks, to be kept beside the measurements. It decides nothing.
        solver_failures: Number of ticks whose QP was not solved.
        wall_seconds: Duration of the loop in s.
        replanning: How the run was replanned.
        replayable: Whether nothing but the controls acted.
    """
    robot, goal, scene, count = standard.robot, standard.goal, recorder.scene, recorder.count
    times = standard.times[:count]
    intervals, bearing = [], bearing_force(recorder.mass)
    for limb, model in sorted(robot.limbs.items()):
        force, position = recorder.normal_force[:count, limb], recorder.limb_position[:count, limb]
        rotation = recorder.limb_rotation[:count, limb]
        intervals += contact_intervals(limb, force, position, rotation, model.half_size, standard.period, bearing)
    slip = _slip_by_stance(intervals, times, standard.moves)
    scuffed = scuffs(standard.moves, recorder.force[: recorder.steps], standard.timestep)
    touchdowns = _touchdowns(intervals, recorder, standard)
    missing = sum(move.target is not None for move in standard.moves) - len(touchdowns)
    error = recorder.com[:count] - recorder.com_aim[:count]
    torque_ratio = (np.abs(recorder.torque[:count]) / robot.torque_limit).max(1)
    joints, speed = recorder.qpos[:count, 7:], np.abs(recorder.qvel[:count, 6:])
    excess = np.maximum(joints - robot.upper, robot.lower - joints).max()
    distance = float(goal.distance(_feet(recorder, controls.final_qpos).mean(0)))
    fell = bool(recorder.fall)
    completed = count == standard.ticks and not fell
    values = {
        "upright": float(fell),
        "completed": float(not completed),
        "touchdowns": float(missing),
        "goal_distance": distance,
        "balance": _unbalance(recorder, standard),
        "unplanned_contacts": float(len(recorder.meter.unplanned)),
        "friction": float(recorder.meter.friction_mismatches),
        "scuff": max((each.impulse for each in scuffed), default=0.0) / recorder.mass,
        "slip": max(slip) if slip else float("inf"),
        "com_rms_error": float(np.sqrt((error**2).sum(1).mean())),
        "torque_ratio": float(torque_ratio.max()),
        "joint_range": float(max(excess, 0.0)),
        "velocity_ratio": float((speed / robot.velocity_limit).max()),
    }
    checks = execution_checks(values, goal.radius, standard)
    when = _failure_time(fell, recorder, scuffed, slip, times, standard)
    reason = failure_reason(checks, recorder.fall, recorder.meter.first_touch, recorder.meter.press)
    transition = None if when is None else standard.transition_at(when)
    simulated = len(controls.ctrl) * standard.timestep
    return Execution(
        scene=scene,
        standard=standard,
        controls=controls,
        samples=Samples(
            tick_times=times,
            tick_seconds=recorder.tick_seconds[:count],
            qpos=recorder.qpos[:count],
            qvel=recorder.qvel[:count],
            com=recorder.com[:count],
            com_planned=planned.com[:count],
            com_aim=recorder.com_aim[:count],
            momentum=recorder.momentum[:count],
            momentum_planned=planned.momentum[:count],
            may_touch=recorder.may_touch[:count],
            wrench=recorder.wrench[:count],
            wrench_planned=planned.wrench[:count],
            cop_margin=recorder.cop_margin[:count],
            limb_pose=recorder.limb_pose,
            torque=recorder.torque[:count],
            torque_ratio=torque_ratio,
        ),
        touchdowns=touchdowns,
        slip=slip,
        scuffs=scuffed,
        completed=completed,
        fall=Failure(recorder.fall, float(times[-1])) if fell else None,
        goal_reached=not fell and distance <= goal.radius,
        final_goal_distance=distance,
        max_slip=values["slip"],
        max_scuff=values["scuff"],
        max_touchdown_error=max((touchdown["position_error"] for touchdown in touchdowns), default=0.0),
        max_torque_ratio=values["torque_ratio"],
        max_velocity_ratio=values["velocity_ratio"],
        com_rms_error=values["com_rms_error"],
        solver_failures=solver_failures,
        unplanned_contacts=recorder.meter.unplanned_names,
        simulated_seconds=simulated,
        real_time_factor=simulated / wall_seconds,
        checks=checks,
        replayable=replayable,
        failure=Failure(reason, when, transition, too_fast=is_too_fast(checks, recorder.fall)) if reason else None,
        replanning=replanning,
    )


def _unbalance(recorder: Recorder, standard: Standard) -> float:
    """By how much the robot is out of balance at the end, m; with nothing that bears it, it stands on its feet."""
    last, limbs = recorder.count - 1, standard.robot.limbs
    bears = [limb for limb in limbs if recorder.normal_force[last, limb] > bearing_force(recorder.mass)]
    bears = bears or [limb for limb in limbs if limb.is_foot]
    return unbalance(
        recorder.com[last],
        recorder.momentum[last, :3] / recorder.mass,
        recorder.limb_position[last, bears],
        recorder.limb_rotation[last, bears],
        np.array([limbs[limb].bearing for limb in bears]),
        float(np.linalg.norm(recorder.scene.opt.gravity)),
    )


def _failure_time(
    fell: bool,
    recorder: Recorder,
    scuffed: tuple[Scuff, ...],
    slip: tuple[float, ...],
    times: np.ndarray,
    standard: Standard,
) -> float | None:
    """Time in s at which the run went wrong: a fall, an unplanned contact, a scuff, or the swing before most slip."""
    if fell:
        return float(times[-1])
    touch = recorder.meter.first_touch
    if touch is not None:
        return touch.time
    worst_scuff = max(scuffed, key=lambda each: each.impulse, default=None)
    if worst_scuff is not None and worst_scuff.impulse > standard.scuff_limit * recorder.mass:
        return worst_scuff.time
    if slip and max(slip) > standard.slip_limit:
        worst = int(np.argmax(slip))
        return standard.moves[worst].start if worst < len(standard.moves) else float(times[-1])
    return None


def _slip_by_stance(intervals: list[ContactInterval], times: np.ndarray, moves: tuple[Move, ...]) -> tuple[float, ...]:
    """Largest slip of the contacts that overlap each stance; stance k ends with transition k's swing.

    A contact that lasts over several stances counts with its whole slip in each of them.
    """
    ends = np.array([*(move.end for move in moves), np.inf])
    begins = np.r_[-np.inf, ends[:-1]]
    reached = [k for k in range(len(ends)) if k == 0 or begins[k] <= times[-1]]
    slip = np.zeros(len(reached))
    for interval in intervals:
        first, last = times[interval.first], times[interval.last]
        for k in reached:
            if first < ends[k] and last >= begins[k]:
                slip[k] = max(slip[k], interval.slip)
    return tuple(float(each) for each in slip)


def _touchdowns(intervals: list[ContactInterval], recorder: Recorder, standard: Standard) -> tuple[dict, ...]:
    """The contact that each transition made: the first that begins after the middle of its swing."""
    settle, times = round(SETTLE_TIME / standard.period), standard.times
    made = []
    for transition, move in enumerate(standard.moves):
        if move.target is None:
            continue
        middle = 0.5 * (move.start + move.end)
        later = [each for each in intervals if each.limb == move.limb and times[each.first] >= middle]
        if not later:
            continue
        sample = min(later[0].first + settle, recorder.count - 1)
        error = recorder.limb_position[sample, move.limb] - move.target
        made.append(
            {
                "transition": transition,
                "limb": move.limb.label,
                "time": float(times[later[0].first]),
                "planned_time": move.end,
                "position_error": float(np.linalg.norm(error)),
            }
        )
    return tuple(made)


def _feet(recorder: Recorder, qpos: np.ndarray) -> np.ndarray:
    """Positions (2, 3) in m of the foot patches in a state."""
    data = mujoco.MjData(recorder.scene)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(recorder.scene, data)
    return np.array([data.site_xpos[site] for limb, site in recorder.index.sites.items() if limb.is_foot])
