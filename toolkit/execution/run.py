"""execute: carry a plan out in MuJoCo and measure what happened."""

from __future__ import annotations

import copy
from collections.abc import Callable
from time import perf_counter

import mujoco
import numpy as np

from toolkit.control.controller import Controller
from toolkit.control.sampled_plan import sample_reference
from toolkit.errors import ExecutionError
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import StateFilter
from toolkit.execution.measure import RunLog, measure
from toolkit.execution.recorder import Recorder
from toolkit.execution.result import Execution
from toolkit.execution.scene_index import SceneIndex
from toolkit.replanning.nominal import Nominal
from toolkit.replanning.replanner import ReplanCounts, Replanner
from toolkit.wholebody.plan import WholeBodyPlan

Observer = Callable[[float, str], None]
"""Told of progress: the share of the run that is done, and a word on it."""

EXTRA_REST = 0.5  # s; on the last stance, beyond the plan's own rest: a robot that topples does so within it
_DEFAULT = ExecutionConfig()


def execute(
    plan: WholeBodyPlan,
    *,
    config: ExecutionConfig = _DEFAULT,
    rng: np.random.Generator | None = None,
    observer: Observer | None = None,
) -> Execution:
    """Simulate a plan under the controller.

    The robot starts in the trajectory's first state and is driven by joint torques alone, within its limits (but for a
    push that `config.disturbance` asks for). The run ends `EXTRA_REST` after the plan, or with a fall.

    Args:
        plan: what to do; its robot is the robot as the controller knows it, its scene stays as it is.
        config: settings.
        rng: draws disturbances; one with seed 0 where None.
        observer: told of progress every 0.1 s of simulated time.

    Returns:
        What happened, measured, with the verdict's checks.

    Raises:
        ExecutionError: the plan's parts do not fit each other or the robot.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    robot, motion, trajectory = plan.robot, plan.motion, plan.trajectory
    scene = copy.copy(plan.scene)
    scene.opt.timestep = config.timestep
    index = SceneIndex(scene, robot)
    _check_plan(plan)
    qpos0, qvel0 = trajectory.qpos[0].copy(), trajectory.qvel[0].copy()
    config.disturbance.disturb_model(scene, index.robot_geom, _touched(scene, index, qpos0), rng)
    period = config.control_period
    ticks = int(np.ceil((plan.schedule.duration + EXTRA_REST) / period - 1e-9))
    reference = sample_reference(
        period * np.arange(ticks), plan.sequence, plan.schedule, motion, trajectory, plan.paths, robot
    )
    margins = motion.solved.margins
    replanner = None
    if config.replanning.enabled and margins.friction <= config.replanning.max_friction:
        nominal = Nominal.of(motion, reference, robot, config.replanning.horizon)
        replanner = Replanner(reference, nominal, robot, plan.world.surfaces, config.replanning)
    controller = Controller(robot, reference, margins, period, config.controller, replanner)
    recorder = Recorder(ticks, scene, robot, index)
    told = StateFilter(config.disturbance, period, rng)
    push_time, push = config.disturbance.draw_push(plan.schedule.duration, rng)
    data = mujoco.MjData(scene)
    data.qpos[:], data.qvel[:] = qpos0, qvel0
    ctrl = np.zeros((ticks * config.control_decimation, scene.nu))
    tick_seconds, com_aim, step = np.zeros(ticks), np.zeros((ticks, 3)), 0
    report_every = max(round(0.1 / period), 1)
    qpos, qvel = qpos0.copy(), qvel0.copy()
    started = perf_counter()
    for tick in range(ticks):
        tick_started = perf_counter()
        torque = controller.tick(tick, *told(qpos, qvel), recorder.meter.normal_force)
        tick_seconds[tick] = perf_counter() - tick_started
        com_aim[tick] = controller.aim.com
        recorder.meter.expected[:] = reference.authority[tick] > 0.0
        data.ctrl[:] = torque
        if push.any():
            pushed = push_time <= reference.times[tick] < push_time + config.disturbance.push_duration
            data.xfrc_applied[index.base, :3] = push if pushed else 0.0
        for part in range(config.control_decimation):
            ctrl[step] = torque
            step += 1
            mujoco.mj_step(scene, data)
            recorder.meter.read(data)
            if part == 0:
                recorder.record(data, qpos, qvel)
            qpos[:], qvel[:] = data.qpos, data.qvel
        if recorder.fall:
            break
        if observer is not None and tick % report_every == 0:
            observer(tick / ticks, f"{reference.times[tick]:.1f} s")
    wall = perf_counter() - started
    log = RunLog(
        scene=scene,
        qpos0=qpos0,
        qvel0=qvel0,
        final_qpos=qpos,
        final_feet=_feet(scene, index, qpos),
        ctrl=ctrl[:step],
        tick_seconds=tick_seconds[: recorder.count],
        wall_seconds=wall,
        finished=recorder.count == ticks and not recorder.fall,
        solver_failures=controller.failures,
        com_aim=com_aim[: recorder.count],
        replanning=replanner.counts if replanner else ReplanCounts(),
    )
    return measure(log, recorder, reference, plan, config)


def _check_plan(plan: WholeBodyPlan) -> None:
    """Refuse plans whose parts do not belong together."""
    robot, schedule, motion, trajectory = plan.robot, plan.schedule, plan.motion, plan.trajectory
    count = len(robot.joint_names)
    if trajectory.qpos.shape[1] != 7 + count or trajectory.qvel.shape[1] != 6 + count:
        raise ExecutionError(
            f"the trajectory has {trajectory.qpos.shape[1] - 7} joints where robot {robot.name} has {count}; "
            "plan it with the robot that executes it"
        )
    ends = {"motion": motion.problem.times[-1], "trajectory": trajectory.times[-1]}
    for name, end in ends.items():
        if abs(end - schedule.duration) > 0.05:
            raise ExecutionError(
                f"the {name} lasts {end:.2f} s where the schedule lasts {schedule.duration:.2f} s; plan both together"
            )
    if not (np.isfinite(trajectory.qpos).all() and np.isfinite(motion.com).all()):
        raise ExecutionError("the plan has values that are not finite; it cannot be executed")


def _touched(scene: mujoco.MjModel, index: SceneIndex, qpos: np.ndarray) -> np.ndarray:
    """(ngeom,) bool; static geoms within 2 cm of the robot in a state."""
    data = mujoco.MjData(scene)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(scene, data)
    near = np.zeros(scene.ngeom, bool)
    for patch in np.flatnonzero(index.patch_limb >= 0):
        for geom in np.flatnonzero(~index.robot_geom):
            near[geom] |= mujoco.mj_geomDistance(scene, data, int(patch), int(geom), 0.02, None) < 0.02
    return near


def _feet(scene: mujoco.MjModel, index: SceneIndex, qpos: np.ndarray) -> np.ndarray:
    """(2, 3) m; positions of the foot patches in a state."""
    data = mujoco.MjData(scene)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(scene, data)
    return np.array([data.site_xpos[site] for limb, site in index.sites.items() if limb.is_foot])
