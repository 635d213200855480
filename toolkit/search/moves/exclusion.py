"""Exclusions: contact transitions that failed, so that a search avoids them and those like them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import Limb

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_RADIUS = 0.03  # m; contacts no farther apart count as the same
_PLACE = 0.06  # m; where a transition was excluded and one no farther off fails, this far around it all are excluded


@dataclass(frozen=True)
class Exclusion:
    """A transition out of a stance that proved impossible; it also stands for those that are nearly the same.

    Attributes:
        limb: The limb that moves.
        before: (4, 3) m; positions of the contacts before, NaN where there is none.
        target: (3,) m; position of the new contact, NaN where a palm breaks.
        radius: m; contacts no farther apart count as the same.
    """

    limb: Limb
    before: np.ndarray
    target: np.ndarray
    radius: float = _RADIUS

    @classmethod
    def of(cls, stance: Stance, transition: ContactTransition, radius: float = _RADIUS) -> Exclusion:
        """The exclusion of a transition out of a stance; `radius` as above."""
        before = np.full((4, 3), np.nan)
        for contact in stance.contacts:
            before[contact.limb] = contact.pose.position
        target = np.full(3, np.nan) if transition.contact is None else transition.contact.pose.position
        return cls(transition.limb, before, target, radius)

    def covers(self, other: Exclusion, radius: float | None = None) -> bool:
        """Whether it stands for another transition as well; `radius` in m takes the place of its own."""
        item = self if radius is None else replace(self, radius=radius)
        return bool(excluded([item], other.before, np.array([other.limb]), other.target[None])[0])


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
        if _near(before, item.before, item.radius).all():
            result |= (limb == item.limb) & _near(target, item.target, item.radius)
    return result


def to_blame(sequence: ContactSequence, index: int | None) -> int | None:
    """The transition to blame for a failure in a transition, the last one for the final rest; None where there is none.

    `index` is `Failure.transition`.
    """
    return None if index is None or not sequence.transitions else min(index, len(sequence.transitions) - 1)


class Blame:
    """The transitions that failed so far, and which of them are to be avoided.

    A failure that repeats is answered by a change: where one transition is avoided already and another one fails close
    to it, a wider place around that one is avoided.

    Args:
        exclusions: Transitions that are avoided from the beginning.
        strikes: Failures of a transition, and those like it, after which it is avoided.
        scale: Factor on lengths.

    Attributes:
        exclusions: The transitions to avoid; it grows.
    """

    def __init__(self, exclusions: Sequence[Exclusion] = (), strikes: int = 1, scale: float = 1.0):
        self.exclusions: list[Exclusion] = list(exclusions)
        self._strikes, self._failed = strikes, []
        self._radius, self._place = scale * _RADIUS, scale * _PLACE

    def add(self, sequence: ContactSequence, index: int | None) -> None:
        """Enter a failure in a transition, as `to_blame` has it; None: where it happened is unknown."""
        index = to_blame(sequence, index)
        if index is None:
            return
        failed = Exclusion.of(sequence.stances[index], sequence.transitions[index], self._radius)
        self._failed.append(failed)
        if sum(failed.covers(each) for each in self._failed) >= self._strikes:
            again = any(failed.covers(each, self._place) for each in self.exclusions)
            self.exclusions.append(replace(failed, radius=self._place) if again else failed)

    def first_in(self, sequence: ContactSequence, since: int = 0) -> int | None:
        """Number of the first transition of a sequence that is avoided; None where there is none.

        Exclusions with a number below `since` do not count.
        """
        exclusions = self.exclusions[since:]
        if not exclusions:
            return None
        for index, (stance, transition) in enumerate(zip(sequence.stances, sequence.transitions, strict=False)):
            own = Exclusion.of(stance, transition)
            if any(each.covers(own) for each in exclusions):
                return index
        return None


def _near(a: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """(...,) bool; whether points (..., 3) are the same within a radius in m, or both absent (NaN)."""
    absent = np.isnan(a[..., 0]) & np.isnan(b[..., 0])
    return absent | (np.linalg.norm(a - b, axis=-1) <= radius)
