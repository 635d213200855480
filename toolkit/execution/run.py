"""execute: carry a plan out in MuJoCo and measure the run."""

from __future__ import annotations

import copy
from collections.abc import Callable
from time import perf_counter

import mujoco
import numpy as np

from toolkit.control.controller import Controller
from toolkit.control.sampled_plan import Reference, sample_reference
from toolkit.errors import ExecutionError
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import StateFilter
from toolkit.execution.measure import Planned, measure
from toolkit.execution.recorder import Recorder
from toolkit.execution.result import Controls, Execution
from toolkit.execution.scene_index import SceneIndex
from toolkit.execution.simulation import Simulation
from toolkit.execution.standard import Standard
from toolkit.mjcf import mujoco_warnings
from toolkit.replanning.replanner import ReplanCounts, Replanner
from toolkit.wholebody.plan import WholeBodyPlan

Observer = Callable[[float, str], None]
"""Receives progress: the share of the run that is done, and a short text."""

# Time and length are those of a body of the usual size (`toolkit.robot.scale`).
EXTRA_REST = 0.5  # s; time on the last stance after the plan's own rest, in which an unstable robot would topple
_SETTLING, _DAMPING = 300, 0.05  # physics steps of sinking on curved ground, and what each takes of the speed
_UNDERFOOT = 0.02  # m; geoms so near to a patch are what it stands on
_DEFAULT = ExecutionConfig()


def execute(
    plan: WholeBodyPlan,
    *,
    config: ExecutionConfig = _DEFAULT,
    rng: np.random.Generator | None = None,
    observer: Observer | None = None,
) -> Execution:
    """Simulate a plan under the controller.

    The robot starts in the trajectory's first state, settled where the ground under it is curved. Only joint torques
    within its limits drive it, apart from a push that `config.disturbance` asks for. The run ends `EXTRA_REST` after
    the plan, or with a fall.

    Args:
        plan: The plan. Its robot is the robot as the controller knows it, and its scene stays unchanged.
        config: Settings.
        rng: Random generator for disturbances; one with seed 0 where None.
        observer: Receives progress every 0.1 s of simulated time.

    Returns:
        The measured run with the verdict's checks.

    Raises:
        ExecutionError: The plan's parts do not fit each other or the robot.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    robot, trajectory = plan.robot, plan.trajectory
    scene = copy.copy(plan.scene)
    scene.opt.timestep = config.timestep
    index = SceneIndex(scene, robot)
    _check_plan(plan)
    qpos0, qvel0 = trajectory.qpos[0].copy(), trajectory.qvel[0].copy()
    grounds = {contact.surface for contact in plan.sequence.start.contacts if contact.surface >= 0}
    if any(plan.world.surfaces[ground].relief.any() for ground in grounds):
        qpos0 = _settled(scene, qpos0)
    config.disturbance.disturb_model(
        scene, index.robot_geom, _touched(scene, index, qpos0, robot.scale.length * _UNDERFOOT), rng
    )
    period = config.control_period
    ticks = int(np.ceil((plan.schedule.duration + robot.scale.time * EXTRA_REST) / period - 1e-9))
    reference = sample_reference(period * np.arange(ticks), plan)
    margins = plan.motion.solved.margins
    replanner = Replanner(reference, plan) if config.replanning else None
    controller = Controller(robot, plan.scene, reference, margins, period, replanner)
    standard = Standard.of(plan, config, reference.swings, ticks)
    recorder = Recorder(standard, ticks, scene, index)
    told = StateFilter(config.disturbance, period, rng)
    push_time, push = config.disturbance.draw_push(plan.schedule.duration, rng)
    simulation = Simulation(recorder, qpos0, qvel0)
    ctrl = np.zeros((ticks * config.control_decimation, scene.nu))
    pushes = None
    if push.any():
        pushed = (push_time <= reference.times) & (reference.times < push_time + config.disturbance.push_duration)
        pushes = np.repeat(np.where(pushed[:, None], push, 0.0), config.control_decimation, axis=0)
    report_every = max(round(0.1 / period), 1)
    started = perf_counter()
    with mujoco_warnings() as warnings:
        for tick in range(ticks):
            tick_started = perf_counter()
            torque = controller.tick(tick, *told(simulation.qpos, simulation.qvel), recorder.meter.normal_force)
            recorder.tick_seconds[tick] = perf_counter() - tick_started
            recorder.expect(controller.aim.com, reference.authority[tick] > 0.0)
            steps = slice(simulation.steps, simulation.steps + config.control_decimation)
            ctrl[steps] = torque
            simulation.run_tick(ctrl[steps], None if pushes is None else pushes[steps])
            recorder.note_warnings(warnings)
            if recorder.fall:
                break
            if observer is not None and tick % report_every == 0:
                observer(tick / ticks, f"{reference.times[tick]:.1f} s")
    done = slice(simulation.steps)
    return measure(
        recorder,
        Controls(config.timestep, qpos0, qvel0, ctrl[done], simulation.qpos, None if pushes is None else pushes[done]),
        standard,
        _planned(reference, float(scene.body_subtreemass[0])),
        solver_failures=controller.failures,
        wall_seconds=perf_counter() - started,
        replanning=replanner.counts if replanner else ReplanCounts(),
        replayable=config.disturbance.replayable,
    )


def _planned(reference: Reference, mass: float) -> Planned:
    """The plan at the ticks as it is kept: momenta of a robot of `mass` in kg, wrenches in the world frame."""
    rotation, wrench = reference.limb_rotation, reference.wrench
    parts = [np.einsum("klij,klj->kli", rotation, wrench[..., part]) for part in (slice(0, 3), slice(3, 6))]
    momentum = np.hstack([mass * reference.com_velocity, reference.angular_momentum])
    return Planned(reference.com, momentum, np.concatenate(parts, axis=-1))


def _check_plan(plan: WholeBodyPlan) -> None:
    """Refuse a plan whose parts do not belong together."""
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


def _settled(scene: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """A state near (nq,) in which the ground bears a robot that holds its posture.

    Patches planned on curved ground are above it in places. Feet that begin in the air strike it, as the controller's
    torques count on its force at once.
    """
    stiff, data = copy.copy(scene), mujoco.MjData(scene)
    stiff.dof_armature[6:] = 1e3 * scene.body_subtreemass[0]
    data.qpos[:] = qpos
    for _ in range(_SETTLING):
        mujoco.mj_step(stiff, data)
        data.qvel[:] *= 1.0 - _DAMPING
    return np.concatenate([data.qpos[:7], qpos[7:]])


def _touched(scene: mujoco.MjModel, index: SceneIndex, qpos: np.ndarray, within: float) -> np.ndarray:
    """Which static geoms (ngeom,) are within so many m of the robot's patches in a state."""
    data = mujoco.MjData(scene)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(scene, data)
    near = np.zeros(scene.ngeom, bool)
    for patch in np.flatnonzero(index.patch_limb >= 0):
        for geom in np.flatnonzero(~index.robot_geom):
            near[geom] |= mujoco.mj_geomDistance(scene, data, int(patch), int(geom), within, None) < within
    return near
