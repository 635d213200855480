"""Where states, wrenches and slacks are in the vector of variables of a sequence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.pieces import CONTACT, SLACKS, STATE


@dataclass(frozen=True)
class Layout:
    """Where things are in the vector of variables.

    Attributes:
        offset: (N + 1,) first variable of each stage.
        wrench: (N, 4) first variable of a limb's wrench; -1 where not active.
        slack: (N + 1, 2) variables of the excess and of the body's slack; at the last knot both are the body's.
        states, controls: (N + 1,) sizes.
    """

    offset: np.ndarray
    wrench: np.ndarray
    slack: np.ndarray
    states: np.ndarray
    controls: np.ndarray

    @classmethod
    def of(cls, active: np.ndarray) -> Layout:
        """Layout for (N, 4) active contacts."""
        count = active.sum(1)
        controls = np.append(CONTACT * count + SLACKS, 1)
        states = np.full(len(controls), STATE)
        offset = np.concatenate([[0], np.cumsum(states + controls)[:-1]])
        rank = np.cumsum(active, 1) - 1
        wrench = np.where(active, offset[:-1, None] + STATE + CONTACT * rank, -1)
        slack = (offset[:-1] + STATE + CONTACT * count)[:, None] + np.arange(SLACKS)
        slack = np.concatenate([slack, np.full((1, SLACKS), offset[-1] + STATE)])
        return cls(offset, wrench, slack, states, controls)

    @property
    def size(self) -> int:
        """Number of variables."""
        return int((self.states + self.controls).sum())


def indices(first: np.ndarray, size: int) -> np.ndarray:
    """(n, size) consecutive indices from (n,) first ones."""
    return first[:, None] + np.arange(size)
