"""Many contact transitions out of one stance as arrays, so that they can be judged together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from toolkit.contacts.sequence import ContactTransition


@dataclass(frozen=True)
class TransitionRows(Sequence[ContactTransition]):
    """Transitions as rows of arrays.

    Attributes:
        limb: (n,) int The limb that moves.
        makes: (n,) bool False where a palm breaks its contact; its rows of the next three arrays mean nothing then.
        position: (n, 3) Place of the new contact, in m.
        rotation: (n, 3, 3) world_from_contact of the new contact.
        friction: (n,) Coulomb coefficient of the new contact.
        shift, swing: (n,) Times of the transition, in s.
        make: Makes the transition of a row when it is asked for by index.
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
        """Rows of the given transitions; these themselves where they are rows already."""
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
        """The transitions of these rows, by index."""
        arrays = self.limb, self.makes, self.position, self.rotation, self.friction, self.shift, self.swing
        return TransitionRows(*(array[rows] for array in arrays), make=lambda row: self.make(int(rows[row])))
