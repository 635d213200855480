"""The folder of a run: written whole or not at all, and the names of the files in it."""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import mujoco

from toolkit.errors import InputError
from toolkit.execution.check import Check

REPORT = "report.json"
PLAN = "plan.json"
MOTION = "motion.npz"
EXECUTION = "execution.npz"
SCENE = "scene.mjb"
RECORDING = "recording.rrd"

_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO)


def default_folder(world: str, robot: str) -> Path:
    """`runs/<world>-<robot>-<time>` below the working directory, with a number behind it where it exists already."""
    name = f"{world}-{robot}-{time.strftime('%Y%m%d-%H%M%S')}"
    path, count = Path("runs") / name, 1
    while path.exists():
        count += 1
        path = Path("runs") / f"{name}-{count}"
    return path


class RunFolder:
    """A folder that appears under its name only when everything in it has been written.

    Used as a context manager; files go into `path`, a hidden sibling of the target. Leaving the block without an
    exception renames it to the target; leaving it with one (a KeyboardInterrupt too) removes it, together with the
    parent folders that were made for it. A target that is an earlier run (it has a report.json) or an empty folder
    is replaced at the end in one rename and kept as it was on failure; anything else that exists is refused.
    """

    def __init__(self, out: Path | None, world: str, robot: str):
        """Choose and check the target.

        Args:
            out: target folder; None for `default_folder`.
            world: name of the world.
            robot: name of the robot.

        Raises:
            InputError: `out` cannot be written, or exists and is neither an empty folder nor an earlier run.
        """
        self.target = Path(os.path.realpath(out)) if out is not None else default_folder(world, robot).absolute()
        self._made_parents: list[Path] = []
        self._path: Path | None = None
        _check_target(self.target, Path(out) if out is not None else self.target)

    @property
    def path(self) -> Path:
        """The folder to write into, valid inside the `with` block."""
        if self._path is None:
            raise RuntimeError("a RunFolder is written to inside its `with` block")
        return self._path

    def __enter__(self) -> RunFolder:
        parent = self.target.parent
        missing = [folder for folder in [parent, *parent.parents] if not folder.exists()]
        path = parent / f".{self.target.name}.{uuid.uuid4().hex[:8]}.tmp"
        try:
            for folder in reversed(missing):
                folder.mkdir()
                self._made_parents.append(folder)
            path.mkdir()
        except OSError as error:
            self._remove_parents()
            raise InputError(f"{parent}: cannot write there ({error.strerror}); choose another --out") from error
        self._path = path
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        path, self._path = self.path, None
        if kind is not None:
            shutil.rmtree(path, ignore_errors=True)
            self._remove_parents()
            if isinstance(error, OSError) and error.errno in _UNWRITABLE:
                raise InputError(f"{self.target}: cannot be written ({error.strerror})") from error
            return
        _replace(path, self.target)

    def _remove_parents(self) -> None:
        """Remove the parent folders that were made, innermost first, as long as they are empty."""
        for folder in reversed(self._made_parents):
            try:
                folder.rmdir()
            except OSError:
                return


def _check_target(target: Path, shown: Path) -> None:
    """Raise InputError unless `target` can be made, is an empty folder, or is an earlier run."""
    parent = next(folder for folder in target.parents if folder.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{shown}: cannot write into {parent}; give --out another folder")
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(f"{shown}: is a file; give --out a folder")
    if any(target.iterdir()) and not (target / REPORT).is_file():
        raise InputError(f"{shown}: exists, is not empty and is not an earlier run; give --out a new folder")


def _replace(path: Path, target: Path) -> None:
    """Rename the finished `path` to `target`; what is there moves aside first and comes back if that fails."""
    _check_target(target, target)
    aside = None
    if target.exists():
        aside = path.with_suffix(".old")
        target.rename(aside)
    try:
        path.rename(target)
    except OSError:
        if aside is not None:
            aside.rename(target)
        shutil.rmtree(path, ignore_errors=True)
        raise
    if aside is not None:
        shutil.rmtree(aside, ignore_errors=True)


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, numbers that are not finite (inf, NaN) as null."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, str) or value is None:
        return value if value is None else str(value)
    if hasattr(value, "tolist"):  # arrays and NumPy scalars
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (bool, int)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value)


def check_entries(checks: Sequence[Check]) -> list[dict[str, Any]]:
    """Checks as JSON holds them, with their result."""
    return [
        {"name": c.name, "value": c.value, "limit": c.limit, "unit": c.unit, "result": c.result.value} for c in checks
    ]


def write_json(path: Path, value: Any) -> None:
    """Write strict JSON (see `plain`), indented, lists of numbers on one line, ending in a line break."""
    path.write_text(_json_text(plain(value), "") + "\n", encoding="utf-8")


def _json_text(value: Any, indent: str) -> str:
    """JSON in lines, `indent` before each but the first; a list without lists or dictionaries stays on one line."""
    inner = indent + "  "
    if isinstance(value, dict) and value:
        key = [json.dumps(name, ensure_ascii=False) for name in value]
        lines = [f"{inner}{k}: {_json_text(v, inner)}" for k, v in zip(key, value.values(), strict=True)]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, (list, dict)) for item in value):
        return "[\n" + ",\n".join(inner + _json_text(item, inner) for item in value) + f"\n{indent}]"
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        InputError: the file cannot be read or is not JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise InputError(f"{path}: is not a JSON file ({error})") from error


def write_scene(path: Path, scene: mujoco.MjModel) -> None:
    """Save a compiled model; `mujoco.MjModel.from_binary_path` reads it."""
    mujoco.mj_saveModel(scene, str(path), None)
