"""Variants of a contact sequence: a few transitions left out, swapped, or replaced by others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.refine.chains import FootChains
from toolkit.refine.foresight import Walk
from toolkit.search.sequence_screen import SequenceScreen

_APART = 3  # transitions; two that are farther apart can be left out together if each of them can be left out alone
_WINDOW = 7  # most transitions that are replaced together
_LESS, _MORE = 3, 2  # most by which their number falls or rises
_STEPS = 5  # most transitions that replace them


def left_out(sequence: ContactSequence, screen: SequenceScreen) -> Iterator[ContactSequence]:
    """Sequences without one or two of the transitions, as far as the screens let them pass."""
    n = len(sequence.transitions)
    alone = set()
    for index in range(n):
        variant = _without(sequence, {index})
        if screen.passes(variant):
            alone.add(index)
            yield variant
    for first in range(n):
        for second in range(first + 1, n):
            if second - first > _APART and not {first, second} <= alone:
                continue
            variant = _without(sequence, {first, second})
            if screen.passes(variant):
                yield variant


def without_palms(sequence: ContactSequence, screen: SequenceScreen) -> Iterator[ContactSequence]:
    """Sequences in which a palm does not touch, from its first contact on until it breaks; also all palms together."""
    episodes: list[set[int]] = []
    for palm in PALMS:
        moves = [index for index, item in enumerate(sequence.transitions) if item.limb == palm]
        current: set[int] = set()
        for index in moves:
            current.add(index)
            if sequence.transitions[index].contact is None:
                episodes.append(current)
                current = set()
        if current:
            episodes.append(current)
    for dropped in [*episodes, set().union(*episodes)]:
        variant = _without(sequence, dropped)
        if dropped and screen.passes(variant):
            yield variant


def swapped(sequence: ContactSequence, screen: SequenceScreen) -> Iterator[ContactSequence]:
    """Sequences in which two transitions that follow each other have changed places."""
    for index in range(len(sequence.transitions) - 1):
        transitions = list(sequence.transitions)
        transitions[index : index + 2] = transitions[index : index + 2][::-1]
        variant = replace(sequence, transitions=tuple(transitions))
        if screen.passes(variant):
            yield variant


def relinked(sequence: ContactSequence, chains: FootChains) -> Iterator[Iterator[ContactSequence]]:
    """Sequences in which other steps lead from one stance to a later one: fewer, as many or a few more.

    Those with as many steps between the same stances come together, since they differ little, the one on which the CoM
    travels least first. New contacts in between are steps that the search itself would consider, near the straight way
    of their foot.
    """
    transitions, links = sequence.transitions, _Links(sequence, chains)
    for first in range(len(transitions)):
        if not transitions[first].limb.is_foot:
            continue
        for last in range(first + 2, min(first + _WINDOW, len(transitions)) + 1):
            if not transitions[last - 1].limb.is_foot:
                break
            steps = last - first
            for count in range(max(1, steps - _LESS), min(steps + _MORE, _STEPS) + 1):
                yield links.between(first, last, count)


def _without(sequence: ContactSequence, dropped: set[int]) -> ContactSequence:
    """The sequence without the transitions of some indices."""
    kept = (item for index, item in enumerate(sequence.transitions) if index not in dropped)
    return replace(sequence, transitions=tuple(kept))


class _Links:
    """Chains of steps from one stance of a sequence to a later one.

    Args:
        sequence: The sequence.
        chains: Chains of steps out of the moves of its search.
    """

    def __init__(self, sequence: ContactSequence, chains: FootChains):
        self._sequence, self._chains, self._screen = sequence, chains, chains.screen
        self._stances, self._numbers = sequence.stances, chains.screen.numbers(sequence)
        self._walk = Walk.of(sequence)

    def between(self, first: int, last: int, count: int) -> Iterator[ContactSequence]:
        """Sequences with chains of `count` steps from the stance `first` to the stance `last`, between feet alone."""
        transitions, end = self._sequence.transitions, self._stances[last]
        timing, before = transitions[first].timing, transitions[first - 1].limb if first else None
        chains: list[tuple[tuple[Limb, ...], np.ndarray]] = []
        for foot in FEET:
            limbs = tuple(foot if index % 2 == 0 else foot.mirrored for index in range(count))
            follows = last == len(transitions) or transitions[last].limb != limbs[-1]
            if foot != before and follows:
                made = self._chains.between(self._numbers[first], self._numbers[last], limbs, timing)
                chains += [(limbs, rows) for rows in made]
        for limbs, rows in self._shortest_first(first, last, chains):
            ends, table = max(count - 2, 0), self._screen.table
            if any(
                self._screen.code(rows[index], limbs[index], int(rows[index + 1, limbs[index]]), timing)
                for index in range(ends, count)
            ):
                continue
            contacts = [
                end[limb] if index >= ends else table.contact(int(rows[index + 1, limb]))
                for index, limb in enumerate(limbs)
            ]
            chain = tuple(map(ContactTransition, limbs, contacts, [timing] * count))
            changed = ContactSequence(self._stances[first], (*chain, *transitions[last : last + 1]))
            if self._screen.passes(changed, before):
                yield replace(self._sequence, transitions=(*transitions[:first], *chain, *transitions[last:]))

    def _shortest_first(
        self, first: int, last: int, chains: list[tuple[tuple[Limb, ...], np.ndarray]]
    ) -> list[tuple[tuple[Limb, ...], np.ndarray]]:
        """Chains of as many steps each, in the order of what the CoM travels on them."""
        if len(chains) < 2:
            return chains
        between = np.array([rows[1:-1, : len(FEET)] for _, rows in chains])
        standing = np.array([[limb.mirrored for limb in limbs] for limbs, _ in chains])
        begin = max(0, first - 1)  # one transition more on either side is what they share
        walk = self._walk.part(begin, last + 1)
        walks = walk.linked(first - begin, last - begin, self._screen.table.position[between], standing)
        order = np.argsort(walks.travel(self._screen.scale.time), kind="stable")
        return [chains[index] for index in order]
