"""A run in MuJoCo's own viewer."""

from __future__ import annotations

import atexit
import subprocess
import sys
import threading
import time
from typing import Any

import mujoco
import numpy as np

from toolkit.errors import InputError
from toolkit.execution.result import Execution
from toolkit.mjcf import mujoco_warnings
from toolkit.report.pictures import follow

_PROBE = """
import sys, glfw
if not glfw.init():
    sys.exit(1)
glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
sys.exit(0 if glfw.create_window(64, 64, "probe", None, None) else 1)
"""
PAUSE = 1.0  # s; between the end of the run and its next beginning


def require_display() -> None:
    """Check early that a window can be opened. This is tried in another process: a failed attempt ends some libraries.

    Raises:
        InputError: There is no display.
    """
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", _PROBE], capture_output=True, check=False)
    if done.returncode:
        raise InputError("--viewer: this machine has no display to open a window on; --video and --rerun need none")


def show(execution: Execution) -> None:
    """Show a run in real time, over and over, until the window is closed; contact forces can be switched on in it.

    Raises:
        InputError: The window cannot be opened.
    """
    from mujoco import viewer

    model, data, samples = execution.scene, mujoco.MjData(execution.scene), execution.samples
    times, decimation = samples.tick_times, execution.standard.decimation
    threads = threading.enumerate()
    try:
        window = viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    except (RuntimeError, mujoco.FatalError) as error:
        raise InputError(f"--viewer: the window cannot be opened ({error})") from error
    # A signal ends the process: the thread that draws must have ended before the library is.
    atexit.register(_close, window, [each for each in threading.enumerate() if each not in threads])
    with mujoco_warnings(), window:  # a view decides nothing
        camera = follow(model, samples.qpos, times)[0]
        window.cam.type, window.cam.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, model.jnt_bodyid[0]
        window.cam.distance, window.cam.azimuth, window.cam.elevation = 3.5, camera.azimuth, camera.elevation
        began = time.perf_counter()
        while window.is_running():
            elapsed = (time.perf_counter() - began) % (times[-1] + PAUSE)
            tick = min(int(np.searchsorted(times, elapsed)), len(times) - 1)
            with window.lock():
                data.qpos[:], data.qvel[:] = samples.qpos[tick], samples.qvel[tick]
                data.ctrl[:] = execution.controls.ctrl[tick * decimation]
                mujoco.mj_forward(model, data)
            window.sync()
            time.sleep(0.01)


def _close(window: Any, threads: list[threading.Thread]) -> None:
    """Close the window and wait for the threads that draw it."""
    window.close()
    for thread in threads:
        thread.join(1.0)
