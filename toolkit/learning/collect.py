"""Filling a data set with shards: in parallel, by any executor, continuing where an earlier run stopped."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from toolkit.contacts.category import Category, categories_of
from toolkit.drafts import clear_drafts
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.dataset import SCHEMA, Manifest, begin, plain_settings, read_shard, shard_path, write_shard
from toolkit.learning.jobs import run_jobs
from toolkit.learning.samples import Samples
from toolkit.learning.shard import collect_shard
from toolkit.robot.model import RobotModel

PACKAGES = ("humanoid-contact-toolkit", "numpy", "numba", "mujoco")
Counts = Counter[tuple[Category, str]]
"""Numbers of transitions by category: "all" of them, those "feasible", and those "labelled", whose outcome is known."""


@dataclass(frozen=True)
class Collected:
    """State of a collection.

    Attributes:
        shards: Number of shards in the data set.
        samples: Number of transitions in the data set.
        feasible: Number of feasible ones.
        labelled: Number of those whose outcome in a whole motion is known.
        resumed: Number of these that were there before this call.
        labels: Number of labels of each category.
        seconds: Wall-clock time of this call.
    """

    shards: int
    samples: int
    feasible: int
    labelled: int
    resumed: int
    labels: dict[Category, int]
    seconds: float


def _job(config: CollectConfig, index: int, folder: str) -> Counts:
    """Make and write a shard; returns its counts."""
    samples = collect_shard(config, index)
    write_shard(Path(folder), index, samples)
    return _count(samples)


def collect(
    folder: Path,
    robot: RobotModel,
    config: CollectConfig,
    executor: Executor,
    progress: Callable[[Collected], None] = lambda state: None,
    *,
    ahead: int = 16,
) -> Collected:
    """Fill a data set, continuing where an earlier call ended or was killed.

    Args:
        folder: The data set; every worker must see it under the same path.
        robot: The robot that `config.robot` names.
        config: What to collect.
        executor: Where shards are made.
        progress: Is called with the state after every shard.
        ahead: Number of shards that wait in the executor at a time.

    Raises:
        DatasetError: The folder holds something else, or data of other settings or of another robot.
    """
    began = time.perf_counter()
    # A larger collection of the same kind continues the same data set.
    settings = plain_settings(config, "robot", "robots", "seed", "samples_per_category", "networks")
    versions = {name: metadata.version(name) for name in PACKAGES}
    begin(folder, Manifest(SCHEMA, robot.name, robot.fingerprint, config.seed, settings, versions))
    counts, missing = Counts(), []
    for index in range(config.shards):
        path = shard_path(folder, index)
        if path.is_file():
            counts += _count(read_shard(path))  # raises an error if the shard is broken
        else:
            missing.append(index)

    def number(name: str) -> int:
        return sum(counts[category, name] for category in Category)

    resumed, done = number("labelled"), config.shards - len(missing)

    def state() -> Collected:
        labels = {category: counts[category, "labelled"] for category in categories_of(robot)}
        seconds = time.perf_counter() - began
        return Collected(done, number("all"), number("feasible"), number("labelled"), resumed, labels, seconds)

    def take(more: Counts) -> None:
        nonlocal done
        counts.update(more)
        done += 1
        progress(state())

    progress(state())
    jobs = [(config, index, str(folder.resolve())) for index in missing]
    run_jobs(executor, _job, jobs, take, ahead=ahead)
    clear_drafts(folder)  # of workers that were killed
    return state()


def _count(samples: dict[Category, Samples]) -> Counts:
    counts = Counts()
    for category, group in samples.items():
        counts[category, "all"] = len(group)
        counts[category, "feasible"] = int(group.feasible.sum())
        counts[category, "labelled"] = int(group.known.sum())
    return counts
