"""Drafts: what is being written has another name until it is whole, and that name tells whose it is."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import socket
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

from toolkit.errors import InputError
from toolkit.interruption import undisturbed

_NAME = re.compile(r"\.(?P<owner>[^/]+)\.(?P<process>\d+)-(?P<start>\d+)\.tmp")

_WRITING = threading.Lock()


def draft_in(folder: Path) -> Path:
    """Where this process may write what will belong into `folder`: a hidden entry of it that tells whose it is."""
    return folder / f".{_owner()}.{os.getpid()}-{_start(os.getpid()) or 0}.tmp"


def is_draft(name: str) -> bool:
    """Whether a file or folder of this name is a draft."""
    return _NAME.fullmatch(name) is not None


def is_left(name: str) -> bool:
    """Whether this is the name of a draft whose process has ended.

    A process that cannot be seen from here (on another machine, or in another container) counts as one that goes on.
    """
    match = _NAME.fullmatch(name)
    if match is None or match["owner"] != _owner():
        return False
    process = int(match["process"])
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):  # it is somebody else's
        pass
    return _start(process) not in (None, int(match["start"]))


def clear_drafts(folder: Path) -> bool:
    """Remove the drafts in a folder whose processes have ended: they were killed. Returns whether there were any."""
    with contextlib.suppress(OSError):
        left = [Path(entry.path) for entry in os.scandir(folder) if is_left(entry.name)]
        for path in left:
            remove(path)
        return bool(left)
    return False


def remove(path: Path) -> None:
    """Remove a file, or a folder with all in it, as far as that is possible."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()


def make_folders(folder: Path) -> Iterator[Path]:
    """Make a folder and those above it that are missing; yields each that was made, outermost first."""
    missing = []
    for path in (folder, *folder.parents):
        if os.path.lexists(path):
            break
        missing.append(path)
    for path in reversed(missing):
        path.mkdir()
        yield path


def remove_folders(folders: Iterable[Path]) -> None:
    """Remove folders, the last one first, up to the first that is not empty."""
    for folder in reversed(list(folders)):
        try:
            folder.rmdir()
        except OSError:
            return


def write_whole(path: Path, content: bytes, option: str = "--out") -> None:
    """Write a file that appears whole or not at all, with the folders above it; a device is written to directly.

    Args:
        path: The file. One that exists is replaced, or where it is a link, the file that the link leads to.
        content: What it holds.
        option: What a user gives to write elsewhere, for the message.

    Raises:
        InputError: It cannot be written. Nothing is left then.
    """
    place = Path(os.path.realpath(path))
    made: list[Path] = []
    try:
        if place.is_char_device():
            place.write_bytes(content)
            return
        if place.exists() and not place.is_file():
            raise InputError(f"{path}: is a folder or no ordinary file; choose another {option}")
        with _WRITING, undisturbed():  # threads share the name of the draft
            try:
                made += make_folders(place.parent)
                clear_drafts(place.parent)
                with draft_in(place.parent).open("wb") as file:
                    file.write(content)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(draft_in(place.parent), place)
            except OSError:
                remove(draft_in(place.parent))
                remove_folders(made)
                raise
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another {option}") from error


def _owner() -> str:
    """This machine, and where it has containers, which of them: processes are numbered anew in each."""
    try:
        container = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        container = 0
    return f"{re.sub('[^A-Za-z0-9-]', '-', socket.gethostname())[:64]}-{container:x}"


def _start(process: int) -> int | None:
    """When a process began, in ticks since the machine did: its number may have been another's before.

    This is 0 for one that has ended and whose parent has not asked after it yet, and None where it cannot be told.
    """
    try:
        state, *rest = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return 0 if state == "Z" else int(rest[18])
