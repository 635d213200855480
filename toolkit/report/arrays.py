"""motion.npz and execution.npz: frozen data objects as named arrays."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.failure import Failure
from toolkit.execution.result import Execution
from toolkit.report.files import check_entries, digest, plain, scene_bytes, scuff_entries
from toolkit.report.standard_entry import standard_entry
from toolkit.wholebody.trajectory import WholeBodyTrajectory

_TIMES = ("centroidal_seconds", "wholebody_seconds", "tick_seconds", "replan_seconds", "real_time_factor")
"""What a clock measured. It is in the report: these files are the same whenever the run is the same."""

_REPLAY = ("timestep", "qpos0", "qvel0", "ctrl", "push", "qpos", "tick_times", "com_aim")  # kept in double precision


def flatten(value: Any, prefix: str) -> dict[str, np.ndarray]:
    """Fields of a dataclass as arrays, keys `prefix` + field name; nested dataclasses append their name and `_`.

    Fields that are None are left out.
    """
    arrays: dict[str, np.ndarray] = {}
    for item in fields(value):
        content = getattr(value, item.name)
        if content is None:
            continue
        if is_dataclass(content):
            arrays |= flatten(content, f"{prefix}{item.name}_")
        else:
            arrays[prefix + item.name] = np.asarray(content)
    return arrays


def write_motion(path: Path, motion: CentroidalMotion, trajectory: WholeBodyTrajectory | None) -> None:
    """Write motion.npz.

    Args:
        path: The file.
        motion: Under keys `centroidal_...`, with the problem that it solves under `centroidal_problem_...` and the knot
            times under `centroidal_times`.
        trajectory: Under keys `wholebody_...`; `wholebody_times` is its time grid.
    """
    solved = replace(motion, problem=motion.solved, status=motion.outcome, kept=None, landed=None, failure=None)
    arrays = flatten(solved, "centroidal_") | {"centroidal_times": np.asarray(motion.problem.times)}
    arrays |= _when(motion.failure, "centroidal_")
    if trajectory is not None:
        arrays |= flatten(replace(trajectory, failure=None), "wholebody_") | _when(trajectory.failure, "wholebody_")
        arrays |= {f"wholebody_{name}": np.asarray(getattr(trajectory, name)) for name in ("feasible", "reason")}
    _save(path, arrays)


def _when(failure: Failure | None, prefix: str = "") -> dict[str, np.ndarray]:
    """The time of a failure, where it is known."""
    if failure is None or failure.time is None:
        return {}
    return {f"{prefix}failure_time": np.asarray(failure.time)}


def write_execution(path: Path, execution: Execution) -> None:
    """Write execution.npz: the replay in double precision, the measurements in single.

    The replay: set `qpos0` and `qvel0` on the model of scene.mjb, apply `ctrl` row by row, one `mj_step` each, and
    `qpos[-1]` comes out. `qpos` has a row per control tick (`tick_times`) and the one after the last step. Where there
    is a `push`, its rows are forces at the base beside the controls. Touchdowns, scuffs, unplanned contacts, checks
    and the standard that the run is held against are JSON text. `scene_digest` is that of scene.mjb.
    """
    arrays = {
        "standard": np.asarray(json.dumps(standard_entry(execution.standard))),
        "scene_digest": np.asarray(digest(scene_bytes(execution.scene))),
    }
    for name, value in execution.named().items():
        if name == "final_qpos" or value is None:
            continue
        if name == "qpos":
            value = np.concatenate([np.atleast_2d(value), execution.controls.final_qpos[None]])
        elif name == "checks":
            value = json.dumps(plain(check_entries(value)))
        elif name == "scuffs":
            value = json.dumps(plain(scuff_entries(value)))
        elif name in ("touchdowns", "unplanned_contacts"):
            value = json.dumps(plain(value))
        array = np.asarray(value)
        single = isinstance(value, np.ndarray) and array.dtype == float and name not in _REPLAY
        arrays[name] = array.astype(np.float32) if single else array
    _save(path, arrays)


def _save(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an npz file without what a clock measured: equal arrays make equal files."""
    content = io.BytesIO()
    np.savez(content, **{name: array for name, array in arrays.items() if name not in _TIMES})  # type: ignore[arg-type]
    path.write_bytes(content.getbuffer())
