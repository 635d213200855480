"""Replay a saved run in plain MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from toolkit.errors import InputError
from toolkit.execution.result import Controls
from toolkit.mjcf import mujoco_warnings

_NAMES = ("timestep", "qpos0", "qvel0", "ctrl", "qpos")


def replay(scene_path: Path | str, execution_path: Path | str) -> float:
    """Largest absolute difference of the final qpos to the recorded one when only the controls of a run act.

    It is 0 unless something else acted on the robot.

    Args:
        scene_path: The run's scene.mjb.
        execution_path: Its execution.npz with `timestep`, `qpos0`, `qvel0`, `ctrl` and `qpos` (its last row counts).

    Raises:
        InputError: A file is missing or is not what its name says.
    """
    for path in (scene_path, execution_path):
        if not Path(path).is_file():
            raise InputError(f"{path}: no such file; name the scene.mjb and execution.npz of a run")
    try:
        scene = mujoco.MjModel.from_binary_path(str(scene_path))
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"{scene_path}: not a compiled MuJoCo model of this version ({error})") from error
    with np.load(execution_path) as run:
        missing = [name for name in _NAMES if name not in run]
        if missing:
            raise InputError(f"{execution_path}: lacks {', '.join(missing)}; it is not the record of a run")
        timestep, qpos0, qvel0, ctrl, qpos = (run[name] for name in _NAMES)
    if ctrl.ndim != 2 or ctrl.shape[1] != scene.nu or qpos0.shape != (scene.nq,):
        raise InputError(f"{execution_path}: does not belong to {scene_path}; take both from the same run")
    if scene.opt.timestep != float(timestep):
        raise InputError(f"{scene_path}: steps of {scene.opt.timestep} s where the run made {float(timestep)} s")
    final = replay_controls(scene, Controls(float(timestep), qpos0, qvel0, ctrl, qpos[-1]))
    return float(np.abs(final - qpos[-1]).max())


def replay_controls(scene: mujoco.MjModel, controls: Controls) -> np.ndarray:
    """Final qpos (nq,) after one mj_step per row of controls from the initial state; MuJoCo's warnings are dropped."""
    data = mujoco.MjData(scene)
    data.qpos[:], data.qvel[:] = controls.qpos0, controls.qvel0
    with mujoco_warnings():
        for row in controls.ctrl:
            data.ctrl[:] = row
            mujoco.mj_step(scene, data)
    return data.qpos.copy()
