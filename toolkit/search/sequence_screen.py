"""The screens of a search for sequences that were not made by it: may each transition follow on the one before?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import FEET, Limb
from toolkit.search.moves.candidates import SWING_SPEED, Candidates
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reach_check import ReachCheck
from toolkit.search.moves.reasons import Reason
from toolkit.world.timing import Timing

_KEPT = 100_000  # screens that are remembered
# m for a body of the usual size (`toolkit.robot.scale`); a ray to a palm's contact hits the palm's surface no farther
# from it than this
_AT = 0.01


class SequenceScreen:
    """Screens single transitions with the moves of one search, and whole motions with its check of what limbs reach.

    Args:
        moves: The moves of the search.
        palms: The palms that it may use.

    Attributes:
        scale: The robot's size.
        table: The contacts that the search has met.
    """

    def __init__(self, moves: MoveGenerator, palms: Sequence[Limb]):
        self._moves, self._palms = moves, palms
        self.scale, self.table = moves.robot.scale, moves.table
        self._speed, self._at = self.scale.speed * SWING_SPEED, self.scale.length * _AT
        self._known: dict[tuple, int] = {}
        self._steps: dict[tuple, np.ndarray] = {}
        self._numbers: dict[int, tuple[Contact, int]] = {}  # by the contact's id, which stays its own while it is kept

    def numbers(self, sequence: ContactSequence) -> np.ndarray:
        """(transitions + 1, 4) contact numbers of all stances in the search's table, -1 where a palm has no contact."""
        numbers = np.full((len(sequence.transitions) + 1, 4), -1)
        for contact in sequence.start.contacts:
            numbers[:, contact.limb] = self._number(contact)
        for index, transition in enumerate(sequence.transitions):
            contact = transition.contact
            numbers[index + 1 :, transition.limb] = -1 if contact is None else self._number(contact)
        return numbers

    def _number(self, contact: Contact) -> int:
        known = self._numbers.get(id(contact))
        if known is None:
            if len(self._numbers) >= _KEPT:
                self._numbers.clear()
            known = self._numbers[id(contact)] = contact, self._moves.table.add_contact(contact)
        return known[1]

    def passes(self, sequence: ContactSequence, moved_last: Limb | None = None) -> bool:
        """Whether all transitions of a sequence pass; `moved_last` is the limb that moved before the first one."""
        return not any(self._codes(sequence, moved_last))

    def codes(self, sequence: ContactSequence) -> np.ndarray:
        """(transitions,) int; the `Reason` against each transition, 0 where there is none."""
        return np.array(list(self._codes(sequence, None)), int)

    def _codes(self, sequence: ContactSequence, last: Limb | None) -> Iterator[int]:
        """See `codes`, one after the other."""
        numbers = self.numbers(sequence)
        for before, after, transition in zip(numbers, numbers[1:], sequence.transitions, strict=False):
            limb, timing = transition.limb, transition.timing
            yield Reason.STILL if limb == last else self.code(before, limb, int(after[limb]), timing)
            last = limb

    def code(self, before: np.ndarray, limb: Limb, number: int, timing: Timing) -> int:
        """The `Reason` against moving a limb to a contact, out of a stance of contact numbers (4,); 0: none."""
        if not limb.is_foot and limb not in self._palms and number >= 0:
            return Reason.NO_WALL
        key = (*before[: len(FEET)].tolist(), int(before[limb]), int(limb), number, timing.swing)
        if key not in self._known:
            if len(self._known) >= _KEPT:
                self._known.clear()
            code = self._foot if limb.is_foot else self._palm
            self._known[key] = code(before, limb, number, timing)
        return self._known[key]

    def _foot(self, before: np.ndarray, limb: Limb, number: int, timing: Timing) -> int:
        moves, row = self._moves, np.array([number])
        table, standing = moves.table, int(before[limb.mirrored])
        place = table.position[row], table.rotation[row], table.yaw[row]
        code = int(moves.screen(limb, table.surface[row], *place, standing)[0])
        return code or int(moves.swings(limb, row, int(before[limb]), standing, self._speed * timing.swing)[0])

    def _palm(self, before: np.ndarray, limb: Limb, number: int, timing: Timing) -> int:
        if number < 0:
            return Reason.NONE if before[limb] >= 0 else Reason.STILL
        if number == before[limb]:
            return Reason.STILL
        moves, (left, right) = self._moves, before[: len(FEET)].tolist()
        place = moves.table.position[number]
        ray = place - moves.shoulder(limb, left, right)
        palms, codes = moves.aimed(limb, left, right, ray[None] / np.linalg.norm(ray))
        if codes[0] == 0 and np.linalg.norm(palms.position[0] - place) > self._at:
            return Reason.NO_WALL
        return int(codes[0])

    def reach_codes(self, plan: MotionPlan) -> np.ndarray:
        """(transitions,) int; the `Reason` why limbs do not reach in the motion of a plan, 0 where they do."""
        sequence, numbers = plan.sequence, self.numbers(plan.sequence)
        samples = [plan.motion.sample(time) for time in plan.schedule.stance_times]
        codes = []
        for index, transition in enumerate(sequence.transitions):
            (com, velocity, _), (end, end_velocity, _) = samples[index : index + 2]
            step = Candidates.of(
                self._moves.table,
                numbers[index : index + 1],
                np.array([transition.limb]),
                numbers[index + 1 : index + 2],
                np.zeros(1, int),
            )
            reach = ReachCheck(self._moves, self._palms, (transition.timing,))
            codes.append(reach.codes(numbers[index], com, velocity, step, end[None], end_velocity[None])[0])
        return np.array(codes, int)

    def steps(self, before: np.ndarray, limb: Limb, timing: Timing) -> np.ndarray:
        """(n,) contact numbers of the steps of a foot that the search would consider from a stance of numbers (4,)."""
        standing, old = int(before[limb.mirrored]), int(before[limb])
        key = (standing, old, limb, timing.swing)
        if key not in self._steps:
            if len(self._steps) >= _KEPT:
                self._steps.clear()
            found = self._moves.steps(limb, standing).numbers
            codes = self._moves.swings(limb, found, old, standing, self._speed * timing.swing)
            self._steps[key] = found[codes == 0]
        return self._steps[key]
