"""More samples of rare and costly transitions, made of those of a data set, displaced and labelled.

Transitions that nearly fail cost a hundred times more than most. They are rare, but they decide the mean error of
predictions. So a data set is enriched by transitions that are made of its own, mostly of costly ones:

- Variations stay near a stored transition. They take the new contact of another one and displace all parts a little.
- Combinations take feet and state from any category and palms from the category itself, since errors on new terrain
  depend on where feet may stand. Most of them are infeasible or cheap, so trained networks choose which to label.

Both serve for training, never for tests.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.contacts.category import Category, performs
from toolkit.drafts import clear_drafts
from toolkit.geometry.limb import FEET
from toolkit.learning.dataset import (
    SCHEMA,
    Manifest,
    begin,
    plain_settings,
    read_manifest,
    read_shard,
    shard_index,
    shard_path,
    shards_of,
    write_shard,
)
from toolkit.learning.jobs import run_jobs
from toolkit.learning.label import label, samples_of
from toolkit.learning.samples import AT_DEFAULT, Samples, join, no_samples
from toolkit.learning.sensitivity import decode
from toolkit.learning.shard import robot_of
from toolkit.prediction.features import COM, CONTACT, MIRROR, TIMING_AND_FRICTION, feature_size
from toolkit.prediction.network import TransitionNetwork, load_network, network_path
from toolkit.robot.model import RobotModel

LIMIT = 5e3  # transitions with a larger objective are left out
COSTLY = 0.7  # transitions are chosen in proportion to their objective to this power
_CANDIDATES = 12  # combinations that are made for each one that is labelled


@dataclass(frozen=True)
class EnrichConfig:
    """What to make of a data set.

    Attributes:
        robot: Name of the robot.
        robots: Folder that holds the robot.
        seed: Seed of every random draw.
        categories: Numbers of the categories.
        draws: Number of transitions that are labelled for each category and shard.
        networks: Folder of networks that choose among combinations; None for variations.
    """

    robot: str
    robots: str
    seed: int = 0
    categories: tuple[int, ...] = tuple(int(category) for category in Category)
    draws: int = 200
    networks: str | None = None


@dataclass(frozen=True)
class Displacement:
    """How far new transitions lie from those that they are made of.

    Attributes:
        power: Transitions are used in proportion to their objective to this power.
        exchange: Share of parts that come from another transition.
        foot: Standard deviations of a foot's displacement, in m and rad.
        palm: Standard deviations of a palm's displacement, in m and rad.
        com: Standard deviation of the CoM's displacement, in m.
        velocity: Standard deviation of the change of the CoM velocity, in m/s.
    """

    power: float
    exchange: float
    foot: tuple[float, float]
    palm: tuple[float, float]
    com: float = 0.02
    velocity: float = 0.08


VARIED = Displacement(power=COSTLY, exchange=0.5, foot=(0.01, 0.04), palm=(0.03, 0.08))
COMBINED = Displacement(power=0.35, exchange=0.4, foot=(0.02, 0.08), palm=(0.05, 0.12))


@dataclass(frozen=True)
class _Lenders:
    """Transitions whose parts are used: contacts (n, k, 3, 3) by place, x and z axis; CoM and velocity (n, 2, 3)."""

    contacts: np.ndarray
    state: np.ndarray
    chance: np.ndarray  # (n,) probability of each

    @classmethod
    def of(cls, category: Category, samples: Samples, power: float) -> _Lenders:
        """The feasible samples with the paper's timing and friction."""
        group = samples.at_default()
        group = group.select(np.flatnonzero(group.feasible))
        count, features = len(category.contact_limbs), group.features.astype(float)
        weight = np.maximum(group.targets[:, 0].astype(float), 1e-3) ** power
        return cls(
            features[:, : CONTACT * count].reshape(-1, count, 3, 3),
            features[:, COM.start : TIMING_AND_FRICTION.start].reshape(-1, 2, 3),
            weight / max(weight.sum(), 1e-300),
        )

    def __len__(self) -> int:
        return len(self.chance)

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """(count,) random rows."""
        return rng.choice(len(self), count, p=self.chance / self.chance.sum())


def varied(
    category: Category, samples: Samples, count: int, rng: np.random.Generator, how: Displacement = VARIED
) -> np.ndarray:
    """(count, d) features of variations of a category's samples; no rows where no sample is feasible."""
    own = _Lenders.of(category, samples, how.power)
    if not len(own):
        return np.zeros((0, feature_size(category)))
    rows = own.draw(count, rng)
    contacts, state = own.contacts[rows], own.state[rows]
    if category.makes:
        swapped = rng.random(count) < how.exchange
        contacts[swapped, -1] = own.contacts[rng.integers(len(own), size=count), -1][swapped]
    return _displaced(category, contacts, state, how, rng)


def combined(
    category: Category,
    shard: Mapping[Category, Samples],
    count: int,
    rng: np.random.Generator,
    how: Displacement = COMBINED,
) -> np.ndarray:
    """(count, d) features of transitions that combine parts of all categories' transitions.

    Feet and state come from all categories alike, and half of them are mirrored; palms and new contacts come from the
    category itself. Tiles are tilted independently, so each foot may take the rotation of another transition's foot.

    Args:
        category: Category of the result. There are no rows where the shard has no feasible transition of it.
        shard: Labelled transitions by category.
        count: Number of transitions.
        rng: Source of every random draw.
        how: How far the result lies from its parts.
    """
    lenders = {other: _Lenders.of(other, samples, how.power) for other, samples in shard.items()}
    lenders = {other: group for other, group in lenders.items() if len(group)}
    if category not in lenders:
        return np.zeros((0, feature_size(category)))
    every = _Lenders(
        np.concatenate([group.contacts[:, : len(FEET)] for group in lenders.values()]),
        np.concatenate([group.state for group in lenders.values()]),
        np.concatenate([group.chance for group in lenders.values()]),
    )

    def draw() -> tuple[np.ndarray, np.ndarray]:
        rows, mirrored = every.draw(count, rng), rng.random(count) < 0.5
        feet, state = every.contacts[rows], every.state[rows]
        feet[mirrored] = feet[mirrored, ::-1] * MIRROR
        state[mirrored] *= MIRROR
        return feet, state

    feet, state = draw()
    swapped = rng.random(count) < how.exchange
    state[swapped] = draw()[1][swapped]
    for foot in FEET:
        swapped = rng.random(count) < how.exchange
        feet[swapped, foot, 1:] = draw()[0][swapped, foot, 1:]
    own = lenders[category].contacts[:, len(FEET) :]
    contacts = np.concatenate([feet, own[rng.integers(len(own), size=count)]], axis=1)
    return _displaced(category, contacts, state, how, rng)


def _displaced(
    category: Category, contacts: np.ndarray, state: np.ndarray, how: Displacement, rng: np.random.Generator
) -> np.ndarray:
    """(n, d) canonical features of contacts (n, k, 3, 3) and states (n, 2, 3) after random displacements."""
    n, k = contacts.shape[:2]
    place, turn = np.array([how.foot if limb.is_foot else how.palm for limb in category.contact_limbs]).T
    contacts, state = contacts.copy(), state + np.array([how.com, how.velocity])[:, None] * rng.normal(size=(n, 2, 3))
    contacts[:, :, 0] += place[:, None] * rng.normal(size=(n, k, 3))
    turns = Rotation.from_rotvec((turn[:, None] * rng.normal(size=(n, k, 3))).reshape(-1, 3)).as_matrix()
    contacts[:, :, 1:] = np.einsum("nkij,nkaj->nkai", turns.reshape(n, k, 3, 3), contacts[:, :, 1:])

    feet = contacts[:, : len(FEET)]
    ahead = feet[:, :, 1, :2] / np.linalg.norm(feet[:, :, 1, :2], axis=2, keepdims=True)
    cosine, sine = (ahead.sum(1) / np.linalg.norm(ahead.sum(1), axis=1, keepdims=True)).T
    canonical = np.zeros((n, 3, 3))
    canonical[:, 0, 0], canonical[:, 0, 1] = cosine, sine
    canonical[:, 1, 0], canonical[:, 1, 1] = -sine, cosine
    canonical[:, 2, 2] = 1.0
    middle = feet[:, :, 0].mean(1)
    contacts[:, :, 0] -= middle[:, None]
    state[:, 0] -= middle
    contacts = np.einsum("nij,nkaj->nkai", canonical, contacts)
    state = np.einsum("nij,naj->nai", canonical, state)
    return np.concatenate([contacts.reshape(n, -1), state.reshape(n, -1), np.tile(AT_DEFAULT, (n, 1))], axis=1)


def chosen(features: np.ndarray, network: TransitionNetwork, count: int, rng: np.random.Generator) -> np.ndarray:
    """At most `count` of the features (n, d) that a network calls feasible; costly ones are more likely."""
    features = features[network.feasible(features)]
    objective = network.predict(features)[:, 0].astype(float)
    features, objective = features[objective <= LIMIT], objective[objective <= LIMIT]
    weight = np.maximum(objective, 1.0) ** COSTLY
    count = min(count, len(features))
    return features[rng.choice(len(features), count, replace=False, p=weight / weight.sum())] if count else features


def labelled(robot: RobotModel, category: Category, features: np.ndarray) -> Samples:
    """Samples of the transitions with features (n, d) that are feasible and whose objective is within the limit."""
    parts, mirrored = [no_samples(category)], not performs(robot, category)
    for row in features:
        stance, com, velocity, transition = decode(row, category, mirrored=mirrored)
        labels = label(robot, stance, com[None], velocity[None], [transition])
        found = samples_of(stance, com[None], velocity[None], [transition], labels)
        parts.append(found.select(labels.feasible & (labels.objective <= LIMIT)))
    return join(parts)


def _job(source: Path, folder: Path, config: EnrichConfig) -> int:
    """Enrich one shard and write the result; returns the number of its transitions."""
    index = shard_index(source)
    robot, shard = robot_of(config.robot, config.robots), read_shard(source)
    found = {}
    for category in (Category(number) for number in config.categories):
        if category not in shard:
            continue
        rng = np.random.default_rng([config.seed, index, int(category)])
        if config.networks is None:
            features = varied(category, shard[category], config.draws, rng)
        else:
            network = load_network(network_path(Path(config.networks), category), category, robot.fingerprint)
            features = chosen(combined(category, shard, _CANDIDATES * config.draws, rng), network, config.draws, rng)
        found[category] = labelled(robot, category, features)
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
    """Write a new data set that is made of another one; returns the number of transitions that this call added.

    Args:
        source: The data set whose transitions are used.
        folder: The new data set. One that was begun with the same configuration is continued.
        robot: The robot of both data sets.
        config: What to make.
        executor: Where shards are made.
        progress: Is called with the number of shards that are done, and the number of all shards.

    Raises:
        DatasetError: The source is broken, has no shards or another robot, or the folder holds something else.
        NetworkError: A network that should choose is missing or belongs to another robot.
    """
    paths, lent = shards_of(source, robot.fingerprint), read_manifest(source)
    how = plain_settings(VARIED if config.networks is None else COMBINED)
    settings = plain_settings(config, "robots", "networks") | how | {"lent_seed": lent.seed}
    begin(folder, Manifest(SCHEMA, robot.name, robot.fingerprint, config.seed, settings, lent.versions))
    missing = [path for path in paths if not shard_path(folder, shard_index(path)).is_file()]
    done, added = len(paths) - len(missing), 0

    def take(number: int) -> None:
        nonlocal done, added
        done, added = done + 1, added + number
        progress(done, len(paths))

    run_jobs(executor, _job, [(path.resolve(), folder.resolve(), config) for path in missing], take)
    clear_drafts(folder)  # of workers that were killed
    return added
