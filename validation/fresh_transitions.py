"""Labelled transitions that no network has seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.collect import collect
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.dataset import read_dataset, read_manifest
from toolkit.learning.evaluate import balanced
from toolkit.learning.jobs import executor
from toolkit.learning.samples import Samples
from toolkit.robot.model import RobotModel

_LABELS = 0.8  # labels to ask for per transition of a test set: most categories get several times what is asked for
DEFAULT, ALL = "1 s + 1 s, friction 0.5", "all timings and frictions"


def fresh(folder: Path, robot: RobotModel, *, count: int, seed: int, workers: int) -> dict[Category, Samples]:
    """A data set with its own seed, collected here unless it is there already.

    Args:
        folder: where it goes; an interrupted collection goes on.
        robot: the robot.
        count: transitions per category that the tables need.
        seed: not that of the training data.
        workers: processes.
    """
    config = CollectConfig(
        robot=robot.name,
        robots=str(robot.folder.parent.resolve()),
        seed=seed,
        samples_per_category=round(_LABELS * count),
        paper_share=0.5,  # the paper's timing in as many transitions as the tables need
        planned_share=0.2,
        own_share=0.15,
    )
    with executor(workers) as pool:
        collect(folder, robot, config, pool)
    return read_dataset(folder, robot.fingerprint)


def seed_of(folder: Path) -> int:
    """Seed of a data set."""
    return read_manifest(folder).seed


def test_sets(
    data: dict[Category, Samples], categories: list[Category], count: int, rng: np.random.Generator
) -> dict[str, dict[Category, Samples]]:
    """Sets of `count` transitions by title and category in which neither label falls under 25 %.

    Raises:
        DatasetError: too few transitions of a category.
    """
    sets: dict[str, dict[Category, Samples]] = {DEFAULT: {}, ALL: {}}
    for category in categories:
        group = data.get(category)
        for title, chosen in ((DEFAULT, None if group is None else group.at_default()), (ALL, group)):
            if chosen is None or len(chosen) < count:
                found = 0 if chosen is None else len(chosen)
                raise DatasetError(
                    f"category {int(category)}: {found} transitions ({title}), {count} are needed; lower --count or "
                    "collect more"
                )
            sets[title][category] = balanced(chosen, count, rng)
    return sets
