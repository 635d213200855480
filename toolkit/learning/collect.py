"""Filling a data set with shards: in parallel, by any executor, and on from where an earlier run was stopped."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.dataset import SCHEMA, Manifest, Samples, read_manifest, read_shard, shard_path, write_shard
from toolkit.learning.shard import CollectConfig, categories_of, collect_shard
from toolkit.robot.model import RobotModel

Counts = dict[Category, tuple[int, int]]
PACKAGES = ("humanoid-contact-toolkit", "numpy", "numba", "mujoco")


class Progress(NamedTuple):
    """How far a collection is: shards and transitions in the data set, seconds since the call."""

    shards: int
    labelled: int
    seconds: float


@dataclass(frozen=True)
class CollectSummary:
    """How a collection went.

    Attributes:
        labelled: transitions in the data set now.
        resumed: of them from before.
        seconds: wall-clock.
        counts: (feasible, all) transitions of each category.
    """

    labelled: int
    resumed: int
    seconds: float
    counts: dict[Category, tuple[int, int]]

    @property
    def feasible_share(self) -> float:
        """Share of all transitions that are feasible."""
        return sum(feasible for feasible, _ in self.counts.values()) / max(self.labelled, 1)

    @property
    def rate(self) -> float:
        """New transitions per second."""
        return (self.labelled - self.resumed) / max(self.seconds, 1e-9)


def _job(config: CollectConfig, index: int, folder: str) -> Counts:
    """Make and write a shard where it runs; returns (feasible, all) by category."""
    samples = collect_shard(config, index)
    write_shard(Path(folder), index, samples)
    return _count(samples)


def collect(
    folder: Path,
    robot: RobotModel,
    config: CollectConfig,
    executor: Executor,
    progress: Callable[[Progress], None] = lambda state: None,
    *,
    ahead: int = 16,
) -> CollectSummary:
    """Fill a data set, going on where an earlier call ended or was killed.

    Args:
        folder: the data set, seen under the same path by every worker.
        robot: that `config.robot` names.
        config: what to collect.
        executor: where shards are made, through the `concurrent.futures` interface.
        progress: told how far it is.
        ahead: shards handed to the executor at a time.

    Returns:
        Counts and rates.

    Raises:
        DatasetError: the folder holds something else, or data of other settings or of another robot.
    """
    began = time.perf_counter()
    _prepare(folder, robot, config)
    counts = {category: np.zeros(2, int) for category in categories_of(robot)}
    missing = []
    for index in range(config.shards):
        path = shard_path(folder, index)
        if path.is_file():
            _add(counts, _count(read_shard(path)))  # a broken one is refused by name, not kept in silence
        else:
            missing.append(index)
    resumed = labelled = _total(counts)
    done = config.shards - len(missing)
    progress(Progress(done, labelled, 0.0))
    waiting: set[Future] = set()
    try:
        while missing or waiting:
            while missing and len(waiting) < ahead:
                waiting.add(executor.submit(_job, config, missing.pop(0), str(folder.resolve())))
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in finished:
                _add(counts, future.result())
                done, labelled = done + 1, _total(counts)
                progress(Progress(done, labelled, time.perf_counter() - began))
    except BaseException:
        for future in waiting:
            future.cancel()
        raise
    return CollectSummary(
        labelled,
        resumed,
        time.perf_counter() - began,
        {category: (int(pair[0]), int(pair[1])) for category, pair in counts.items()},
    )


def _count(samples: dict[Category, Samples]) -> Counts:
    """(feasible, all) by category."""
    return {category: (int(group.feasible.sum()), len(group)) for category, group in samples.items()}


def _add(counts: dict[Category, np.ndarray], more: Counts) -> None:
    for category, pair in more.items():
        counts[category] += pair


def _total(counts: dict[Category, np.ndarray]) -> int:
    return int(sum(pair[1] for pair in counts.values()))


def _prepare(folder: Path, robot: RobotModel, config: CollectConfig) -> None:
    """Make the folder and its manifest, or check the manifest that is there."""
    settings = {k: v for k, v in asdict(config).items() if k not in ("robot", "robots", "seed", "samples_per_category")}
    settings = {k: list(v) if isinstance(v, tuple) else v for k, v in settings.items()}
    versions = {name: metadata.version(name) for name in PACKAGES}
    wanted = Manifest(SCHEMA, robot.name, robot.fingerprint, config.seed, settings, versions)
    if (folder / "manifest.json").is_file():
        found = read_manifest(folder)
        for name in ("robot", "fingerprint", "seed", "settings"):
            if getattr(found, name) != getattr(wanted, name):
                raise DatasetError(
                    f"{folder}: begun with {name} {getattr(found, name)!r}, now {getattr(wanted, name)!r}; "
                    "use another --out, or the same options"
                )
        return
    if folder.exists() and any(folder.iterdir()):
        raise DatasetError(f"{folder}: not empty and not a data set; use another --out")
    folder.mkdir(parents=True, exist_ok=True)
    wanted.write(folder)
