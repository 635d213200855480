"""Contact transitions, and sequences of them."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from functools import cached_property

from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.world.timing import Timing


@dataclass(frozen=True)
class ContactTransition:
    """One limb moves to a new contact, or a palm breaks its contact.

    Attributes:
        limb: The limb that moves.
        contact: The new contact, None where a palm breaks its contact.
        timing: Times of the shift and the swing.
    """

    limb: Limb
    contact: Contact | None
    timing: Timing = Timing()

    def __post_init__(self):
        if self.contact is None and self.limb.is_foot:
            raise ValueError("a foot contact cannot be broken without a new one")
        if self.contact is not None and self.contact.limb != self.limb:
            raise ValueError(f"{self.limb.label} cannot move to a contact of {self.contact.limb.label}")

    @cached_property
    def identity(self) -> bytes:
        """Bytes that are equal for equal transitions: limb, contact and timing, to the last bit."""
        times = struct.pack("2d", self.timing.shift, self.timing.swing)
        return bytes([self.limb]) + times + (b"" if self.contact is None else self.contact.identity)

    def apply(self, stance: Stance) -> Stance:
        """The stance after the transition."""
        return stance.without(self.limb) if self.contact is None else stance.replace(self.contact)

    def during_swing(self, stance: Stance) -> tuple[Contact, ...]:
        """Contacts of `stance` that stay while the limb moves."""
        return tuple(contact for contact in stance.contacts if contact.limb != self.limb)


@dataclass(frozen=True)
class ContactSequence:
    """A start stance and the transitions from it.

    Attributes:
        start: The stance in which the robot starts at rest.
        transitions: The transitions in order, perhaps none.
    """

    start: Stance
    transitions: tuple[ContactTransition, ...]

    @cached_property
    def stances(self) -> tuple[Stance, ...]:
        """(len(transitions) + 1,) stances: the start, then the one after each transition."""
        stances = [self.start]
        for transition in self.transitions:
            stances.append(transition.apply(stances[-1]))
        return tuple(stances)

    def timed(self, timing: Timing, only: int | None = None) -> ContactSequence:
        """The same contacts with one timing for all transitions, or for one of them alone."""
        return replace(
            self,
            transitions=tuple(
                replace(each, timing=timing) if only in (None, index) else each
                for index, each in enumerate(self.transitions)
            ),
        )

    def part(self, first: int, end: int) -> ContactSequence:
        """Its transitions [first, end), from the stance before them."""
        return ContactSequence(self.stances[first], self.transitions[first:end])

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Every contact: those of the start, then what each transition makes."""
        return *self.start.contacts, *(t.contact for t in self.transitions if t.contact is not None)

    @cached_property
    def identity(self) -> bytes:
        """Bytes that are equal for equal sequences: limbs, places, surfaces and timings, to the last bit."""
        return b"|".join((self.start.identity, *self.identities))

    @cached_property
    def identities(self) -> tuple[bytes, ...]:
        """(transitions,) the transitions' `identity`."""
        return tuple(each.identity for each in self.transitions)

    @property
    def duration(self) -> float:
        """Length of all transitions in s."""
        return sum(transition.timing.shift + transition.timing.swing for transition in self.transitions)


@dataclass(frozen=True)
class Change:
    """Where two sequences from one stance differ, with some transitions more on both sides.

    Attributes:
        old: That part of the first sequence.
        new: The same of the second one, which ends in the same stance.
        first: Number of their first transition, in both sequences.
        following: The transition after them, in both; None where they are the ends of the sequences.
    """

    old: ContactSequence
    new: ContactSequence
    first: int
    following: ContactTransition | None

    @classmethod
    def between(cls, old: ContactSequence, new: ContactSequence, around: int) -> Change:
        """Where two sequences differ, and `around` transitions on either side of that."""
        a, b = old.identities, new.identities
        least = min(len(a), len(b))
        before = next((index for index in range(least) if a[index] != b[index]), least)
        after = next((index for index in range(least - before) if a[-1 - index] != b[-1 - index]), least - before)
        stance = old.stances[before]
        for transition in new.transitions[before : len(b) - after]:
            stance = transition.apply(stance)
        while after and stance.identity != old.stances[len(a) - after].identity:
            stance, after = new.transitions[len(b) - after].apply(stance), after - 1
        first, kept = max(0, before - around), max(0, after - around)
        part = old.part(first, len(a) - kept)
        changed = replace(part, transitions=new.transitions[first : len(b) - kept])
        return cls(part, changed, first, old.transitions[-kept] if kept else None)
