"""Scout: a judge with random preferences, which remembers what it was asked about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolkit.contacts.category import category_rows
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.geometry.limb import FEET, Limb
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator


class Scout(TransitionEvaluator):
    """Judges as another judge does, but multiplies each objective by a random factor of the category and by noise.

    Args:
        judge: The judge.
        factors: (len(Category),) factor of each category.
        noise: Standard deviation of the logarithm of the noise.
        rng: Source of the noise.
    """

    def __init__(self, judge: TransitionEvaluator, factors: np.ndarray, noise: float, rng: np.random.Generator):
        self._judge, self._factors, self._noise, self._rng = judge, factors, noise, rng
        self.costly, self.rejection = judge.costly, judge.rejection
        self._asked: dict[bytes, Sequence[ContactTransition]] = {}
        self._touched: dict[bytes, Sequence[ContactTransition]] = {}

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """Judge transitions; see `TransitionEvaluator`."""
        batch = self._judge.evaluate(stance, com, com_velocity, transitions)
        key = _key(stance)
        if len(transitions) > len(self._asked.get(key, ())):
            self._asked[key] = transitions
        if self._palm_rows(transitions):
            self._touched.setdefault(_key(stance, feet=True), transitions)
        noise = np.exp(self._noise * self._rng.normal(size=len(transitions)))
        factor = self._factors[category_rows(stance, transitions)]
        return replace(batch, objective=batch.objective * factor * noise)

    def asked(self, stance: Stance) -> Sequence[ContactTransition]:
        """Transitions out of a stance about which a search asked, those of the largest question."""
        return self._asked.get(_key(stance), ())

    def touched(self, stance: Stance, limb: Limb) -> list[ContactTransition]:
        """Transitions that bring a palm into contact while the feet stand as in a stance."""
        transitions = self._touched.get(_key(stance, feet=True), ())
        return [transitions[row] for row in self._palm_rows(transitions) if transitions[row].limb == limb]

    @staticmethod
    def _palm_rows(transitions: Sequence[ContactTransition]) -> list[int]:
        """Rows of the transitions that bring a palm into contact."""
        rows = TransitionRows.of(transitions)
        return np.flatnonzero((rows.limb >= len(FEET)) & rows.makes).tolist()


def _key(stance: Stance, *, feet: bool = False) -> bytes:
    """The limbs and places of a stance's contacts, or of its feet alone, to 0.1 mm."""
    contacts = stance.feet if feet else stance.contacts
    return np.round([[contact.limb, *contact.pose.position] for contact in contacts], 4).tobytes()
