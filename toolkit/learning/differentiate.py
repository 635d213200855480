"""Sensitivities for data sets that were collected without them: every feasible transition is solved once more."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.dataset import Samples, read_shard, shard_index, shards_of, write_shard
from toolkit.learning.jobs import run_jobs
from toolkit.learning.label import label
from toolkit.learning.sensitivity import canonical, decode, sensitivity_size
from toolkit.learning.shard import robot_of
from toolkit.prediction.features import encode
from toolkit.robot.model import RobotModel

AGREEMENT = 0.01  # relative to the objective, plus 0.01: features are stored in single precision


def sensitivities(robot: RobotModel, category: Category, samples: Samples) -> np.ndarray:
    """(n, k) float32 derivatives of the objective of samples; NaN where they are not feasible or not known.

    A transition whose objective is not the stored one, because single precision moved it across a bound, say, is left
    unknown.

    Raises:
        DatasetError: that happens to more than one in a hundred: the labels come from something else.
    """
    result = np.full((len(samples), sensitivity_size(category)), np.nan, np.float32)
    rows, strange = np.flatnonzero(samples.feasible), 0
    for row in rows:
        stance, com, velocity, transition = decode(samples.features[row], category)
        labels = label(robot, stance, com[None], velocity[None], [transition])
        found, stored = labels.sensitivity[0], float(samples.targets[row, 0])
        if not labels.feasible[0] or abs(labels.objective[0] - stored) > AGREEMENT * (1.0 + stored):
            strange += 1
        elif found is not None:
            frame, _ = encode(stance, com, velocity, [transition])
            result[row] = canonical(frame, category, found)
    if strange > 0.01 * len(rows) + 3:
        raise DatasetError(
            f"category {int(category)}: the optimiser finds another objective for {strange} of {len(rows)} transitions "
            "than is stored; collect the data again"
        )
    return result


def _job(path: Path, robot: str, robots: str) -> bool:
    """Add to a shard what it lacks; whether it lacked anything."""
    samples = read_shard(path)
    lacking = [category for category, group in samples.items() if group.sensitivity is None]
    if not lacking:
        return False
    model = robot_of(robot, robots)
    for category in lacking:
        group = samples[category]
        samples[category] = replace(group, sensitivity=sensitivities(model, category, group))
    write_shard(path.parent, shard_index(path), samples)
    return True


def differentiate(
    folder: Path, robot: RobotModel, executor: Executor, progress: Callable[[int, int], None] = lambda done, of: None
) -> int:
    """Add the sensitivities that a data set lacks; goes on where it was stopped, shard by shard.

    Args:
        folder: the data set.
        robot: that it was collected for.
        executor: where shards are worked on.
        progress: told how many shards of how many are done.

    Returns:
        Number of shards that lacked something.

    Raises:
        DatasetError: another robot's data, no shards, a broken one, or labels of something else.
    """
    paths, robots = shards_of(folder, robot.fingerprint), str(robot.folder.parent.resolve())
    done = changed = 0

    def take(lacked: bool) -> None:
        nonlocal done, changed
        done, changed = done + 1, changed + lacked
        progress(done, len(paths))

    run_jobs(executor, _job, [(path.resolve(), robot.name, robots) for path in paths], take)
    return changed
