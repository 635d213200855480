"""ContactSchedule: when each contact of a sequence holds."""

from __future__ import annotations

from dataclasses import dataclass, replace

from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb


@dataclass(frozen=True)
class Phase:
    """An interval with constant contacts.

    Attributes:
        start, end: Times in s.
        contacts: Contacts during the phase, in the order of `Limb`.
        swing: The limb that moves, None while shifting. A palm that makes or breaks its contact moves too.
        transition: Index of the transition that the phase belongs to; `len(transitions)` for the final rest.
    """

    start: float
    end: float
    contacts: tuple[Contact, ...]
    swing: Limb | None
    transition: int

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.end - self.start


@dataclass(frozen=True)
class ContactSchedule:
    """Phases of a sequence in order, without gaps: shift and swing of each transition, then a rest."""

    phases: tuple[Phase, ...]

    @classmethod
    def of(cls, sequence: ContactSequence, *, initial_rest: float = 0.0, final_rest: float = 0.0) -> ContactSchedule:
        """Schedule of a sequence.

        Args:
            sequence: The start stance and the transitions with their timing.
            initial_rest: Time that is added to the first shift, in s.
            final_rest: Time on the last stance after the last transition, in s; no phase where 0.
        """
        phases: list[Phase] = []
        stance, time, rest = sequence.start, 0.0, initial_rest
        for index, transition in enumerate(sequence.transitions):
            end = time + rest + transition.timing.shift
            phases.append(Phase(time, end, stance.contacts, None, index))
            time, rest = end, 0.0
            end = time + transition.timing.swing
            phases.append(Phase(time, end, transition.during_swing(stance), transition.limb, index))
            time, stance = end, transition.apply(stance)
        if final_rest + rest > 0.0 or not phases:
            phases.append(Phase(time, time + final_rest + rest, stance.contacts, None, len(sequence.transitions)))
        return cls(tuple(phases))

    def through(self, sequence: ContactSequence) -> ContactSchedule:
        """The same phases with the contacts of another sequence of the same limbs and timings."""
        stances, transitions = sequence.stances, sequence.transitions
        return ContactSchedule(
            tuple(
                replace(
                    phase,
                    contacts=stances[phase.transition].contacts
                    if phase.swing is None
                    else transitions[phase.transition].during_swing(stances[phase.transition]),
                )
                for phase in self.phases
            )
        )

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.phases[-1].end

    @property
    def stance_times(self) -> tuple[float, ...]:
        """(transitions + 1,) s at which each stance is complete: 0, then the end of each swing."""
        return 0.0, *(phase.end for phase in self.phases if phase.swing is not None)

    def phase_at(self, time: float) -> Phase:
        """The phase at a time in s, clamped at the ends."""
        for phase in self.phases:
            if time < phase.end:
                return phase
        return self.phases[-1]
