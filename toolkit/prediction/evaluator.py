"""The place where transitions are judged: by networks, by the optimiser, or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance


@dataclass(frozen=True)
class TransitionBatch:
    """Judgement of n transitions out of one parent state.

    Attributes:
        feasible: (n,) bool.
        objective: (n,) dynamics objective, >= 0.
        com: (n, 3) m, world frame, after the transition.
        com_velocity: (n, 3) m/s.
    """

    feasible: np.ndarray
    objective: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray


class TransitionEvaluator(Protocol):
    """Judges all candidate transitions of one parent state together."""

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """Judge transitions from a stance with CoM (3,) m and CoM velocity (3,) m/s in the world frame."""
        ...
