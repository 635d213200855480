"""motion.npz and execution.npz: frozen data objects as named arrays, and back."""

from __future__ import annotations

import io
import json
import typing
import zipfile
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.errors import InputError
from toolkit.execution.result import Execution
from toolkit.report.checks import check_entries, read_checks
from toolkit.report.files import plain
from toolkit.wholebody.trajectory import WholeBodyTrajectory

T = TypeVar("T")

_TIMES: dict[str, Any] = {
    "centroidal_seconds": np.float64(np.nan),
    "wholebody_seconds": np.float64(np.nan),
    "tick_seconds": np.zeros(0),
    "replan_seconds": np.float64(np.nan),
    "real_time_factor": np.float64(np.nan),
}
"""What a clock measured, and what is read in its place: it is in the report, and these files are the same whenever the
run is the same."""

_REPLAY = ("timestep", "qpos0", "qvel0", "ctrl", "qpos", "tick_times")  # kept in double precision


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


def unflatten(kind: type[T], arrays: Mapping[str, np.ndarray], prefix: str) -> T:
    """The dataclass that `flatten` took apart.

    Raises:
        KeyError: an array is missing.
    """
    hints = typing.get_type_hints(kind)
    values = {}
    for item in fields(kind):  # type: ignore[arg-type]
        hint = hints[item.name]
        if is_dataclass(hint):
            values[item.name] = unflatten(typing.cast(type, hint), arrays, f"{prefix}{item.name}_")
            continue
        if prefix + item.name not in arrays and _has_default(item):
            continue
        array = arrays[prefix + item.name]
        if hint in (float, int, bool, str):
            values[item.name] = hint(array.item())
        else:
            values[item.name] = tuple(array.tolist()) if typing.get_origin(hint) is tuple else array
    return kind(**values)


def write_motion(path: Path, motion: CentroidalMotion | None, trajectory: WholeBodyTrajectory | None) -> None:
    """Write motion.npz.

    Args:
        path: the file.
        motion: under keys `centroidal_...`, with its problem under `centroidal_problem_...` and the knot times under
            `centroidal_times`.
        trajectory: under keys `wholebody_...`; `wholebody_times` is its time grid.
    """
    arrays: dict[str, np.ndarray] = {}
    if motion is not None:
        arrays |= flatten(motion, "centroidal_") | {"centroidal_times": motion.problem.times}
    if trajectory is not None:
        arrays |= flatten(trajectory, "wholebody_")
    _save(path, arrays)


def read_motion(path: Path) -> tuple[CentroidalMotion | None, WholeBodyTrajectory | None]:
    """Read motion.npz; None for what was not written.

    Raises:
        InputError: the file cannot be read or an array is missing.
    """
    arrays = _load(path)
    try:
        motion = unflatten(CentroidalMotion, arrays, "centroidal_") if "centroidal_com" in arrays else None
        trajectory = unflatten(WholeBodyTrajectory, arrays, "wholebody_") if "wholebody_qpos" in arrays else None
    except KeyError as error:
        raise InputError(f"{path}: has no array {error}; write it anew by running the plan again") from error
    return motion, trajectory


def write_execution(path: Path, execution: Execution) -> None:
    """Write execution.npz: the replay in double precision, the measurements in single.

    The replay: set `qpos0` and `qvel0` on the model of scene.mjb, apply `ctrl` row by row, one `mj_step` each, and
    `qpos[-1]` comes out. `qpos` has a row per control tick (`tick_times`) and the one after the last step. Touchdowns,
    unplanned contacts and checks are JSON text.
    """
    arrays: dict[str, np.ndarray] = {}
    for item in fields(execution):
        value = getattr(execution, item.name)
        if item.name in ("scene", "final_qpos") or value is None:
            continue
        if item.name == "qpos":
            value = np.concatenate([np.atleast_2d(value), execution.final_qpos[None]])
        elif item.name == "checks":
            value = json.dumps(plain(check_entries(value)))
        elif item.name in ("touchdowns", "unplanned_contacts"):
            value = json.dumps(plain(value))
        array = np.asarray(value)
        single = isinstance(value, np.ndarray) and array.dtype == float and item.name not in _REPLAY
        arrays[item.name] = array.astype(np.float32) if single else array
    _save(path, arrays)


def read_execution(path: Path, scene: mujoco.MjModel) -> Execution:
    """Read execution.npz with the model it ran on (`read_scene`).

    Raises:
        InputError: the file cannot be read or an array is missing.
    """
    arrays = _load(path)
    hints = typing.get_type_hints(Execution)
    values: dict[str, Any] = {"scene": scene}
    try:
        for item in fields(Execution):
            if item.name in ("scene", "final_qpos") or (item.name not in arrays and _has_default(item)):
                continue
            array = arrays[item.name]
            if item.name in ("touchdowns", "unplanned_contacts", "checks"):
                entries = json.loads(array.item())
                values[item.name] = tuple(tuple(x) if isinstance(x, list) else x for x in entries)
            elif hints[item.name] in (float, int, bool, str):
                values[item.name] = hints[item.name](array.item())
            elif typing.get_origin(hints[item.name]) is tuple:
                values[item.name] = tuple(array.tolist())
            else:
                values[item.name] = array.astype(float) if array.dtype == np.float32 else array
    except KeyError as error:
        raise InputError(f"{path}: has no array {error}; write it anew by running the plan again") from error
    values["checks"] = read_checks(values["checks"])
    values["qpos"], values["final_qpos"] = values["qpos"][:-1], values["qpos"][-1]
    return Execution(**values)


def _has_default(item: Field) -> bool:
    """Whether a field may be left out (it was None, or is newer than the file)."""
    return item.default is not MISSING or item.default_factory is not MISSING


def _save(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an npz file without what a clock measured: equal arrays make equal files."""
    content = io.BytesIO()
    np.savez(content, **{name: array for name, array in arrays.items() if name not in _TIMES})  # type: ignore[arg-type]
    path.write_bytes(content.getbuffer())


def _load(path: Path) -> dict[str, np.ndarray]:
    """All arrays of an npz file, and stand-ins for times; InputError where it cannot be read."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return _TIMES | {name: archive[name] for name in archive.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, zipfile.BadZipFile, EOFError) as error:
        raise InputError(f"{path}: is not a readable npz file ({error})") from error
