"""Samples that a shard still needs: enough of every category, with the right share of infeasible ones."""

from __future__ import annotations

from enum import Enum, auto

import numpy as np

from toolkit.contacts.category import Category
from toolkit.learning.samples import Samples, join, no_samples


class Ground(Enum):
    """Ground for collections: the paper's tiles and timing, tiles with random tilts and timings, or a slope."""

    DEFAULT = auto()
    VARIED = auto()
    SLOPE = auto()


class Quota:
    """Samples of one shard as they come in; `wanted` of each of the `categories`."""

    def __init__(self, wanted: int, categories: list[Category]):
        self.categories = categories
        self._wanted = wanted
        self._found = {category: [no_samples(category)] for category in categories}
        self._counts = dict.fromkeys(categories, 0)

    def lack(self, category: Category) -> int:
        """Number of samples that are still wanted."""
        return max(self._wanted - self._counts[category], 0) if category in self._counts else 0

    @property
    def full(self) -> bool:
        """Whether there are enough samples of every category."""
        return not any(self.lack(category) for category in self.categories)

    def add(self, category: Category, samples: Samples) -> None:
        """Add samples; those of other categories are dropped."""
        if category in self._counts:
            self._found[category].append(samples)
            self._counts[category] += len(samples)

    def samples(self) -> dict[Category, Samples]:
        """All samples by category, in the order in which they came."""
        return {category: join(parts) for category, parts in self._found.items()}


class Balance:
    """Decides which initial states to disturb, so that infeasible transitions reach the share `wanted`."""

    def __init__(self, wanted: float):
        self._wanted = wanted
        self._counts: dict[tuple[Category, Ground], list[int]] = {}  # infeasible ones and all

    def probability(self, category: Category, ground: Ground) -> float:
        """Probability of a large disturbance of the next state."""
        infeasible, total = self._counts.get((category, ground), (0, 0))
        share = (infeasible + 1.0) / (total + 1.0 / self._wanted)
        return float(np.clip(0.4 + 4.0 * (self._wanted - share), 0.02, 0.9))

    def count(self, category: Category, ground: Ground, feasible: np.ndarray) -> None:
        """Count the labels (n,) of transitions."""
        pair = self._counts.setdefault((category, ground), [0, 0])
        pair[0] += int((~feasible).sum())
        pair[1] += len(feasible)
