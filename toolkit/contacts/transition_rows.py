"""Many contact transitions out of one stance as arrays, for those who judge them together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from toolkit.contacts.sequence import ContactTransition


@dataclass(frozen=True)
class TransitionRows(Sequence[ContactTransition]):
    """Transitions by rows; one that is asked for by its index is made then.

    Attributes:
        limb: (n,) int; that moves.
        makes: (n,) bool; False where a palm breaks: its row of the contact's arrays says nothing.
        position: (n, 3) m; of the new contact.
        rotation: (n, 3, 3); its world_from_contact.
        friction: (n,); its coefficient.
        shift: (n,) s.
        swing: (n,) s.
        make: the transition of a row.
    """

    limb: np.ndarray
    makes: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    friction: np.ndarray
    shift: np.ndarray
    swing: np.ndarray
    make: Callable[[int], ContactTransition]

    @classmethod
    def of(cls, transitions: Sequence[ContactTransition]) -> TransitionRows:
        """Rows of transitions that exist; they themselves where they are rows already."""
        if isinstance(transitions, cls):
            return transitions
        n = len(transitions)
        position, rotation, friction = np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros(n)
        for row, item in enumerate(transitions):
            if item.contact is not None:
                position[row], rotation[row] = item.contact.pose.position, item.contact.pose.rotation
                friction[row] = item.contact.friction
        return cls(
            np.array([item.limb for item in transitions], int),
            np.array([item.contact is not None for item in transitions], bool),
            position,
            rotation,
            friction,
            np.array([item.timing.shift for item in transitions], float),
            np.array([item.timing.swing for item in transitions], float),
            transitions.__getitem__,
        )

    def __len__(self) -> int:
        return len(self.limb)

    @overload
    def __getitem__(self, index: int) -> ContactTransition: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[ContactTransition]: ...

    def __getitem__(self, index: int | slice) -> ContactTransition | Sequence[ContactTransition]:
        if isinstance(index, slice):
            return self.select(np.arange(len(self))[index])
        return self.make(range(len(self))[index])

    def select(self, rows: np.ndarray) -> TransitionRows:
        """Some of them, by index."""
        rows = np.asarray(rows)
        return TransitionRows(
            self.limb[rows],
            self.makes[rows],
            self.position[rows],
            self.rotation[rows],
            self.friction[rows],
            self.shift[rows],
            self.swing[rows],
            lambda row: self.make(int(rows[row])),
        )
