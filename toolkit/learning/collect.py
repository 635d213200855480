"""Filling a data set with shards: in parallel, by any executor, and on from where an earlier run was stopped."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.contacts.category import Category, categories_of
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.dataset import (
    SCHEMA,
    Manifest,
    begin,
    plain_settings,
    read_shard,
    shard_path,
    write_shard,
)
from toolkit.learning.jobs import run_jobs
from toolkit.learning.samples import Samples
from toolkit.learning.shard import collect_shard
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
        labelled: number of transitions in the data set now.
        resumed: number of those that were there before.
        seconds: wall-clock time.
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
        robot: the robot that `config.robot` names.
        config: what to collect.
        executor: where shards are made, through the `concurrent.futures` interface.
        progress: is told how far it is.
        ahead: shards handed to the executor at a time.

    Returns:
        Counts and rates.

    Raises:
        DatasetError: the folder holds something else, or data of other settings or of another robot.
    """
    began = time.perf_counter()
    begin(folder, _manifest(robot, config))
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

    def take(more: Counts) -> None:
        nonlocal done, labelled
        _add(counts, more)
        done, labelled = done + 1, _total(counts)
        progress(Progress(done, labelled, time.perf_counter() - began))

    jobs = [(config, index, str(folder.resolve())) for index in missing]
    run_jobs(executor, _job, jobs, take, ahead=ahead)
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


def _manifest(robot: RobotModel, config: CollectConfig) -> Manifest:
    """What a collection asks for: a larger one of the same kind goes on with the same data set."""
    settings = plain_settings(config, "robot", "robots", "seed", "samples_per_category")
    versions = {name: metadata.version(name) for name in PACKAGES}
    return Manifest(SCHEMA, robot.name, robot.fingerprint, config.seed, settings, versions)
