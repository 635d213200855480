"""Replay a run in plain MuJoCo."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter

import mujoco
import numpy as np

from toolkit.errors import ExecutionError
from toolkit.execution.check import Check
from toolkit.execution.measure import Planned, measure
from toolkit.execution.recorder import Recorder
from toolkit.execution.result import Controls, Execution
from toolkit.execution.scene_index import SceneIndex
from toolkit.execution.simulation import Simulation
from toolkit.mjcf import mujoco_warnings
from toolkit.replanning.replanner import ReplanCounts


def replay_controls(scene: mujoco.MjModel, controls: Controls) -> np.ndarray:
    """Final qpos (nq,) after one mj_step per row of controls from the initial state.

    What pushed is left out, and MuJoCo's warnings are dropped.
    """
    data = mujoco.MjData(scene)
    data.qpos[:], data.qvel[:] = controls.qpos0, controls.qvel0
    with mujoco_warnings():
        for row in controls.ctrl:
            data.ctrl[:] = row
            mujoco.mj_step(scene, data)
    return data.qpos.copy()


def replay_run(execution: Execution, *, observer: Callable[[float], None] = lambda share: None) -> Execution:
    """Simulate a run again from its controls and pushes, without any controller, and measure it anew.

    Every check is computed from this simulation. Of the recorded run only the plan is taken over: where the CoM was to
    be, and which limbs were allowed to touch. `difference` compares the two.

    Args:
        execution: The recorded run.
        observer: Receives the share of the run that is done, every 0.1 s of it.

    Raises:
        ExecutionError: The scene is not the one in which the robot ran.
    """
    scene, standard, controls, samples = execution.scene, execution.standard, execution.controls, execution.samples
    index = SceneIndex(scene, standard.robot)
    ticks = len(samples.tick_times)
    if len(controls.ctrl) != ticks * standard.decimation:
        raise ExecutionError(
            f"the run has {len(controls.ctrl)} steps in {ticks} control ticks of {standard.decimation}"
        )
    recorder = Recorder(standard, ticks, scene, index)
    simulation = Simulation(recorder, controls.qpos0, controls.qvel0)
    report_every = max(round(0.1 / standard.period), 1)
    began = perf_counter()
    with mujoco_warnings() as warnings:
        for tick in range(ticks):
            recorder.expect(samples.com_aim[tick], samples.may_touch[tick])
            steps = slice(simulation.steps, simulation.steps + standard.decimation)
            simulation.run_tick(controls.ctrl[steps], None if controls.push is None else controls.push[steps])
            recorder.note_warnings(warnings)
            if recorder.fall:
                break
            if tick % report_every == 0:
                observer(tick / ticks)
    done = slice(simulation.steps)
    push = None if controls.push is None else controls.push[done]
    return measure(
        recorder,
        Controls(controls.timestep, controls.qpos0, controls.qvel0, controls.ctrl[done], simulation.qpos, push),
        standard,
        Planned(samples.com_planned, samples.momentum_planned, samples.wrench_planned),
        solver_failures=execution.solver_failures,
        wall_seconds=perf_counter() - began,
        replanning=ReplanCounts(),
        replayable=execution.replayable,
    )


def difference(recorded: Execution, again: Execution) -> str:
    """One line on where a replay left the states or the checks of the recorded run; "" where both are the same.

    States are compared bit for bit, at every control tick and after the last step.
    """
    states, found = ([*run.samples.qpos, run.controls.final_qpos] for run in (recorded, again))
    apart = (k for k, (one, other) in enumerate(zip(states, found, strict=False)) if not np.array_equal(one, other))
    first = next(apart, None)
    if first is not None:
        off = float(np.abs(states[-1] - found[-1]).max())
        return f"the states are others from {first * recorded.standard.period:.3f} s on, the last by up to {off:.3g}"
    if len(states) != len(found):
        return f"it ends after {len(found) - 1} control ticks, the recorded run after {len(states) - 1}"
    return checks_difference(recorded.checks, again.checks)


def checks_difference(recorded: Sequence[Check], again: Sequence[Check]) -> str:
    """One line on the first check of which a replay says something else; "" where there is none."""
    known = {check.name: check for check in recorded}
    for check in again:
        other = known.get(check.name)
        if other is None:
            return f"the record has no check {check.name}"
        if other != check:
            return (
                f"{check.name} is {check.value} of at most {check.limit} {check.unit}".rstrip()
                + f", in the record {other.value} of at most {other.limit}"
            )
    return ""
