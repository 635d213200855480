"""Samples: labelled transitions of one category, as data sets hold them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.contacts.category import Category
from toolkit.learning.sensitivity import unknown_sensitivity
from toolkit.prediction.features import TARGETS, TIMING_AND_FRICTION, feature_size
from toolkit.world.timing import Timing

AT_DEFAULT = (Timing().shift, Timing().swing, 0.5)
"""Last features of transitions with the paper's timing and friction."""


@dataclass(frozen=True)
class Samples:
    """Labelled transitions of one category.

    Attributes:
        features: (n, d) float32 Canonical features, see `features.encode`.
        feasible: (n,) bool Whether each transition is feasible.
        targets: (n, 7) float32 Objective, CoM (m) and CoM velocity (m/s); zero where infeasible.
        sensitivity: (n, k) float32 Derivatives of the objective, see `learning.sensitivity`; NaN where unknown.
    """

    features: np.ndarray
    feasible: np.ndarray
    targets: np.ndarray
    sensitivity: np.ndarray

    def __len__(self) -> int:
        return len(self.features)

    def select(self, rows: np.ndarray | slice) -> Samples:
        """The samples of these rows."""
        return Samples(self.features[rows], self.feasible[rows], self.targets[rows], self.sensitivity[rows])

    def at_default(self) -> Samples:
        """The samples with the paper's timing (1 s + 1 s) and friction (0.5)."""
        last = self.features[:, TIMING_AND_FRICTION]
        wanted = np.array(AT_DEFAULT, np.float32)
        return self.select(np.flatnonzero(np.isclose(last, wanted, rtol=0, atol=1e-5).all(1)))


def no_samples(category: Category) -> Samples:
    """An empty set of samples with the columns of a category."""
    features, targets = np.zeros((0, feature_size(category)), np.float32), np.zeros((0, TARGETS), np.float32)
    return Samples(features, np.zeros(0, bool), targets, unknown_sensitivity(category, 0))


def join(groups: list[Samples]) -> Samples:
    """All groups of samples of one category, one after the other."""
    parts = [(group.features, group.feasible, group.targets, group.sensitivity) for group in groups]
    return Samples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
