"""Recorder: labels transitions that a planner asks about, from disturbed states and with other timings.

The recorder labels some transitions out of each state, mostly of categories of which the shard still lacks samples. The
search continues from feasible ones. A planner mostly meets feasible transitions, but the networks must know the limits.
So initial states are disturbed by random amounts, and so many by much that the wanted share of labels is "infeasible".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.contacts.category import Category, category_rows
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import PALMS
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.label import label, samples_of
from toolkit.learning.quota import Balance, Ground, Quota
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.robot.model import RobotModel
from toolkit.world.timing import Timing

_REPEATS = 4  # largest number of states from which one transition is labelled
_TO_GO_ON = 4  # transitions that are labelled per state where no category lacks samples


@dataclass(eq=False)
class Recorder(TransitionEvaluator):
    """A judge that labels and keeps some transitions that it is asked about, and calls the others infeasible.

    Attributes:
        robot: The robot.
        quota: Takes the samples and tells which are still wanted.
        balance: Decides how many states to disturb.
        config: What to collect.
        rng: Source of every random draw.
        ground: The ground on which transitions are collected.
    """

    robot: RobotModel
    quota: Quota
    balance: Balance
    config: CollectConfig
    rng: np.random.Generator
    ground: Ground

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """See `TransitionEvaluator`."""
        n = len(transitions)
        result = TransitionBatch(np.zeros(n, bool), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))
        if self.quota.full:
            return result
        groups: dict[tuple[int, int], list[int]] = {}
        numbers = category_rows(stance, transitions).tolist()
        for index, (item, number) in enumerate(zip(transitions, numbers, strict=True)):
            groups.setdefault((item.limb, number), []).append(index)
        categories = [Category(number) for _, number in groups]
        chosen = self._choose([np.array(rows) for rows in groups.values()], categories)
        friction = None if self.ground == Ground.DEFAULT else float(self.rng.uniform(*self.config.friction))
        old = stance if friction is None else Stance(tuple(replace(c, friction=friction) for c in stance.contacts))
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
        """Label transitions of one category and limb from disturbed states; add them to the quota and the result."""
        n, rng, config = len(items), self.rng, self.config
        again = np.concatenate([[False], rows[1:] == rows[:-1]])  # the same transition from another state
        near = rng.random(n) * (again | (rng.random(n) < config.near))
        is_far = rng.random(n) < self.balance.probability(category, self.ground)
        scale = np.where(is_far, rng.uniform(*config.far, n), near)
        turn = scale[:, None] * (rng.normal(size=(2, n, 3)))
        forward = stance.mean_feet.rotation.T
        start = com + (turn[0] * config.com_spread) @ forward
        velocity = com_velocity + (turn[1] * config.velocity_spread) @ forward
        if self.ground == Ground.SLOPE:
            runs = rng.random(n) < config.run_share
            start[runs], velocity[runs], is_far = *self._running(stance, int(runs.sum())), is_far & ~runs
        batch = label(self.robot, stance, start, velocity, items)
        limit = config.default_limit if self.ground == Ground.DEFAULT else config.objective_limit
        limit = np.where(is_far, config.disturbed_limit, limit)
        kept = ~batch.feasible | (batch.objective <= limit)
        self.quota.add(category, samples_of(stance, start, velocity, items, batch).select(kept))
        self.balance.count(category, self.ground, batch.feasible[kept])
        # A planner never meets the states after a large disturbance.
        on = np.flatnonzero(batch.feasible & kept & ~is_far)
        result.feasible[rows[on]], result.objective[rows[on]] = True, batch.objective[on]
        result.com[rows[on]], result.com_velocity[rows[on]] = batch.com[on], batch.com_velocity[on]

    def _running(self, stance: Stance, count: int) -> tuple[np.ndarray, np.ndarray]:
        """CoM (n, 3) m and velocity (n, 3) m/s of a robot that runs along the ground where its feet point."""
        config, rng, feet = self.config, self.rng, stance.mean_feet
        ahead = feet.rotation[:, 0]
        normal = np.sum([contact.pose.rotation[:, 2] for contact in stance.feet], axis=0)
        ahead = ahead - normal * (ahead @ normal) / (normal @ normal)
        ahead /= np.linalg.norm(ahead)
        spread = rng.uniform(-1.0, 1.0, (count, 3)) * config.run_spread
        spread[:, 2] -= config.run_spread[2] / 2  # low more often than high
        com = feet.position + [0.0, 0.0, self.robot.com_height] + spread @ feet.rotation.T
        speed = rng.uniform(*config.run_speed, (count, 1))
        return com, speed * ahead + (rng.normal(size=(count, 3)) * config.velocity_spread) @ feet.rotation.T

    def _pass_on(self, stance: Stance, transitions: Sequence[ContactTransition], result: TransitionBatch) -> None:
        """Keep a few of the feasible transitions, mostly those into stances from which samples are lacking."""
        rows = np.flatnonzero(result.feasible)
        if len(rows) <= self.config.children:
            return
        lack = [
            max((self.quota.lack(c) for c in self.quota.categories if c.palms_before == count), default=0)
            for count in range(len(PALMS) + 1)
        ]
        after = [len(transitions[row].apply(stance).palms) for row in rows]
        weight = np.array([lack[count] + 1.0 for count in after]) / np.bincount(after, minlength=len(lack))[after]
        kept = self.rng.choice(rows, self.config.children, replace=False, p=weight / weight.sum())
        result.feasible[np.setdiff1d(rows, kept)] = False

    def _vary(self, transition: ContactTransition, friction: float | None) -> ContactTransition:
        """The transition with a random timing and the given friction; unchanged where the friction is None."""
        if friction is None:
            return transition
        config, contact = self.config, transition.contact
        quick = self.ground == Ground.SLOPE
        ranges = (config.slope_shift, config.slope_swing) if quick else (config.shift, config.swing)
        shift, swing = (float(np.exp(self.rng.uniform(*np.log(bounds)))) for bounds in ranges)
        new = None if contact is None else replace(contact, friction=friction)
        return ContactTransition(transition.limb, new, Timing(shift, swing))

    def _choose(self, groups: list[np.ndarray], categories: list[Category]) -> list[np.ndarray]:
        """Rows of each group to label: more of categories that lack more samples, a few where none lacks any."""
        rng, lack = self.rng, np.array([float(self.quota.lack(category)) for category in categories])
        budget = self.config.considered if lack.any() else _TO_GO_ON
        weight = lack if lack.any() else np.ones(len(lack))
        sizes = rng.multinomial(budget, weight / weight.sum())
        chosen = []
        for rows, size in zip(groups, sizes, strict=True):
            times = min(-(-size // len(rows)), _REPEATS)  # palms break in few ways, so repeat these
            copies = np.repeat(rows, times)
            chosen.append(np.sort(rng.choice(copies, min(size, len(copies)), replace=False)))
        return chosen
