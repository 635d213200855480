"""Variants of a contact sequence: a few transitions left out, swapped, or replaced by others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.heading import wrapped
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.search.sequence_screen import SequenceScreen

_APART = 3  # transitions; two that are farther apart can be left out together if each of them can be left out alone
_WINDOW = 7  # most transitions that are replaced together
_LESS, _MORE = 3, 2  # most by which their number falls or rises
_STEPS = 5  # most transitions that replace them
_BEAM = 4  # most places that are tried for a new contact in between
# m of distance that 1 rad of turning counts as for a body of the usual size (`toolkit.robot.scale`), to compare places
_TURN = 0.1


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


def relinked(sequence: ContactSequence, screen: SequenceScreen) -> Iterator[list[ContactSequence]]:
    """Sequences in which other steps lead from one stance to a later one: fewer, as many or a few more.

    Those with as many steps between the same stances come together, since they differ little.

    New contacts in between are steps that the search itself would consider, near the straight way of their foot.
    """
    transitions, stances = sequence.transitions, sequence.stances
    for first in range(len(transitions)):
        for last in range(first + 2, min(first + _WINDOW, len(transitions)) + 1):
            window = transitions[first:last]
            if not window[-1].limb.is_foot:
                break
            for count in range(max(1, len(window) - _LESS), min(len(window) + _MORE, _STEPS) + 1):
                before = transitions[first - 1].limb if first else None
                group = []
                for chain in _chains(stances[first], before, stances[last], count, window, screen):
                    changed = ContactSequence(stances[first], (*chain, *transitions[last : last + 1]))
                    if screen.passes(changed, before):
                        made = (*transitions[:first], *chain, *transitions[last:])
                        group.append(replace(sequence, transitions=made))
                yield group


def _without(sequence: ContactSequence, dropped: set[int]) -> ContactSequence:
    """The sequence without the transitions of some indices."""
    kept = (item for index, item in enumerate(sequence.transitions) if index not in dropped)
    return replace(sequence, transitions=tuple(kept))


def _chains(
    start: Stance,
    moved_last: Limb | None,
    end: Stance,
    count: int,
    window: tuple[ContactTransition, ...],
    screen: SequenceScreen,
) -> Iterator[tuple[ContactTransition, ...]]:
    """Chains of `count` steps from one stance to the feet of another, in place of the transitions of a window."""
    if any(not item.limb.is_foot for item in window):
        return
    timing = window[0].timing
    for foot in FEET:
        if foot == moved_last:
            continue
        limbs = [foot if index % 2 == 0 else foot.mirrored for index in range(count)]
        if count == 1 and _moved(start, end, foot.mirrored):
            continue
        free = max(count - 2, 0)
        total = {limb: limbs.count(limb) for limb in FEET}
        beam: list[tuple[Stance, tuple[ContactTransition, ...]]] = [(start, ())]
        for index in range(free):
            limb = limbs[index]
            share = (limbs[: index + 1].count(limb)) / total[limb]
            beam = [
                (step.apply(stance), (*chain, step))
                for stance, chain in beam
                for step in _nearest(screen.steps(stance, limb, timing), start, end, limb, share, screen.scale.length)
            ]
        for _, chain in beam:
            ends = tuple(ContactTransition(limb, end[limb], timing) for limb in limbs[free:])
            yield (*chain, *ends)


def _moved(start: Stance, end: Stance, foot: Limb) -> bool:
    """Whether a foot stands elsewhere in another stance."""
    return bool((start[foot].pose.position != end[foot].pose.position).any())


def _nearest(
    steps: list[ContactTransition], start: Stance, end: Stance, foot: Limb, share: float, scale: float
) -> list[ContactTransition]:
    """The steps nearest to a share of the straight way of a foot between two stances; `scale` is that of lengths."""
    first, last = start[foot].pose, end[foot].pose
    place = first.position + share * (last.position - first.position)
    yaw = first.yaw + share * wrapped(last.yaw - first.yaw)

    def miss(step: ContactTransition) -> float:
        assert step.contact is not None
        pose = step.contact.pose
        away = pose.position - place
        return float((away @ away) ** 0.5 + scale * _TURN * abs(wrapped(pose.yaw - yaw)))

    return sorted(steps, key=miss)[:_BEAM]
