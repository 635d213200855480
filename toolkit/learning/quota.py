"""Samples that a shard still needs: enough labels of every category, with the right share of infeasible ones."""

from __future__ import annotations

import numpy as np

from toolkit.contacts.category import Category
from toolkit.learning.samples import Samples, join, no_samples


class Quota:
    """Samples of one shard as they come in; `wanted` labels of each of the `categories`."""

    def __init__(self, wanted: int, categories: list[Category]):
        self.categories = categories
        self._wanted = wanted
        self._found = {category: [no_samples(category)] for category in categories}
        self._labelled = dict.fromkeys(categories, 0)
        self._counts = {category: np.zeros(2, int) for category in categories}  # infeasible ones, and all

    def lack(self, category: Category) -> int:
        """Number of labels that are still wanted."""
        return max(self._wanted - self._labelled[category], 0) if category in self._labelled else 0

    @property
    def missing(self) -> int:
        """Number of labels that are still wanted, over all categories."""
        return sum(self.lack(category) for category in self.categories)

    @property
    def lacking(self) -> list[Category]:
        """Categories of which labels are still wanted."""
        return [category for category in self.categories if self.lack(category)]

    def infeasible_share(self, category: Category) -> float:
        """Share of infeasible samples of a category; 0 without samples."""
        infeasible, count = self._counts[category]
        return infeasible / max(count, 1)

    def add(self, category: Category, samples: Samples) -> None:
        """Add samples of one of the categories."""
        self._found[category].append(samples)
        self._labelled[category] += int(samples.known.sum())
        self._counts[category] += int((~samples.feasible).sum()), len(samples)

    def samples(self) -> dict[Category, Samples]:
        """All samples by category, in the order in which they came."""
        return {category: join(parts) for category, parts in self._found.items()}
