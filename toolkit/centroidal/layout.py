"""Where states, wrenches and slacks are in the vector of variables of a sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.pieces import CONTACT, SLACKS, STATE
from toolkit.geometry.limb import FEET

PAIRS = len(FEET) + 1  # displacements of the feet's contacts, and of the one that the foot in the air has left


@dataclass(frozen=True)
class Layout:
    """Where things are in the vector of variables.

    Attributes:
        offset: (N + 1,) first variable of each stage.
        wrench: (N, 4) first variable of a limb's wrench; -1 where not active.
        slack: (N + 1, 2) variables of the excess and of the body's slack; at the last knot both are the body's.
        landing: (N,) first variable of a landing point that is chosen in a step; -1 where none is.
        states, controls: (N + 1,) sizes.
        moving: whether contacts are displaced by variables.
    """

    offset: np.ndarray
    wrench: np.ndarray
    slack: np.ndarray
    landing: np.ndarray
    states: np.ndarray
    controls: np.ndarray
    moving: bool

    @classmethod
    def of(cls, active: np.ndarray, landings: Sequence[int] | None = None) -> Layout:
        """Layout for (N, 4) active contacts; `landings` are the steps that choose a landing point, None for none."""
        moving = landings is not None
        count = active.sum(1)
        chooses = np.zeros(len(active), bool)
        chooses[list(landings or ())] = True
        controls = np.append(CONTACT * count + SLACKS + 2 * chooses, 1)
        states = np.full(len(controls), STATE + 2 * PAIRS * moving)
        offset = np.concatenate([[0], np.cumsum(states + controls)[:-1]])
        rank = np.cumsum(active, 1) - 1
        first = offset + states
        wrench = np.where(active, first[:-1, None] + CONTACT * rank, -1)
        slack = (first[:-1] + CONTACT * count)[:, None] + np.arange(SLACKS)
        slack = np.concatenate([slack, np.full((1, SLACKS), first[-1])])
        landing = np.where(chooses, first[:-1] + CONTACT * count + SLACKS, -1)
        return cls(offset, wrench, slack, landing, states, controls, moving)

    def pair(self, knot: np.ndarray, which: int | np.ndarray) -> np.ndarray:
        """(n, 2) variables at (n,) knots of the displacement of a foot's contact, or of the one left (len(FEET))."""
        return indices(self.offset[knot] + STATE + 2 * np.asarray(which), 2)

    @property
    def size(self) -> int:
        """Number of variables."""
        return int((self.states + self.controls).sum())


def indices(first: np.ndarray, size: int) -> np.ndarray:
    """(n, size) consecutive indices from (n,) first ones."""
    return first[:, None] + np.arange(size)
