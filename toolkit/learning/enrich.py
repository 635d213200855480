"""More samples of what is rare and costly: variations of stored transitions.

What nearly fails costs a hundred times more than what a planner mostly meets. So it decides how far off predictions are
on average, and it is rare. A data set is enriched by transitions near those that it holds, the costly ones most often:
the new contact is another's, contacts and state are displaced a little. They serve to learn from, never to test on.

Networks that were trained already find more: of many transitions put together from parts of stored ones
(`learning.recombine`) those are labelled which they call feasible and costly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.learning.dataset import (
    SCHEMA,
    Manifest,
    Samples,
    begin,
    join,
    no_samples,
    plain_settings,
    read_manifest,
    read_shard,
    shard_index,
    shard_path,
    shards_of,
    write_shard,
)
from toolkit.learning.evaluate import at_default
from toolkit.learning.jobs import run_jobs
from toolkit.learning.label import label, samples_of
from toolkit.learning.recombine import RecombineConfig, recombined
from toolkit.learning.sensitivity import decode
from toolkit.learning.shard import robot_of
from toolkit.prediction.network import TransitionNetwork, load_network, network_path
from toolkit.robot.model import RobotModel

_CANDIDATES = 12  # transitions put together for each that is labelled


@dataclass(frozen=True)
class EnrichConfig:
    """How transitions are varied.

    Attributes:
        robot: name of the robot; robots: folder that holds it.
        seed: of everything random.
        categories: which ones.
        draws: transitions that are tried for each category and shard, of those at the paper's timing and friction.
        power: they are drawn in proportion to their objective to this power.
        exchange: share of them that get the new contact of another one.
        foot: m and rad, standard deviations of a foot's displacement;
        palm: the same of a palm.
        com: m, and
        velocity: m/s; the same of the state.
        limit: transitions with a larger objective are left out.
        networks: folder of networks that choose among transitions put together from parts; None: variations. Then only
            `seed`, `categories`, `draws`, `power` and `limit` of the above count.
    """

    robot: str
    robots: str
    seed: int = 0
    categories: tuple[int, ...] = tuple(int(category) for category in Category)
    draws: int = 200
    power: float = 0.7
    exchange: float = 0.5
    foot: tuple[float, float] = (0.01, 0.04)
    palm: tuple[float, float] = (0.03, 0.08)
    com: float = 0.02
    velocity: float = 0.08
    limit: float = 5e3
    networks: str | None = None


def variations(
    robot: RobotModel, category: Category, samples: Samples, config: EnrichConfig, rng: np.random.Generator
) -> Samples:
    """Feasible variations of samples, `config.draws` at most.

    Args:
        robot: the robot.
        category: of the samples.
        samples: labelled transitions; only those with the paper's timing and friction are varied.
        config: how.
        rng: randomness.
    """
    group = at_default(samples)
    group = group.select(np.flatnonzero(group.feasible))
    parts = [samples.select(slice(0))]
    weight = np.maximum(group.targets[:, 0].astype(float), 1e-3) ** config.power
    for row in rng.choice(len(group), config.draws, p=weight / weight.sum()) if len(group) else ():
        stance, com, velocity, transition = decode(group.features[row], category)
        if rng.random() < config.exchange:
            transition = decode(group.features[rng.integers(len(group))], category)[3]
        if transition.contact is not None:
            transition = replace(transition, contact=_displaced(transition.contact, config, rng))
        stance = Stance(tuple(_displaced(contact, config, rng) for contact in stance.contacts))
        com = com + config.com * rng.normal(size=3)
        velocity = velocity + config.velocity * rng.normal(size=3)
        parts.append(_labelled(robot, stance, com, velocity, transition, config.limit))
    return join(parts, category)


def combinations(
    robot: RobotModel,
    category: Category,
    shard: Mapping[Category, Samples],
    network: TransitionNetwork,
    config: EnrichConfig,
    rng: np.random.Generator,
) -> Samples:
    """Feasible transitions put together from parts, `config.draws` at most; the costlier, the rather.

    Args:
        robot: the robot.
        category: of the result.
        shard: labelled transitions by category.
        network: what it calls feasible is labelled, in proportion to the objective that it predicts.
        config: how.
        rng: randomness.
    """
    features = recombined(shard, category, _CANDIDATES * config.draws, RecombineConfig(), rng)
    features = features[network.feasible(features)]
    objective = network.predict(features)[:, 0].astype(float)
    features, objective = features[objective <= config.limit], objective[objective <= config.limit]
    weight = np.maximum(objective, 1.0) ** config.power
    count = min(config.draws, len(features))
    rows = rng.choice(len(features), count, replace=False, p=weight / weight.sum()) if count else ()
    parts = [_labelled(robot, *decode(features[row], category), config.limit) for row in rows]
    return join([no_samples(category), *parts], category)


def _labelled(
    robot: RobotModel,
    stance: Stance,
    com: np.ndarray,
    velocity: np.ndarray,
    transition: ContactTransition,
    limit: float,
) -> Samples:
    """One sample; none where the transition is infeasible or its objective above the limit."""
    labels = label(robot, stance, com[None], velocity[None], [transition])
    found = samples_of(stance, com[None], velocity[None], [transition], labels)
    return found.select(labels.feasible & (labels.objective <= limit))


def _displaced(contact: Contact, config: EnrichConfig, rng: np.random.Generator) -> Contact:
    place, turn = config.foot if contact.limb.is_foot else config.palm
    rotation_vector = turn * rng.normal(size=3)
    return replace(contact, pose=contact.pose.moved(place * rng.normal(size=3), rotation_vector))


def _job(source: Path, folder: Path, config: EnrichConfig) -> int:
    """Write the variations of one shard; their number."""
    index = shard_index(source)
    robot, shard = robot_of(config.robot, config.robots), read_shard(source)
    found = {}
    for category in (Category(number) for number in config.categories):
        if category not in shard:
            continue
        rng = np.random.default_rng([config.seed, index, int(category)])
        if config.networks is None:
            found[category] = variations(robot, category, shard[category], config, rng)
        else:
            network = load_network(network_path(Path(config.networks), category), category, robot.fingerprint)
            found[category] = combinations(robot, category, shard, network, config, rng)
    write_shard(folder, index, found)
    return sum(len(group) for group in found.values())


def enrich(
    source: Path,
    folder: Path,
    robot: RobotModel,
    config: EnrichConfig,
    executor: Executor,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> int:
    """Write a data set of variations beside a data set; goes on where it was stopped, shard by shard.

    Args:
        source: the data set that is varied.
        folder: the new one, or one begun with the same configuration.
        robot: that both are for.
        config: how.
        executor: where shards are worked on.
        progress: told how many shards of how many are done.

    Returns:
        Number of transitions that this call added.

    Raises:
        DatasetError: another robot's data, no shards, a broken one, or a folder with something else in it.
        NetworkError: a network that should choose is missing or another robot's.
    """
    paths, varied = shards_of(source, robot.fingerprint), read_manifest(source)
    settings = plain_settings(config, "robots", "networks") | {"varied_seed": varied.seed}
    if config.networks is not None:
        settings["recombined"] = plain_settings(RecombineConfig())
    begin(folder, Manifest(SCHEMA, robot.name, robot.fingerprint, config.seed, settings, varied.versions))
    missing = [path for path in paths if not shard_path(folder, shard_index(path)).is_file()]
    done, added = len(paths) - len(missing), 0

    def take(number: int) -> None:
        nonlocal done, added
        done, added = done + 1, added + number
        progress(done, len(paths))

    run_jobs(executor, _job, [(path.resolve(), folder.resolve(), config) for path in missing], take)
    return added
