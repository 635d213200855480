"""What a shard still wants: samples of every category, and the right share of infeasible ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, auto

import numpy as np

from toolkit.contacts.category import Category
from toolkit.learning.samples import Samples, join, no_samples


class Ground(Enum):
    """Ground that transitions are collected on: the paper's tiles and timing, any tilts and timings, a slope."""

    DEFAULT = auto()
    VARIED = auto()
    SLOPE = auto()


@dataclass
class Quota:
    """Samples of one shard as they come in.

    Attributes:
        wanted: number of samples wanted of each category.
        categories: categories that the robot can perform.
        found: the samples by category, group by group.
        counts: their numbers.
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
        return {category: join(parts) for category, parts in self.found.items()}


@dataclass
class Balance:
    """Decides which initial states to disturb, so that the label "infeasible" reaches its share.

    Attributes:
        wanted: that share.
        counts: infeasible and all transitions so far, by category and ground.
    """

    wanted: float
    counts: dict[tuple[Category, Ground], list[int]] = field(default_factory=dict)

    def probability(self, category: Category, ground: Ground) -> float:
        """Probability with which the next state is disturbed by much."""
        infeasible, total = self.counts.get((category, ground), (0, 0))
        share = (infeasible + 1.0) / (total + 1.0 / self.wanted)
        return float(np.clip(0.4 + 4.0 * (self.wanted - share), 0.02, 0.9))

    def count(self, category: Category, ground: Ground, feasible: np.ndarray) -> None:
        """Enter the labels (n,) of transitions."""
        pair = self.counts.setdefault((category, ground), [0, 0])
        pair[0] += int((~feasible).sum())
        pair[1] += len(feasible)
