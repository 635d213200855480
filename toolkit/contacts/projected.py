"""Patches that were projected on surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Projected:
    """Patches of n candidates.

    Attributes:
        surface: (n,) int Index of the surface, -1 where the patch fits on none.
        position: (n, 3) Centre of the patch in the world, in m.
        rotation: (n, 3, 3) world_from_contact.
    """

    surface: np.ndarray
    position: np.ndarray
    rotation: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """(n,) bool; whether the patch fits on a surface."""
        return self.surface >= 0

    @classmethod
    def none(cls, count: int) -> Projected:
        """Candidates whose patches fit nowhere yet."""
        return cls(np.full(count, -1), np.zeros((count, 3)), np.zeros((count, 3, 3)))

    @classmethod
    def joined(cls, parts: Sequence[Projected]) -> Projected:
        """The candidates of all parts, at least one, in their order."""
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__dataclass_fields__))

    def select(self, rows: np.ndarray) -> Projected:
        """The candidates of these rows, by index or by mask."""
        return Projected(self.surface[rows], self.position[rows], self.rotation[rows])
