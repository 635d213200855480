"""Filling a data set with clips: in parallel, by any executor, continuing where an earlier run stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from importlib import metadata
from itertools import count
from pathlib import Path

from toolkit.clips.attempt import (
    ATTEMPTS,
    CLIPS,
    ROBOT,
    RUNS,
    ClipConfig,
    Record,
    attempt,
    name_of,
    read_records,
    remove_attempt,
)
from toolkit.drafts import clear_drafts
from toolkit.errors import DatasetError, PlanningError
from toolkit.exchange.folder import write_robot
from toolkit.learning.dataset import Manifest, begin, plain_settings, read_manifest
from toolkit.learning.jobs import run_jobs
from toolkit.robot.model import RobotModel

SCHEMA, COMMAND = "motion-data-1", "toolkit.dataset"
PATIENCE = 100
"""Attempts in a row that may fail before a collection gives up."""
_PACKAGES = ("humanoid-contact-toolkit", "mujoco", "numpy", "numba", "pin", "placo", "daqp")


@dataclass(frozen=True)
class State:
    """How far a collection is.

    Attributes:
        seconds: s of motion that are kept.
        attempts, clips: Number of worlds that were tried, and of those that passed.
        last: Record of the last attempt; None at the beginning.
    """

    seconds: float
    attempts: int
    clips: int
    last: Record | None = None


def collect(
    folder: Path,
    robot: RobotModel,
    config: ClipConfig,
    hours: float,
    pool: Executor,
    progress: Callable[[State], None] = lambda state: None,
    *,
    ahead: int = 16,
) -> list[Record]:
    """Make clips until there are so many hours of motion, continuing where an earlier call ended or was killed.

    The attempts of a data set are numbered, and it ends with the first one that makes it long enough. So it is the same
    whoever made which of them when.

    Args:
        folder: The data set; every worker must see it under the same path.
        robot: The robot that `config.robot` names.
        config: What the clips are made with.
        hours: Hours of motion.
        pool: Where the attempts are made.
        progress: Is called with the state at the beginning and after every attempt.
        ahead: Number of attempts that wait in the pool at a time.

    Returns:
        The records of all attempts, in order.

    Raises:
        DatasetError: The folder holds something else, data of other settings or of another robot, or more hours.
        PlanningError: `PATIENCE` attempts in a row failed.
    """
    _begin(folder, robot, config, hours)
    records, wanted = read_records(folder), 3600.0 * hours

    def state(last: Record | None = None) -> State:
        kept = [record for record in records.values() if record["passed"]]
        return State(_seconds(kept), len(records), len(kept), last)

    def take(record: Record) -> None:
        records[int(record["attempt"])] = record
        _check_patience(records)
        progress(state(record))

    def missing() -> Iterator[tuple[ClipConfig, int, str]]:
        for index in count():
            if _seconds([record for number, record in records.items() if number < index]) >= wanted:
                return
            if index not in records:
                yield config, index, str(folder.resolve())

    progress(state())
    run_jobs(pool, attempt, missing(), take, ahead=ahead)
    for place in (folder, folder / ATTEMPTS):
        clear_drafts(place)  # of workers that were killed
    return _ended(folder, records, wanted)


def so_far(folder: Path) -> list[Record]:
    """Records of the attempts that a data set which is not at its end is made of until now, in order."""
    records = read_records(folder)
    return [records[index] for index in range(next(index for index in count() if index not in records))]


def manifest_of(folder: Path) -> Manifest:
    """The manifest of a data set of motions.

    Raises:
        DatasetError: There is none, or it cannot be read.
    """
    return read_manifest(folder, SCHEMA, COMMAND)


def _begin(folder: Path, robot: RobotModel, config: ClipConfig, hours: float) -> None:
    """Make the data set's folder with its manifest and its robot, or check what is there."""
    settings = plain_settings(config, "robot", "robots", "seed")
    versions = {name: metadata.version(name) for name in _PACKAGES}
    wanted = Manifest(SCHEMA, robot.name, robot.fingerprint, config.seed, settings | {"hours": hours}, versions)
    found = hours
    if (folder / "manifest.json").is_file():
        found = manifest_of(folder).settings.get("hours", hours)
        if found > hours:
            raise DatasetError(
                f"{folder}: begun with --hours {found:g}, now {hours:g}; give at least as many, or another --out"
            )
    begin(folder, replace(wanted, settings=settings | {"hours": found}), COMMAND)
    if found < hours:
        wanted.write(folder)
    (folder / ROBOT).mkdir(exist_ok=True)
    write_robot(folder / ROBOT, robot)


def _seconds(records: list[Record]) -> float:
    """Motion in some records, s."""
    return sum(float(record["duration"]) for record in records if record["passed"])


def _check_patience(records: dict[int, Record]) -> None:
    """Raise where the last attempts in a row have all failed.

    Raises:
        PlanningError: They have.
    """
    done = next(index for index in count() if index not in records)
    last = [records[index] for index in range(max(done - PATIENCE, 0), done)]
    if len(last) == PATIENCE and not any(record["passed"] for record in last):
        raise PlanningError(
            f"none of the last {PATIENCE} worlds passed, the last one for: {last[-1]['reason']}; what there is "
            "is kept; give other --kinds, or see whether python -m toolkit.validate passes in one world"
        )


def _ended(folder: Path, records: dict[int, Record], wanted: float) -> list[Record]:
    """Records of the data set; what workers made beyond its end is removed."""
    ordered: list[Record] = []
    while _seconds(ordered) < wanted:
        ordered.append(records[len(ordered)])
    for index in records.keys() - range(len(ordered)):
        remove_attempt(folder, index)
    known = {name_of(index) for index, record in enumerate(ordered) if record["passed"]}
    for kind in (CLIPS, RUNS):  # a worker that was killed leaves a run or a clip without a record
        for path in (folder / kind).glob("[0-9]*"):
            if path.name not in known:
                remove_attempt(folder, int(path.name))
    return ordered
