"""Read back what a run wrote: its report, and its execution with the scene."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.errors import ExecutionError, InputError
from toolkit.execution.result import Controls, Execution, Samples
from toolkit.execution.scene_index import SceneIndex
from toolkit.execution.scuff import Scuff
from toolkit.execution.standard import Standard
from toolkit.mjcf import mujoco_warnings
from toolkit.replanning.replanner import ReplanCounts
from toolkit.report.files import EXECUTION, REPORT, SCENE, digest, read_check
from toolkit.report.run_report import RunReport, report_of
from toolkit.report.standard_entry import read_standard

_AGAIN = "run it again to have a whole one"
_UNREADABLE = (
    *(OSError, ValueError, TypeError, EOFError, KeyError, MemoryError, NotImplementedError, SyntaxError),
    *(zipfile.BadZipFile, zlib.error),
)
"""What NumPy raises where a file is not the archive that its name promises."""
_SAMPLES = {
    "tick_times": (), "qvel": ("nv",), "com": (3,), "com_planned": (3,), "com_aim": (3,), "momentum": (6,),
    "momentum_planned": (6,), "may_touch": (4,), "wrench": (4, 6), "wrench_planned": (4, 6), "cop_margin": (4,),
    "limb_pose": (4, 7), "torque": ("nu",), "torque_ratio": (),
}  # fmt: skip
"""Shape of one row of each measurement, a row per control tick."""
_UNDEFINED = ("cop_margin", "limb_pose")  # NaN without contact, and for a limb that the robot does not have
_FIGURES = (
    "final_goal_distance",
    "max_slip",
    "max_scuff",
    "max_touchdown_error",
    "max_torque_ratio",
    "max_velocity_ratio",
)
_FIGURES += ("com_rms_error", "simulated_seconds")
_FLAGS = ("completed", "goal_reached", "replayable")
_COUNTS = ("replans", "replan_failures", "replan_departures", "replan_landings")


@dataclass(frozen=True)
class SavedRun:
    """A run as its folder has it.

    Attributes:
        folder: The folder.
        report: Its report.
        execution: Its execution; None where the run came no further than an earlier stage. What only a clock measured
            is not in the files and NaN here.
    """

    folder: Path
    report: RunReport
    execution: Execution | None


def read_run(folder: Path) -> SavedRun:
    """Read a folder that `toolkit.report.run.write_run` has written.

    Raises:
        InputError: It is no such folder, a file is missing or broken, or its files belong to different runs.
    """
    if not folder.is_dir():
        what = "is no folder" if folder.exists() else "no such folder"
        raise InputError(f"{folder}: {what}; name the folder of a run")
    report = report_of(folder)
    if report.stages["execution"]["simulated_seconds"] is None:
        return SavedRun(folder, report, None)
    for name in (EXECUTION, SCENE):
        if not (folder / name).is_file():
            raise InputError(f"{folder}: lacks {name}; {_AGAIN}")
    execution = _read_execution(folder, report.reason)
    if execution.standard.robot.name != report.robot:
        raise InputError(
            f"{folder}: {REPORT} is of robot {report.robot} and {EXECUTION} of robot {execution.standard.robot.name}; "
            "take all files from the same run"
        )
    return SavedRun(folder, report, execution)


def _read_execution(folder: Path, reason: str) -> Execution:
    """The execution in a folder; `reason` is the verdict's."""
    path = folder / EXECUTION
    arrays = read_arrays(path)
    for name in ("standard", "scene_digest"):
        if name not in arrays:
            raise InputError(f"{path}: lacks {name}: a version before this one wrote it, or no run; {_AGAIN}")
    scene = read_scene(folder / SCENE, str(arrays["scene_digest"]))
    try:
        return _execution(arrays, scene, reason)
    except KeyError as error:
        raise InputError(f"{path}: has no valid {error}; {_AGAIN}") from error
    except (ExecutionError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"{path}: is broken: {_first_line(error)}; {_AGAIN}") from error


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Every array of an npz file.

    Raises:
        InputError: It is none, or is broken.
    """
    try:
        content = path.read_bytes()
        if not content.startswith(b"PK"):  # of which NumPy would say that it may hold pickled objects
            raise ValueError("no npz archive")
        with np.load(io.BytesIO(content)) as file:  # of a path it would leave a broken file open
            return {name: file[name] for name in file.files}
    except _UNREADABLE as error:
        raise InputError(f"{path}: is cut off or broken ({_first_line(error)}); {_AGAIN}") from error


def read_scene(path: Path, expected: str) -> mujoco.MjModel:
    """The compiled scene. MuJoCo itself may crash on a damaged one, so that only what the run wrote is given to it."""
    content = path.read_bytes()
    if digest(content) != expected:
        raise InputError(f"{path}: is cut off, was changed, or is of another run than {EXECUTION}; {_AGAIN}")
    try:
        with mujoco_warnings():
            return mujoco.MjModel.from_binary_path(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(
            f"{path}: this MuJoCo ({mujoco.__version__}) cannot read it ({_first_line(error)}); "
            "use the version in the report"
        ) from error


def _execution(arrays: Mapping[str, np.ndarray], scene: mujoco.MjModel, reason: str) -> Execution:
    """An execution from its arrays; raises as `_read_execution` expects it where they are broken."""
    standard = read_standard(json.loads(str(arrays["standard"])))
    SceneIndex(scene, standard.robot)  # the robot is in this scene, or this raises
    ticks = len(arrays["tick_times"])
    sizes = {"nq": scene.nq, "nv": scene.nv, "nu": scene.nu}
    samples = {}
    for name, shape in _SAMPLES.items():
        array = _array(arrays, name, (ticks, *(sizes.get(str(size), size) for size in shape)), name not in _UNDEFINED)
        samples[name] = array.astype(bool) if name == "may_touch" else array
    qpos = _array(arrays, "qpos", (ticks + 1, scene.nq))
    steps = ticks * standard.decimation
    if not 0 < ticks <= standard.ticks or scene.opt.timestep != standard.timestep:
        raise ValueError(f"{ticks} ticks in a scene with steps of {scene.opt.timestep} s are not of this run")
    controls = Controls(
        timestep=float(arrays["timestep"]),
        qpos0=_array(arrays, "qpos0", (scene.nq,)),
        qvel0=_array(arrays, "qvel0", (scene.nv,)),
        ctrl=_array(arrays, "ctrl", (steps, scene.nu)),
        final_qpos=qpos[-1],
        push=_array(arrays, "push", (steps, 3)) if "push" in arrays else None,
    )
    time = float(arrays["failure_time"]) if "failure_time" in arrays else None
    transition = None if time is None else standard.transition_at(time)
    fall = Failure(str(arrays["fall_reason"]), float(samples["tick_times"][-1])) if arrays["fell"] else None
    return Execution(
        scene=scene,
        standard=standard,
        controls=controls,
        samples=Samples(tick_seconds=np.full(ticks, np.nan), qpos=qpos[:-1], **samples),
        touchdowns=tuple(_read_touchdown(entry, standard) for entry in json.loads(str(arrays["touchdowns"]))),
        slip=tuple(float(value) for value in arrays["slip"]),
        scuffs=tuple(_read_scuff(entry, standard) for entry in json.loads(str(arrays["scuffs"]))),
        fall=fall,
        solver_failures=int(arrays["solver_failures"]),
        unplanned_contacts=tuple(
            (str(one), str(other)) for one, other in json.loads(str(arrays["unplanned_contacts"]))
        ),
        real_time_factor=float("nan"),
        checks=tuple(read_check(entry) for entry in json.loads(str(arrays["checks"]))),
        failure=Failure(reason, time, transition) if reason else None,
        replanning=ReplanCounts(*(int(arrays[name]) for name in _COUNTS), replan_seconds=float("nan")),
        **{name: float(arrays[name]) for name in _FIGURES},
        **{name: bool(arrays[name]) for name in _FLAGS},
    )


def _array(arrays: Mapping[str, np.ndarray], name: str, shape: tuple[int, ...], finite: bool = True) -> np.ndarray:
    """An array of this shape, as float; all of its numbers are finite where asked for."""
    array = arrays[name].astype(float)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape} where the scene and the other arrays need {shape}")
    if finite and not np.isfinite(array).all():
        raise ValueError(f"{name} has numbers that are not finite")
    return array


def _read_touchdown(entry: dict[str, Any], standard: Standard) -> dict[str, Any]:
    """One touchdown."""
    transition = int(entry["transition"])
    if not 0 <= transition < len(standard.moves):
        raise ValueError(f"there is no transition {transition}")
    numbers = {name: float(entry[name]) for name in ("time", "planned_time", "position_error")}
    return {"transition": transition, "limb": standard.moves[transition].limb.label, **numbers}


def _read_scuff(entry: dict[str, Any], standard: Standard) -> Scuff:
    """One scuff."""
    transition = int(entry["transition"])
    if not 0 <= transition < len(standard.moves):
        raise ValueError(f"there is no transition {transition}")
    numbers = {name: float(entry[name]) for name in ("time", "duration", "peak", "impulse")}
    return Scuff(transition, standard.moves[transition].limb, **numbers)


def _first_line(error: BaseException) -> str:
    """The first line of what an error says, or its kind where it says nothing."""
    return (str(error).splitlines() or [""])[0][:200] or type(error).__name__
