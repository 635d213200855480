"""Exclusions: contact transitions that later stages rejected, so that the next search avoids them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import Limb

_RADIUS = 0.03  # m; contacts no farther apart count as the same


@dataclass(frozen=True)
class Exclusion:
    """A transition out of a stance that proved impossible; it also stands for those that are nearly the same.

    Attributes:
        limb: The limb that moves.
        before: (4, 3) m; positions of the contacts before, NaN where there is none.
        target: (3,) m; position of the new contact, NaN where a palm breaks.
    """

    limb: Limb
    before: np.ndarray
    target: np.ndarray

    @classmethod
    def of(cls, stance: Stance, transition: ContactTransition) -> Exclusion:
        """The exclusion of a transition out of a stance."""
        before = np.full((4, 3), np.nan)
        for contact in stance.contacts:
            before[contact.limb] = contact.pose.position
        target = np.full(3, np.nan) if transition.contact is None else transition.contact.pose.position
        return cls(transition.limb, before, target)


def excluded(exclusions: Sequence[Exclusion], before: np.ndarray, limb: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(n,) bool; which candidates are nearly the same as an excluded transition.

    Args:
        exclusions: The transitions to avoid.
        before: (4, 3) m; contacts of the state, NaN where there is none.
        limb: (n,) int; the limb that moves.
        target: (n, 3) m; position of the new contact, NaN where a palm breaks.
    """
    result = np.zeros(len(limb), bool)
    for item in exclusions:
        if _near(before, item.before).all():
            result |= (limb == item.limb) & _near(target, item.target)
    return result


def _near(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...,) bool; whether points (..., 3) are the same within `_RADIUS`, or both absent (NaN)."""
    absent = np.isnan(a[..., 0]) & np.isnan(b[..., 0])
    return absent | (np.linalg.norm(a - b, axis=-1) <= _RADIUS)
