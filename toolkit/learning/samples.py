"""Samples: judged transitions of one category, as data sets hold them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum

import numpy as np

from toolkit.contacts.category import Category
from toolkit.prediction.features import TARGETS, TIMING_AND_FRICTION, feature_size
from toolkit.world.timing import Timing

PAPER = Timing()
"""The paper's timing of a transition."""
PLANNED = Timing(0.6, 0.8)
"""The timing at which planners are compared."""
_FRICTION = 0.5  # the paper's


class Split(Enum):
    """What a world's samples are for; the values are the remainders of the world's number divided by ten."""

    TRAINING = range(8)
    VALIDATION = range(8, 9)
    TEST = range(9, 10)


@dataclass(frozen=True)
class Samples:
    """Judged transitions of one category.

    Attributes:
        features: (n, d) float32; canonical features, see `features.encode`.
        feasible: (n,) bool; whether each transition is feasible.
        targets: (n, 7) float32; objective of the transition's part of its whole motion, CoM (m) and CoM velocity (m/s)
            at its end. NaN where no whole motion is known: in all infeasible transitions and some feasible ones.
        goal: (n, 3) float32; from the mean of the feet before the transition to where the sequence ends, in m, in the
            canonical frame of the features.
        world: (n,) int32; number of the world that the transition comes from.
    """

    features: np.ndarray
    feasible: np.ndarray
    targets: np.ndarray
    goal: np.ndarray
    world: np.ndarray

    def __len__(self) -> int:
        return len(self.features)

    @property
    def known(self) -> np.ndarray:
        """(n,) bool; whether the outcome of each transition is known."""
        return ~np.isnan(self.targets[:, 0])

    def select(self, rows: np.ndarray | slice) -> Samples:
        """The samples of these rows."""
        return Samples(*(getattr(self, part)[rows] for part in PARTS))

    def of(self, split: Split) -> Samples:
        """The samples of the worlds of one split."""
        return self.select(np.isin(self.world % 10, split.value))

    def at_default(self) -> Samples:
        """The samples with the paper's timing (1 s + 1 s) and friction (0.5)."""
        last = self.features[:, TIMING_AND_FRICTION]
        wanted = np.array([PAPER.shift, PAPER.swing, _FRICTION], np.float32)
        return self.select(np.flatnonzero(np.isclose(last, wanted, rtol=0, atol=1e-5).all(1)))


PARTS = tuple(part.name for part in fields(Samples))
"""Names of the arrays of samples."""


def no_samples(category: Category) -> Samples:
    """An empty set of samples with the columns of a category."""
    features, targets = np.zeros((0, feature_size(category)), np.float32), np.zeros((0, TARGETS), np.float32)
    return Samples(features, np.zeros(0, bool), targets, np.zeros((0, 3), np.float32), np.zeros(0, np.int32))


def join(groups: list[Samples]) -> Samples:
    """All groups of samples of one category, one after the other."""
    return Samples(*(np.concatenate([getattr(group, part) for group in groups]) for part in PARTS))
