"""The interface of all judges of transitions: networks, optimiser, static balance, or kinematics alone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance


@dataclass(frozen=True)
class TransitionBatch:
    """Judgement of n transitions out of one parent state.

    Attributes:
        feasible: (n,) bool.
        objective: (n,) dynamics objective, >= 0.
        com: (n, 3) m; CoM after the transition, world frame.
        com_velocity: (n, 3) m/s; its velocity, world frame.
        untrained: How many of the transitions lay outside what the judge was trained for.
    """

    feasible: np.ndarray
    objective: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    untrained: int = field(default=0, kw_only=True)


class TransitionEvaluator(ABC):
    """Judges all candidate transitions of one parent state together.

    Attributes:
        costly: Whether a search should ask about one transition at a time, since each takes some milliseconds.
        rejection: What it means that a transition is infeasible, for messages.
    """

    costly: bool = False
    rejection: str = "dynamics"

    @abstractmethod
    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """Judge transitions from a stance with CoM (3,) m and CoM velocity (3,) m/s in the world frame."""
