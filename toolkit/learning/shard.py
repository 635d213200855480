"""One shard of labelled transitions: the planner runs in random terrain and the optimiser labels what it considers.

The planner walks at random through tilted tiles with one or two walls (paper, Sec. VI). Of the transitions out of a
state some are labelled, preferring categories of which the shard still lacks samples, and the search goes on from
those that are feasible. What a planner meets is mostly feasible, and the networks must know where that ends: so many
initial states are disturbed, each by its own amount, that the wanted share of the labels is "infeasible".

Ground on which nothing rests has to be crossed in motion. Therefore a part of each shard is collected on slopes, with
quick steps, from states that already run (`slope_samples`).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category, category_of
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.errors import PlanningError
from toolkit.geometry.limb import PALMS
from toolkit.learning.dataset import Samples, join, no_samples
from toolkit.learning.label import label, samples_of
from toolkit.learning.terrain import SlopeConfig, TerrainConfig, random_slope, random_terrain
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.prediction.features import LAYOUT
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.world.loader import load_world
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

# Palms in contact before a transition of each category.
PALMS_BEFORE = {category: len(limbs) - 2 for category, (limbs, _) in LAYOUT.items()}
_NOWHERE = Goal(np.array([20.0, 0.0, 0.0]), 0.1)  # a search that finds its goal goes no further
_REPEATS = 4  # times that one transition is labelled, from as many states
_TO_GO_ON = 4  # labelled per state where no category lacks samples
_DEFAULT, _VARIED, _SLOPE = "default", "varied", "slope"  # terrain: the paper's, any tilts and timings, a slope


@dataclass(frozen=True)
class CollectConfig:
    """What to collect.

    Attributes:
        robot: name of the robot.
        robots: folder that holds it, None for the default one.
        seed: of everything random.
        samples_per_category: at least so many.
        per_shard: of each category in a shard, at least.
        slope_share: further steps on slopes, as part of `per_shard`.
        default_share: of terrains with the paper's timing (1 s + 1 s), friction (0.5) and tiles; the others draw all.
        shift, swing: s, ranges that timings are drawn from (uniformly in their logarithm), one for each transition;
        slope_shift, slope_swing: the same on slopes.
        friction: range of the coefficient, drawn for each state.
        tilt: deg, and
        rise: m; ranges from which the largest tilt and height of the tiles of a terrain are drawn.
        two_walls: share of the terrains with walls on both sides.
        considered: transitions of a state that are labelled, and
        children: of them that the search goes on from.
        expansions: states of a terrain that are expanded; slope_expansions: the same of a slope.
        infeasible: share of this label that is aimed at in every category and kind of terrain.
        com_spread: (3,) m; velocity_spread: (3,) m/s; standard deviations of a disturbance of the initial state in the
            frame of the feet, before it is scaled.
        far: range of the scale of large disturbances, as many as make `infeasible` true.
        near: share of small disturbances, scaled by a number drawn from [0, 1], among the other states.
        run_share: share of the states on slopes that are replaced by a running one.
        run_speed: m/s, range of its speed; run_spread: (3,) m; how far the CoM may lie from over the mean of the feet.
        objective_limit: feasible transitions with a larger objective are left out, as in the original, whose limit of
            50,000 is 35 to 1,000 times its mean objectives;
        default_limit: the same with the paper's timing, where objectives are a tenth of the original's;
        disturbed_limit: the same where a resting robot's state was disturbed by much: what can just be recovered, at
            any price, is of no use to a planner.
    """

    robot: str
    robots: str | None = None
    seed: int = 0
    samples_per_category: int = 100_000
    per_shard: int = 500
    slope_share: float = 0.5
    default_share: float = 0.45
    shift: tuple[float, float] = (0.04, 1.0)
    swing: tuple[float, float] = (0.25, 1.0)
    slope_shift: tuple[float, float] = (0.04, 0.2)
    slope_swing: tuple[float, float] = (0.25, 0.5)
    friction: tuple[float, float] = (0.3, 0.9)
    tilt: tuple[float, float] = (10.0, 32.0)
    rise: tuple[float, float] = (0.02, 0.15)
    two_walls: float = 0.8
    considered: int = 24
    children: int = 4
    expansions: int = 40
    slope_expansions: int = 12
    infeasible: float = 0.33
    com_spread: tuple[float, float, float] = (0.03, 0.03, 0.015)
    velocity_spread: tuple[float, float, float] = (0.12, 0.1, 0.05)
    far: tuple[float, float] = (5.0, 15.0)
    near: float = 0.35
    run_share: float = 0.3
    run_speed: tuple[float, float] = (0.0, 2.5)
    run_spread: tuple[float, float, float] = (0.3, 0.06, 0.08)
    objective_limit: float = 2e4
    default_limit: float = 5e3
    disturbed_limit: float = 1e3

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.samples_per_category // self.per_shard)

    @property
    def per_slope(self) -> int:
        """Steps on slopes in a shard, at least."""
        return round(self.slope_share * self.per_shard)


@dataclass
class Quota:
    """Samples of one shard as they come in.

    Attributes:
        wanted: of each category.
        categories: that the robot can perform.
    """

    wanted: int
    categories: list[Category]
    found: dict[Category, list[Samples]] = field(default_factory=dict)
    counts: dict[Category, int] = field(default_factory=dict)

    def __post_init__(self):
        for category in self.categories:
            self.found[category], self.counts[category] = [no_samples(category)], 0

    def lack(self, category: Category) -> int:
        """Samples still wanted."""
        return max(self.wanted - self.counts[category], 0) if category in self.counts else 0

    @property
    def full(self) -> bool:
        """Whether nothing is wanted any more."""
        return all(count >= self.wanted for count in self.counts.values())

    def add(self, category: Category, samples: Samples) -> None:
        """Enter samples; those of other categories are dropped."""
        if category in self.counts:
            self.found[category].append(samples)
            self.counts[category] += len(samples)

    def samples(self) -> dict[Category, Samples]:
        """All samples by category, in the order of their coming."""
        return {category: join(parts, category) for category, parts in self.found.items()}


@dataclass
class _Balance:
    """Decides which initial states to disturb, so that the label "infeasible" reaches its share."""

    wanted: float
    counts: dict[tuple[Category, str], list[int]] = field(default_factory=dict)

    def probability(self, category: Category, kind: str) -> float:
        infeasible, total = self.counts.get((category, kind), (0, 0))
        share = (infeasible + 1.0) / (total + 1.0 / self.wanted)
        return float(np.clip(0.4 + 4.0 * (self.wanted - share), 0.02, 0.9))

    def count(self, category: Category, kind: str, feasible: np.ndarray) -> None:
        pair = self.counts.setdefault((category, kind), [0, 0])
        pair[0] += int((~feasible).sum())
        pair[1] += len(feasible)


class _Recorder(TransitionEvaluator):
    """A judge that labels some of the transitions it is asked for, keeps them, and calls the others infeasible."""

    def __init__(
        self,
        robot: RobotModel,
        quota: Quota,
        balance: _Balance,
        config: CollectConfig,
        rng: np.random.Generator,
        kind: str,
    ):
        self._robot, self._quota, self._balance, self._config, self._rng = robot, quota, balance, config, rng
        self._kind = kind

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """See `TransitionEvaluator`."""
        n = len(transitions)
        result = TransitionBatch(np.zeros(n, bool), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))
        if self._quota.full:
            return result
        groups: dict[tuple[int, bool], list[int]] = {}
        for index, item in enumerate(transitions):
            groups.setdefault((item.limb, item.contact is None), []).append(index)
        categories = [category_of(stance, transitions[rows[0]]) for rows in groups.values()]
        chosen = self._choose([np.array(rows) for rows in groups.values()], categories)
        friction = None if self._kind == _DEFAULT else float(self._rng.uniform(*self._config.friction))
        old = _with_friction(stance, friction)
        for rows, category in zip(chosen, categories, strict=True):
            if len(rows):
                items = [self._vary(transitions[row], friction) for row in rows]
                self._label(old, com, com_velocity, items, category, rows, result)
        self._pass_on(stance, transitions, result)
        return result

    def _label(
        self,
        stance: Stance,
        com: np.ndarray,
        com_velocity: np.ndarray,
        items: list[ContactTransition],
        category: Category,
        rows: np.ndarray,
        result: TransitionBatch,
    ) -> None:
        """Label transitions of one category and limb from disturbed states; enter them in the quota and the result."""
        n, rng, config = len(items), self._rng, self._config
        again = np.concatenate([[False], rows[1:] == rows[:-1]])  # the same transition from another state
        near = rng.random(n) * (again | (rng.random(n) < config.near))
        is_far = rng.random(n) < self._balance.probability(category, self._kind)
        scale = np.where(is_far, rng.uniform(*config.far, n), near)
        turn = scale[:, None] * (rng.normal(size=(2, n, 3)))
        forward = stance.mean_feet.rotation.T
        start = com + (turn[0] * config.com_spread) @ forward
        velocity = com_velocity + (turn[1] * config.velocity_spread) @ forward
        if self._kind == _SLOPE:
            runs = rng.random(n) < config.run_share
            start[runs], velocity[runs], is_far = *self._running(stance, int(runs.sum())), is_far & ~runs
        batch = label(self._robot, stance, start, velocity, items)
        limit = config.default_limit if self._kind == _DEFAULT else config.objective_limit
        limit = np.where(is_far, config.disturbed_limit, limit)
        kept = ~batch.feasible | (batch.objective <= limit)
        self._quota.add(category, samples_of(stance, start, velocity, items, batch).select(kept))
        self._balance.count(category, self._kind, batch.feasible[kept])
        # What follows a large disturbance is nothing that a planner meets.
        on = np.flatnonzero(batch.feasible & kept & ~is_far)
        result.feasible[rows[on]], result.objective[rows[on]] = True, batch.objective[on]
        result.com[rows[on]], result.com_velocity[rows[on]] = batch.com[on], batch.com_velocity[on]

    def _running(self, stance: Stance, count: int) -> tuple[np.ndarray, np.ndarray]:
        """CoM (n, 3) and velocity (n, 3) of a robot that runs the way its feet point, along the ground."""
        config, rng, feet = self._config, self._rng, stance.mean_feet
        ahead = feet.rotation[:, 0]
        normal = np.sum([contact.pose.rotation[:, 2] for contact in stance.contacts[:2]], axis=0)
        ahead = ahead - normal * (ahead @ normal) / (normal @ normal)
        ahead /= np.linalg.norm(ahead)
        spread = rng.uniform(-1.0, 1.0, (count, 3)) * config.run_spread
        spread[:, 2] -= config.run_spread[2] / 2  # rather low than high
        com = feet.position + [0.0, 0.0, self._robot.com_height] + spread @ feet.rotation.T
        speed = rng.uniform(*config.run_speed, (count, 1))
        return com, speed * ahead + (rng.normal(size=(count, 3)) * config.velocity_spread) @ feet.rotation.T

    def _pass_on(self, stance: Stance, transitions: Sequence[ContactTransition], result: TransitionBatch) -> None:
        """Keep a few of the feasible transitions, most of those into stances from which samples are lacking."""
        rows = np.flatnonzero(result.feasible)
        if len(rows) <= self._config.children:
            return
        lack = [
            max((self._quota.lack(c) for c in self._quota.categories if PALMS_BEFORE[c] == count), default=0)
            for count in range(3)
        ]
        palms = len(stance.palms)
        after = [
            palms
            + (transitions[row].limb in PALMS and transitions[row].limb not in stance.palms)
            - (transitions[row].contact is None)
            for row in rows
        ]
        weight = np.array([lack[count] + 1.0 for count in after]) / np.bincount(after, minlength=3)[after]
        kept = self._rng.choice(rows, self._config.children, replace=False, p=weight / weight.sum())
        result.feasible[np.setdiff1d(rows, kept)] = False

    def _vary(self, transition: ContactTransition, friction: float | None) -> ContactTransition:
        """The transition with a drawn timing and the given friction; as it is where that is None."""
        if friction is None:
            return transition
        config, contact = self._config, transition.contact
        quick = self._kind == _SLOPE
        ranges = (config.slope_shift, config.slope_swing) if quick else (config.shift, config.swing)
        shift, swing = (float(np.exp(self._rng.uniform(*np.log(bounds)))) for bounds in ranges)
        new = None if contact is None else replace(contact, friction=friction)
        return ContactTransition(transition.limb, new, Timing(shift, swing))

    def _choose(self, groups: list[np.ndarray], categories: list[Category]) -> list[np.ndarray]:
        """Rows of each group to label: most of the categories that lack most; a few to go on where none lacks any."""
        rng, lack = self._rng, np.array([float(self._quota.lack(category)) for category in categories])
        budget = self._config.considered if lack.any() else _TO_GO_ON
        weight = lack if lack.any() else np.ones(len(lack))
        sizes = rng.multinomial(budget, weight / weight.sum())
        chosen = []
        for rows, size in zip(groups, sizes, strict=True):
            times = min(-(-size // len(rows)), _REPEATS)  # few ways to break a palm: each from several states
            copies = np.repeat(rows, times)
            chosen.append(np.sort(rng.choice(copies, min(size, len(copies)), replace=False)))
        return chosen


def _with_friction(stance: Stance, friction: float | None) -> Stance:
    if friction is None:
        return stance
    contacts: list[Contact] = [replace(contact, friction=friction) for contact in stance.contacts]
    return Stance(tuple(contacts))


@lru_cache(maxsize=2)
def robot_of(name: str, robots: str | None) -> RobotModel:
    """The robot, loaded once per process."""
    return load_robot(name, Path(robots) if robots else None)


def categories_of(robot: RobotModel) -> list[Category]:
    """Categories that a robot can perform: without arms only the first."""
    count = {0: 1, 1: 6}.get(len(robot.arms), len(Category))
    return list(Category)[:count]


def collect_shard(config: CollectConfig, index: int) -> dict[Category, Samples]:
    """Label the transitions of one shard; a pure function of its arguments.

    Args:
        config: what to collect.
        index: number of the shard.

    Returns:
        At least `config.per_shard` samples of every category that the robot can perform.
    """
    rng = np.random.default_rng([config.seed, index])
    robot = robot_of(config.robot, config.robots)
    balance = _Balance(config.infeasible)
    tilted, slopes = Quota(config.per_shard, categories_of(robot)), Quota(config.per_slope, [Category.MOVE_FOOT])
    while not tilted.full:
        kind = _DEFAULT if rng.random() < config.default_share else _VARIED
        walls = 1 + int(rng.random() < config.two_walls)
        terrain = TerrainConfig(walls=walls)
        if kind == _VARIED:
            tilt, rise = rng.uniform(*config.tilt), rng.uniform(*config.rise)
            terrain = TerrainConfig(tilt=tilt, rise=rise, walls=walls)
        recorder = _Recorder(robot, tilted, balance, config, rng, kind)
        _walk(robot, random_terrain(rng, terrain), recorder, config.expansions, rng)
    while not slopes.full:
        recorder = _Recorder(robot, slopes, balance, config, rng, _SLOPE)
        _walk(robot, random_slope(rng, SlopeConfig()), recorder, config.slope_expansions, rng)
    samples = tilted.samples()
    for category, more in slopes.samples().items():
        joined = join([samples[category], more], category)
        samples[category] = joined.select(rng.permutation(len(joined)))
    return samples


def _walk(robot: RobotModel, text: str, recorder: _Recorder, expansions: int, rng: np.random.Generator) -> None:
    """Let the planner walk at random on one terrain."""
    world = replace(load_world("training.xml", mjcf=text), goal=_NOWHERE)
    search = AnaStarConfig(epsilon=0.9, max_expansions=expansions)
    planner = ContactPlanner(
        robot,
        world,
        recorder,
        PlannerConfig(heuristic="euclidean", wide_steps="on", cost=CostConfig(steep=0.0), search=search),
    )
    with suppress(PlanningError):  # the ground at the start is too steep to stand on: another terrain
        planner.search(rng, np.inf)
