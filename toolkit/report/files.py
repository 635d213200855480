"""The folder of a run: whole or not there, and the names of the files in it."""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import time
import weakref
from collections.abc import Collection, Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

import mujoco
import numpy as np

from toolkit.drafts import clear_drafts, draft_in, is_draft, is_left, make_folders, remove, remove_folders
from toolkit.errors import InputError
from toolkit.execution.check import Check, Result
from toolkit.execution.scuff import Scuff
from toolkit.interruption import undisturbed

REPORT = "report.json"
PLAN = "plan.json"
MOTION = "motion.npz"
EXECUTION = "execution.npz"
SCENE = "scene.mjb"
RECORDING = "recording.rrd"

PICTURES = ("plan.png", "execution.png", "strip.png", "video.mp4")
FILES = frozenset({REPORT, PLAN, MOTION, EXECUTION, SCENE, RECORDING, *PICTURES})
"""Every file that a run writes into its folder."""

_IN_USE = "another run is writing there; give --out another folder, or wait for its end"
_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO)


class RunFolder:
    """The folder of a run, whose files appear together or not at all.

    Used as a context manager around the whole run: entering makes the folder, so that one that cannot be written is
    found out before any work, and two runs never share one. Files go into `path`, a hidden draft inside. Leaving the
    block without an exception moves them up, the report last; leaving it with one (a KeyboardInterrupt too) removes the
    draft and every folder that was made. The files of an earlier run are replaced at the end, and stay as they were on
    failure. A folder that holds anything which no run writes is refused: nothing else is ever removed. What a killed
    run left is cleared away by the next one that uses the folder, or that names its own.
    """

    def __init__(
        self,
        out: Path | None,
        world: str,
        robot: str,
        also: Collection[str] = (),
        files: Collection[str] = FILES,
        kind: str = "run",
    ):
        """Choose and check the target.

        Args:
            out: target folder; None for `runs/<world>-<robot>-<time>` below the working directory, with a number
                behind it where that exists already.
            world: name of the world.
            robot: name of the robot.
            also: names of further files that the run writes, apart from `files`.
            files: names of the files that it writes; those of a run where not given. The report is among them.
            kind: what such a folder is called in messages.

        Raises:
            InputError: `out` cannot be written, or holds something other than an earlier run.
        """
        self._files = frozenset(files) | set(also)
        self._kind = kind
        self._unnamed = out is None
        if out is None:
            name = f"{world}-{robot}-{time.strftime('%Y%m%d-%H%M%S')}".replace("/", "_")
            out = Path("runs") / os.fsencode(name)[-200:].decode("utf-8", "ignore")
        self._shown = out
        self.target = Path(os.path.realpath(out))
        self._path: Path | None = None
        self._earlier: set[str] = set()
        if not self._unnamed:
            self._check()

    @property
    def path(self) -> Path:
        """The folder to write into, valid inside the `with` block."""
        if self._path is None:
            raise RuntimeError("a RunFolder is written to inside its `with` block")
        return self._path

    def __enter__(self) -> RunFolder:
        made: list[Path] = []
        with undisturbed():
            self._undo = weakref.finalize(self, _undo, made)
            try:
                if self._unnamed:
                    self._choose(made)
                made += make_folders(self.target)
                draft = draft_in(self.target)
                draft.mkdir()
                made.append(draft)
                if any(is_draft(name) and not is_left(name) and name != draft.name for name in os.listdir(self.target)):
                    raise InputError(f"{self._shown}: {_IN_USE}")
                clear_drafts(self.target)
                self._earlier = set(os.listdir(self.target)) - {draft.name}
                self._path = draft
            except OSError as error:
                self._undo()
                raise InputError(f"{self._shown}: cannot write there ({error.strerror}); give another --out") from error
            except InputError:
                self._undo()
                raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with undisturbed():
            try:
                if kind is None:
                    self._publish()
            except OSError as failure:
                error = failure
            self._undo()
        if isinstance(error, OSError) and (kind is None or error.errno in _UNWRITABLE):
            raise InputError(f"{self._shown}: cannot be written ({error.strerror or error})") from error

    def _choose(self, made: list[Path]) -> None:
        """Make a folder under a name that none had, and clear away what killed runs left in those beside it."""
        wanted, count = self.target, 1
        made += make_folders(wanted.parent)
        for beside in [Path(entry.path) for entry in os.scandir(wanted.parent) if entry.is_dir(follow_symlinks=False)]:
            if clear_drafts(beside):
                remove_folders([beside])
        while True:
            try:
                self.target.mkdir()
            except FileExistsError:
                count += 1
                self.target = wanted.with_name(f"{wanted.name}-{count}")
            else:
                made.append(self.target)
                self._shown = self.target
                return

    def _check(self) -> None:
        """Raise InputError unless the target can be made, or holds nothing but an earlier run."""
        target, shown = self.target, self._shown
        if not os.path.lexists(target):
            parent = next(folder for folder in target.parents if os.path.lexists(folder))
            if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
                raise InputError(f"{shown}: cannot write into {parent}; give --out another folder")
            return
        if not target.is_dir():
            raise InputError(f"{shown}: is a file; give --out a folder")
        try:
            entries = list(os.scandir(target))
        except OSError as error:
            raise InputError(f"{shown}: cannot be read ({error.strerror}); give --out another folder") from error
        drafts = [entry.name for entry in entries if is_draft(entry.name)]
        if not all(is_left(name) for name in drafts):
            raise InputError(f"{shown}: {_IN_USE}")
        files = [entry for entry in entries if not is_draft(entry.name)]
        if files and not drafts and not _is_report(target / REPORT):
            raise InputError(
                f"{shown}: exists, is not empty and is not an earlier {self._kind}; give --out a new folder"
            )
        for entry in files:
            if entry.name not in self._files or not entry.is_file(follow_symlinks=False):
                raise InputError(
                    f"{shown}: holds {entry.name}, which no {self._kind} has written; give --out a new folder, "
                    "or move it away"
                )

    def _publish(self) -> None:
        """Move the files of the draft into the target, and those of an earlier run out of it; all or none."""
        strange = (set(os.listdir(self.target)) - self._earlier) & self._files
        if strange:
            raise FileExistsError(errno.EEXIST, f"{min(strange)} has come into it meanwhile")
        old = self.path / "earlier"
        new = sorted(os.listdir(self.path), key=lambda name: name == REPORT)
        replaced = sorted(set(os.listdir(self.target)) & self._earlier, key=lambda name: name != REPORT)
        old.mkdir()
        moves = [(self.target / name, old / name) for name in replaced]
        moves += [(self.path / name, self.target / name) for name in new]
        done: list[tuple[Path, Path]] = []
        try:
            for source, place in moves:
                source.rename(place)
                done.append((source, place))
        except BaseException:
            for source, place in reversed(done):
                place.rename(source)
            raise


def _undo(made: list[Path]) -> None:
    """Remove the draft, and the folders that were made for it as far as they are empty."""
    for path in reversed(made):
        if is_draft(path.name):
            remove(path)
        else:
            remove_folders([path])


def _is_report(path: Path) -> bool:
    """Whether a file is the report of a run."""
    try:
        content = read_json(path)
    except InputError:
        return False
    return isinstance(content, dict) and {"schema", "verdict", "stages"} <= content.keys()


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, numbers that are not finite (inf, NaN) as null."""
    if isinstance(value, dict):
        return {plain(str(key)): plain(item) for key, item in value.items()}
    if isinstance(value, (str, Path)):
        return str(value).encode("utf-8", "backslashreplace").decode("utf-8")  # a name need not be text
    if value is None:
        return None
    if hasattr(value, "tolist"):  # arrays and NumPy scalars
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (bool, int)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return plain(str(value))


def check_entries(checks: Sequence[Check]) -> list[dict[str, Any]]:
    """Checks as JSON holds them, with their result."""
    return [
        {"name": c.name, "value": c.value, "limit": c.limit, "unit": c.unit, "result": c.result.value} for c in checks
    ]


def scuff_entries(scuffs: Sequence[Scuff]) -> list[dict[str, Any]]:
    """Scuffs as JSON holds them."""
    return [{**asdict(each), "limb": each.limb.label} for each in scuffs]


def read_check(entry: dict[str, Any]) -> Check:
    """A check from its entry; raises KeyError, TypeError or ValueError where the entry is broken.

    A value that is not finite is null in JSON; its result tells it from one that was not measured.
    """
    value = entry["value"]
    if value is None and Result(entry["result"]) is Result.FAIL:
        value = math.inf
    return Check(str(entry["name"]), float(entry["limit"]), str(entry["unit"]), None if value is None else float(value))


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
    except RecursionError as error:
        raise InputError(f"{path}: lists lie too deep in one another") from error
    except ValueError as error:
        raise InputError(f"{path}: is not a JSON file ({error})") from error


def scene_bytes(scene: mujoco.MjModel) -> bytes:
    """A compiled model as scene.mjb holds it."""
    content = np.zeros(mujoco.mj_sizeModel(scene), np.uint8)
    mujoco.mj_saveModel(scene, None, content)
    return content.tobytes()


def write_scene(path: Path, scene: mujoco.MjModel) -> None:
    """Save a compiled model; `mujoco.MjModel.from_binary_path` reads it."""
    path.write_bytes(scene_bytes(scene))


def digest(content: bytes) -> str:
    """SHA-256 of a file's content, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()
