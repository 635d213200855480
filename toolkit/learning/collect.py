"""Collecting labelled transitions: the planner runs in random terrain and the optimiser labels what it considers.

Each shard is a function of the manifest and of its number, and holds the same number of transitions of every category.
The planner walks at random through tilted tiles with one or two walls (paper, Sec. VI); of the transitions out of a
state a few are labelled, preferring categories of which the shard still lacks samples, and the search goes on from
those that are feasible.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from importlib import metadata
from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category, category_of
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.errors import DatasetError, PlanningError
from toolkit.learning.dataset import (
    SCHEMA,
    Manifest,
    Samples,
    read_manifest,
    read_shard,
    shard_path,
    write_shard,
)
from toolkit.prediction.evaluator import TransitionBatch
from toolkit.prediction.features import TARGETS, encode, feature_size
from toolkit.prediction.optimiser import OptimiserEvaluator
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.ana_star import AnaStarConfig
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.world.generators import training
from toolkit.world.loader import load_world
from toolkit.world.timing import Timing

PACKAGES = ("humanoid-contact-toolkit", "numpy", "numba", "mujoco")


@dataclass(frozen=True)
class CollectConfig:
    """What to collect.

    Attributes:
        robot: name of the robot.
        robots: folder that holds it, None for the default one.
        seed: of everything random.
        samples_per_category: at least so many.
        per_shard: of each category in a shard.
        default_share: of terrains with the paper's timing (1 s + 1 s) and friction (0.5); others draw both.
        shift, swing: s, ranges that timings are drawn from (uniformly in their logarithm).
        friction: range of the coefficient.
        considered: transitions of a state that are labelled.
        expansions: states of a terrain that are expanded.
        disturbed: share of the states whose CoM and velocity are disturbed before labelling: what the planner meets
            is mostly feasible, and the networks must know where that ends.
        com_spread: (3,) m; velocity_spread: (3,) m/s; standard deviations of a full disturbance in the frame of the
            feet; each one is scaled by a number drawn from [0, 1].
    """

    robot: str
    robots: str | None = None
    seed: int = 0
    samples_per_category: int = 100_000
    per_shard: int = 250
    default_share: float = 0.4
    shift: tuple[float, float] = (0.05, 1.0)
    swing: tuple[float, float] = (0.3, 1.0)
    friction: tuple[float, float] = (0.3, 0.9)
    considered: int = 10
    expansions: int = 60
    disturbed: float = 0.6
    com_spread: tuple[float, float, float] = (0.12, 0.10, 0.05)
    velocity_spread: tuple[float, float, float] = (0.5, 0.4, 0.2)

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.samples_per_category // self.per_shard)

    @property
    def shard_total(self) -> int:
        """Transitions in a shard."""
        return self.per_shard * len(Category)


@dataclass(frozen=True)
class CollectSummary:
    """How a collection went.

    Attributes:
        labelled: transitions in the data set now.
        resumed: of them from before.
        seconds: wall-clock.
        feasible_share: of the new ones.
        feasible_by_category: the same by category.
    """

    labelled: int
    resumed: int
    seconds: float
    feasible_share: float
    feasible_by_category: dict[Category, float]

    @property
    def rate(self) -> float:
        """New transitions per second."""
        return (self.labelled - self.resumed) / max(self.seconds, 1e-9)


@dataclass
class _Quota:
    """Samples of one shard as they come in."""

    wanted: int
    features: dict[Category, list[np.ndarray]] = field(default_factory=lambda: {c: [] for c in Category})
    feasible: dict[Category, list[bool]] = field(default_factory=lambda: {c: [] for c in Category})
    targets: dict[Category, list[np.ndarray]] = field(default_factory=lambda: {c: [] for c in Category})

    def lack(self, category: Category) -> int:
        return self.wanted - len(self.feasible[category])

    @property
    def full(self) -> bool:
        return all(self.lack(category) <= 0 for category in Category)

    def samples(self) -> dict[Category, Samples]:
        return {
            category: Samples(
                np.array(self.features[category], np.float32).reshape(-1, feature_size(category)),
                np.array(self.feasible[category], bool),
                np.array(self.targets[category], np.float32).reshape(-1, TARGETS),
            )
            for category in Category
        }


class _Recorder:
    """A judge that labels a few of the transitions it is asked for, keeps them, and calls the others infeasible."""

    def __init__(self, robot: RobotModel, quota: _Quota, config: CollectConfig, rng: np.random.Generator):
        self._optimiser = OptimiserEvaluator(robot)
        self._quota, self._config, self._rng = quota, config, rng

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: list[ContactTransition]
    ) -> TransitionBatch:
        """See `TransitionEvaluator`."""
        n, rng = len(transitions), self._rng
        result = TransitionBatch(
            np.zeros(n, bool), np.zeros(n), np.tile(np.asarray(com, float), (n, 1)), np.zeros((n, 3))
        )
        if self._quota.full:
            return result
        if rng.random() < self._config.disturbed:
            scale = rng.random()
            turn = scale * stance.mean_feet.rotation
            com = com + turn @ (rng.normal(size=3) * self._config.com_spread)
            com_velocity = com_velocity + turn @ (rng.normal(size=3) * self._config.velocity_spread)
        categories = [category_of(stance, item) for item in transitions]
        for index in self._choose(categories):
            transition, category = transitions[index], categories[index]
            batch = self._optimiser.evaluate(stance, com, com_velocity, [transition])
            feasible = bool(batch.feasible[0])
            if feasible:
                result.feasible[index], result.objective[index] = True, batch.objective[0]
                result.com[index], result.com_velocity[index] = batch.com[0], batch.com_velocity[0]
            if self._quota.lack(category) > 0:
                frame, features = encode(stance, com, com_velocity, [transition])
                target = np.zeros(TARGETS)
                if feasible:
                    target[0] = batch.objective[0]
                    target[1:4] = frame.point(batch.com[0])
                    target[4:7] = frame.vector(batch.com_velocity[0])
                self._quota.features[category].append(features[0])
                self._quota.feasible[category].append(feasible)
                self._quota.targets[category].append(target)
        return result

    def _choose(self, categories: list[Category]) -> list[int]:
        """Transitions to label: of categories that lack samples, most of those that lack most; two more to go on."""
        rng, lack = self._rng, {category: self._quota.lack(category) for category in set(categories)}
        counts = {category: categories.count(category) for category in lack}
        weight = np.array([max(lack[category], 0) / counts[category] for category in categories])
        size = min(self._config.considered, int((weight > 0).sum()))
        chosen = list(rng.choice(len(categories), size, replace=False, p=weight / weight.sum())) if size else []
        others = np.setdiff1d(np.arange(len(categories)), chosen)
        weight = np.array([1.0 / counts[categories[index]] for index in others])
        if len(others):
            chosen += list(rng.choice(others, min(2, len(others)), replace=False, p=weight / weight.sum()))
        return [int(index) for index in chosen]


@lru_cache(maxsize=2)
def _robot(name: str, robots: str | None) -> RobotModel:
    """The robot, loaded once per process."""
    return load_robot(name, Path(robots) if robots else None)


def collect_shard(config: CollectConfig, index: int) -> dict[Category, Samples]:
    """Label the transitions of one shard; a pure function of its arguments.

    Args:
        config: what to collect.
        index: number of the shard.

    Returns:
        `config.per_shard` samples of every category that the robot can perform.
    """
    rng = np.random.default_rng([config.seed, index])
    robot = _robot(config.robot, config.robots)
    quota = _Quota(config.per_shard)
    while not quota.full:
        timing, friction = Timing(), 0.5
        if rng.random() >= config.default_share:
            shift, swing = (np.exp(rng.uniform(*np.log(bounds))) for bounds in (config.shift, config.swing))
            timing, friction = Timing(float(shift), float(swing)), float(rng.uniform(*config.friction))
        text = training(rng, friction=friction, shift=timing.shift, swing=timing.swing, walls=int(rng.integers(1, 3)))
        planner = ContactPlanner(
            robot,
            load_world("training.xml", mjcf=text),
            _Recorder(robot, quota, config, rng),
            PlannerConfig(
                heuristic="euclidean",
                wide_steps="on",
                search=AnaStarConfig(epsilon=0.9, max_expansions=config.expansions),
            ),
        )
        try:
            planner.search(rng, np.inf)
        except PlanningError:  # the tile at the start is too steep to stand on: another terrain
            continue
    return quota.samples()


def _job(config: CollectConfig, index: int, folder: str) -> tuple[int, dict[Category, tuple[int, int]]]:
    """Collect and write a shard where it runs; returns its number and (feasible, all) by category."""
    samples = collect_shard(config, index)
    write_shard(Path(folder), index, samples)
    return index, {category: (int(group.feasible.sum()), len(group)) for category, group in samples.items()}


def collect(
    folder: Path,
    robot: RobotModel,
    config: CollectConfig,
    executor: Executor,
    progress: Callable[[int, float], None] = lambda labelled, seconds: None,
    *,
    ahead: int = 16,
) -> CollectSummary:
    """Fill a data set, going on where an earlier call ended or was killed.

    Args:
        folder: the data set, seen under the same path by every worker.
        robot: that `config.robot` names.
        config: what to collect.
        executor: where shards are made, through the `concurrent.futures` interface.
        progress: called with the transitions in the data set and the seconds so far.
        ahead: shards handed to the executor at a time.

    Returns:
        Counts and rates.

    Raises:
        DatasetError: the folder holds something else, or data of other settings or of another robot.
    """
    began = time.perf_counter()
    _prepare(folder, robot, config)
    missing = []
    resumed = 0
    for index in range(config.shards):
        if shard_path(folder, index).is_file():
            read_shard(shard_path(folder, index))  # a broken one is refused by name, not kept in silence
            resumed += config.shard_total
        else:
            missing.append(index)
    labelled = resumed
    counts = {category: np.zeros(2, int) for category in Category}
    progress(labelled, 0.0)
    waiting: set[Future] = set()
    try:
        while missing or waiting:
            while missing and len(waiting) < ahead:
                waiting.add(executor.submit(_job, config, missing.pop(0), str(folder.resolve())))
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                for category, pair in future.result()[1].items():
                    counts[category] += pair
                labelled += config.shard_total
                progress(labelled, time.perf_counter() - began)
    except BaseException:
        for future in waiting:
            future.cancel()
        raise
    total = sum(counts.values())
    return CollectSummary(
        labelled,
        resumed,
        time.perf_counter() - began,
        float(total[0] / max(total[1], 1)),
        {category: float(pair[0] / max(pair[1], 1)) for category, pair in counts.items()},
    )


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
