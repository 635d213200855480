"""One shard of labelled transitions: searches draw whole sequences in random worlds, and the optimiser labels them.

Every transition of a feasible sequence is a sample: what it costs in the motion of the whole sequence, and the CoM's
state after it. What is infeasible comes from transitions that the searches asked about, and from feasible ones that are
changed until they are not.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category, categories_of, category_rows
from toolkit.learning.boundary import at_boundary
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.draws import Place, draw_sequences
from toolkit.learning.feasible import TransitionProblem, transition_feasible
from toolkit.learning.label import LabelledSequence, label, sample_of
from toolkit.learning.quota import Quota
from toolkit.learning.samples import PAPER, PLANNED, Samples
from toolkit.learning.scout import Scout
from toolkit.learning.terrain import OPEN, STEEP, WALLED, random_world, steep_descent
from toolkit.prediction.network import TransitionNetwork
from toolkit.prediction.networks import load_networks
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.world.scaling import Fit
from toolkit.world.timing import Timing, own_choice

WORLDS = 1000
"""Numbers of worlds that a shard may use: those of shard i begin with i times this."""
_PAPER_FRICTION = 0.5
_CALMER = 0.6, 0.25, 0.15  # shares of how often the planner's own pace has yielded


@lru_cache(maxsize=2)
def robot_of(name: str, robots: str | None) -> RobotModel:
    """The robot, loaded once per process."""
    return load_robot(name, Path(robots) if robots else None)


@lru_cache(maxsize=2)
def _networks_of(name: str, robots: str | None, folder: str, digest: str) -> dict[Category, TransitionNetwork]:
    """Networks of a robot, loaded once per process; the digest tells those of one folder apart."""
    del digest
    return load_networks(robot_of(name, robots), Path(folder))


def collect_shard(config: CollectConfig, index: int) -> dict[Category, Samples]:
    """Draw and label the sequences of the shard with this index; a pure function of its arguments.

    Returns:
        Samples of every category that the robot can perform, at least `config.per_shard` of them with an outcome,
        unless `config.most_worlds` worlds did not give so many, or `config.most_idle` ones in a row none of them.
    """
    rng = np.random.default_rng([config.seed, index])
    robot = robot_of(config.robot, config.robots)
    quota = Quota(config.per_shard, categories_of(robot))
    idle = 0
    for number in range(min(config.most_worlds, WORLDS)):
        if not quota.lacking or idle >= config.most_idle:
            break
        missing = quota.missing
        for sequence, scout in draw_sequences(_place(robot, quota, config, rng), quota, config, rng):
            labelled = label(robot, sequence)
            if labelled is not None:
                _add(labelled, scout, quota, WORLDS * index + number, config, rng)
        idle = 0 if quota.missing < missing else idle + 1
    return quota.samples()


def _place(robot: RobotModel, quota: Quota, config: CollectConfig, rng: np.random.Generator) -> Place:
    """A random world with random timings and friction."""
    networks = {}
    if config.networks is not None:
        networks = _networks_of(config.robot, config.robots, config.networks, config.networks_digest)
    fit, pace = Fit.of(robot), robot.pace
    walls = robot.arms and any(category.palms_before or not category.moving.is_foot for category in quota.lacking)
    kinds = list(WALLED) if rng.random() < (config.walled if walls else 0.2) else [*OPEN, STEEP]
    kind, friction = kinds[int(rng.integers(len(kinds)))], rng.uniform(*config.friction)
    if kind == STEEP:
        timings = (_random_timing(config.quick_shift, config.quick_swing, pace, rng),)
        return Place(robot, steep_descent(rng, friction, fit.factor), timings, True, networks)
    shares = np.cumsum([config.paper_share, config.planned_share, config.own_share])
    which, paced = int(np.searchsorted(shares, rng.random(), side="right")), False
    if which == 0:
        timings, friction = (PAPER,), _PAPER_FRICTION
    elif which == 1:
        timings = (PLANNED,)
    elif which == 2:
        rolls = not robot.stands_on_one_foot
        timings, paced = own_choice(pace, int(rng.choice(3, p=_CALMER)), rolls=rolls), True
    else:
        count = int(rng.integers(1, config.choices + 1))
        timings = tuple(_random_timing(config.shift, config.swing, pace, rng) for _ in range(count))
    most = min(config.tilt[1], fit.tilt)
    config = replace(config, tilt=(min(config.tilt[0], most), most))
    world = random_world(rng, config, kind, friction, fit.factor)
    return Place(robot, world, timings, False, networks, paced=paced)


def _random_timing(
    shift: tuple[float, float], swing: tuple[float, float], pace: float, rng: np.random.Generator
) -> Timing:
    """A timing whose times are uniform in their logarithm, multiplied by `pace`."""
    return Timing(*(pace * float(np.exp(rng.uniform(*np.log(bounds)))) for bounds in (shift, swing)))


def _add(
    labelled: LabelledSequence, scout: Scout, quota: Quota, world: int, config: CollectConfig, rng: np.random.Generator
) -> None:
    """Add all transitions of a sequence to the quota, and transitions near them that are judged alone."""
    goal = labelled.goal
    for index in range(len(labelled.sequence.transitions)):
        problem = labelled.problem(index)
        category, samples = sample_of(problem, True, labelled.outcome(index), goal, world)
        quota.add(category, samples)
        judged = _sibling(problem, scout, rng)
        if quota.infeasible_share(category) < config.infeasible:
            judged += at_boundary(problem, rng)
        for other, feasible in judged:
            quota.add(*sample_of(other, feasible, None, goal, world))


def _sibling(
    problem: TransitionProblem, scout: Scout, rng: np.random.Generator
) -> list[tuple[TransitionProblem, bool]]:
    """Another transition out of the same state about which the search asked, judged; all categories are as likely."""
    asked = scout.asked(problem.stance)
    if not len(asked):
        return []
    numbers = category_rows(problem.stance, asked)
    number = int(rng.choice(np.unique(numbers)))
    row = int(rng.choice(np.flatnonzero(numbers == number)))
    other = TransitionProblem(problem.robot, problem.stance, problem.com, problem.com_velocity, asked[row])
    return [(other, transition_feasible(other))]
