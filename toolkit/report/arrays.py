"""motion.npz and execution.npz: frozen data objects as named arrays, and back."""

from __future__ import annotations

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
from toolkit.execution.result import Controls, Execution, Samples
from toolkit.replanning.replanner import ReplanCounts
from toolkit.report.checks import check_entries, read_checks
from toolkit.report.files import plain
from toolkit.wholebody.trajectory import WholeBodyTrajectory

T = TypeVar("T")

_REPLAY = ("timestep", "qpos0", "qvel0", "ctrl", "qpos", "tick_times")  # kept in double precision
_GROUPS = {"controls": Controls, "samples": Samples, "replanning": ReplanCounts}


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
    np.savez(path, **arrays)  # type: ignore[arg-type]


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
    for name, value in execution.named().items():
        if name == "final_qpos" or value is None:
            continue
        if name == "qpos":
            value = np.concatenate([np.atleast_2d(value), execution.controls.final_qpos[None]])
        elif name == "checks":
            value = json.dumps(plain(check_entries(value)))
        elif name in ("touchdowns", "unplanned_contacts"):
            value = json.dumps(plain(value))
        array = np.asarray(value)
        single = isinstance(value, np.ndarray) and array.dtype == float and name not in _REPLAY
        arrays[name] = array.astype(np.float32) if single else array
    np.savez(path, **arrays)  # type: ignore[arg-type]


def read_execution(path: Path, scene: mujoco.MjModel) -> Execution:
    """Read execution.npz with the model it ran on (`read_scene`).

    Raises:
        InputError: the file cannot be read or an array is missing.
    """
    arrays = _load(path)
    try:
        qpos = arrays.pop("qpos")
        arrays |= {"qpos": qpos[:-1], "final_qpos": qpos[-1]}
        groups = {name: _read_fields(kind, arrays) for name, kind in _GROUPS.items()}
        values = _read_fields(Execution, arrays, skip=("scene", *groups))
    except KeyError as error:
        raise InputError(f"{path}: has no array {error}; write it anew by running the plan again") from error
    values["checks"] = read_checks(values["checks"])
    return Execution(scene=scene, **{name: _GROUPS[name](**group) for name, group in groups.items()}, **values)


def _read_fields(kind: type, arrays: Mapping[str, np.ndarray], skip: tuple[str, ...] = ()) -> dict[str, Any]:
    """Values of a dataclass' fields."""
    hints, values = typing.get_type_hints(kind), {}
    for item in fields(kind):
        if item.name in skip or (item.name not in arrays and _has_default(item)):
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
    return values


def _has_default(item: Field) -> bool:
    """Whether a field may be left out (it was None, or is newer than the file)."""
    return item.default is not MISSING or item.default_factory is not MISSING


def _load(path: Path) -> dict[str, np.ndarray]:
    """All arrays of an npz file; InputError where it cannot be read."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, zipfile.BadZipFile, EOFError) as error:
        raise InputError(f"{path}: is not a readable npz file ({error})") from error
