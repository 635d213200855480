"""One shard of labelled transitions: the planner runs in random terrain, and the optimiser labels its transitions.

The planner walks at random through tilted tiles with one or two walls (paper, Sec. VI). Ground that is too steep for
rest must be crossed in motion. So a part of each shard is collected on slopes, with quick steps from running states.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category, categories_of
from toolkit.errors import PlanningError
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.quota import Balance, Ground, Quota
from toolkit.learning.recorder import Recorder
from toolkit.learning.samples import Samples, join
from toolkit.learning.terrain import random_slope, random_terrain
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.world.loader import load_world
from toolkit.world.world import Goal

_NOWHERE = Goal(np.array([20.0, 0.0, 0.0]), 0.1)  # so far away that the search never ends there


@lru_cache(maxsize=2)
def robot_of(name: str, robots: str | None) -> RobotModel:
    """The robot, loaded once per process."""
    return load_robot(name, Path(robots) if robots else None)


def collect_shard(config: CollectConfig, index: int) -> dict[Category, Samples]:
    """Label the transitions of the shard with this index; a pure function of its arguments.

    Returns:
        At least `config.per_shard` samples of every category that the robot can perform.
    """
    rng = np.random.default_rng([config.seed, index])
    robot = robot_of(config.robot, config.robots)
    balance = Balance(config.infeasible)
    tilted = Quota(config.per_shard, categories_of(robot))
    slopes = Quota(round(config.slope_share * config.per_shard), [Category.MOVE_FOOT])
    while not tilted.full:
        ground = Ground.DEFAULT if rng.random() < config.default_share else Ground.VARIED
        walls = 1 + int(rng.random() < config.two_walls)
        ranges = (rng.uniform(*config.tilt), rng.uniform(*config.rise)) if ground == Ground.VARIED else ()
        recorder = Recorder(robot, tilted, balance, config, rng, ground)
        _walk(robot, random_terrain(rng, walls, *ranges), recorder, config.expansions, rng)
    while not slopes.full:
        recorder = Recorder(robot, slopes, balance, config, rng, Ground.SLOPE)
        _walk(robot, random_slope(rng), recorder, config.slope_expansions, rng)
    samples = tilted.samples()
    for category, more in slopes.samples().items():
        joined = join([samples[category], more])
        samples[category] = joined.select(rng.permutation(len(joined)))
    return samples


def _walk(robot: RobotModel, text: str, recorder: Recorder, expansions: int, rng: np.random.Generator) -> None:
    """Let the planner walk at random on one terrain."""
    world = replace(load_world("training.xml", mjcf=text), goal=_NOWHERE)
    search = AnaStarConfig(epsilon=0.9, max_expansions=expansions)
    config = PlannerConfig(heuristic="euclidean", wide_steps="on", cost=CostConfig(steep=0.0), search=search)
    planner = ContactPlanner(robot, world, recorder, config)
    with suppress(PlanningError):  # the ground at the start is too steep to stand on
        planner.search(rng, np.inf)
