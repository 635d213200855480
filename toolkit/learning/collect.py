"""Filling a data set with shards: in parallel, by any executor, and on from where an earlier run was stopped."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from toolkit.contacts.category import Category, categories_of
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.dataset import SCHEMA, Manifest, begin, plain_settings, read_shard, shard_path, write_shard
from toolkit.learning.jobs import run_jobs
from toolkit.learning.samples import Samples
from toolkit.learning.shard import collect_shard
from toolkit.robot.model import RobotModel

PACKAGES = ("humanoid-contact-toolkit", "numpy", "numba", "mujoco")
Counts = Counter[tuple[Category, bool]]
"""Numbers of transitions by category and label."""


@dataclass(frozen=True)
class Collected:
    """How far a collection is.

    Attributes:
        shards: number of shards in the data set.
        labelled: number of transitions in the data set.
        resumed: number of those that were there before.
        feasible: number of those that are feasible.
        fewest: number of transitions of the rarest category.
        seconds: wall-clock time of this call.
    """

    shards: int
    labelled: int
    resumed: int
    feasible: int
    fewest: int
    seconds: float

    @property
    def feasible_share(self) -> float:
        """Share of all transitions that are feasible."""
        return self.feasible / max(self.labelled, 1)

    @property
    def rate(self) -> float:
        """New transitions per second."""
        return (self.labelled - self.resumed) / max(self.seconds, 1e-9)


def _job(config: CollectConfig, index: int, folder: str) -> Counts:
    """Make and write a shard where it runs; what it counts."""
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
    """Fill a data set, going on where an earlier call ended or was killed.

    Args:
        folder: the data set, seen under the same path by every worker.
        robot: the robot that `config.robot` names.
        config: what to collect.
        executor: where shards are made, through the `concurrent.futures` interface.
        progress: is told how far it is.
        ahead: shards handed to the executor at a time.

    Returns:
        How far it came.

    Raises:
        DatasetError: the folder holds something else, or data of other settings or of another robot.
    """
    began = time.perf_counter()
    begin(folder, _manifest(robot, config))
    counts, missing = Counts(), []
    for index in range(config.shards):
        path = shard_path(folder, index)
        if path.is_file():
            counts += _count(read_shard(path))  # a broken one is refused by name, not kept in silence
        else:
            missing.append(index)
    resumed, done = counts.total(), config.shards - len(missing)

    def state() -> Collected:
        feasible = sum(number for (_, label), number in counts.items() if label)
        fewest = min(counts[category, True] + counts[category, False] for category in categories_of(robot))
        return Collected(done, counts.total(), resumed, feasible, fewest, time.perf_counter() - began)

    def take(more: Counts) -> None:
        nonlocal done
        counts.update(more)
        done += 1
        progress(state())

    progress(state())
    jobs = [(config, index, str(folder.resolve())) for index in missing]
    run_jobs(executor, _job, jobs, take, ahead=ahead)
    return state()


def _count(samples: dict[Category, Samples]) -> Counts:
    counts = Counts()
    for category, group in samples.items():
        feasible = int(group.feasible.sum())
        counts[category, True], counts[category, False] = feasible, len(group) - feasible
    return counts


def _manifest(robot: RobotModel, config: CollectConfig) -> Manifest:
    """What a collection asks for: a larger one of the same kind goes on with the same data set."""
    settings = plain_settings(config, "robot", "robots", "seed", "samples_per_category")
    versions = {name: metadata.version(name) for name in PACKAGES}
    return Manifest(SCHEMA, robot.name, robot.fingerprint, config.seed, settings, versions)
