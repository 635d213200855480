"""Candidate transitions out of one state: all that pass the screens, before their dynamics are judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.geometry.heading import mean_heading
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.search.moves.exclusion import Exclusion, excluded
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reasons import Reason
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.timing import Timing

SWING_SPEED = 4.0
"""Highest mean speed of a foot in m/s, for a body of the usual size (`toolkit.robot.scale`)."""


@dataclass(frozen=True)
class Candidates:
    """Transitions out of one state.

    Attributes:
        limb: (n,) int; the limb that moves.
        number: (n,) int; new contact, -1 where a palm breaks.
        contacts: (n, 4) int; contact numbers afterwards.
        centre: (n, 3) m; mean of the feet afterwards.
        yaw: (n,) rad; heading of the mean of the feet afterwards.
        way: (n,) m; distance that the mean of the feet moves in XY.
        course: (n,) rad; direction in which it moves.
        timing: (n,) int; index of the timing.
    """

    limb: np.ndarray
    number: np.ndarray
    contacts: np.ndarray
    centre: np.ndarray
    yaw: np.ndarray
    way: np.ndarray
    course: np.ndarray
    timing: np.ndarray

    @classmethod
    def of(
        cls, table: ContactTable, before: np.ndarray, limb: np.ndarray, after: np.ndarray, timing: np.ndarray
    ) -> Candidates:
        """Transitions of limbs (n,) from contact numbers (n, 4) to (n, 4), with timings (n,) by index."""
        centre, yaw = mean_feet(table, after)
        x, y = (centre - mean_feet(table, before)[0])[:, :2].T
        return cls(
            limb, after[np.arange(len(limb)), limb], after, centre, yaw, np.hypot(x, y), np.arctan2(y, x), timing
        )

    def __len__(self) -> int:
        return len(self.limb)

    def select(self, rows: np.ndarray) -> Candidates:
        """Some of them, by index or mask; an index may repeat."""
        return Candidates(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def mean_feet(table: ContactTable, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the feet (n, 3) m and its heading (n,) rad of contact numbers (n, 4)."""
    left, right = contacts[:, 0], contacts[:, 1]
    return (table.position[left] + table.position[right]) / 2, mean_heading(table.yaw[left], table.yaw[right])


class CandidateGenerator:
    """Makes the candidates of one search.

    Args:
        moves: Screened moves of single limbs.
        palms: The palms that may be used. Others that are in contact have to be broken first.
        timings: The timings to choose from.
        exclusions: Transitions that later stages rejected.
        rejected: (len(Reason),) int; counts rejected candidates by reason.
    """

    def __init__(
        self,
        moves: MoveGenerator,
        palms: Sequence[Limb],
        timings: tuple[Timing, ...],
        exclusions: Sequence[Exclusion],
        rejected: np.ndarray,
    ):
        self._moves, self._table, self._palms = moves, moves.table, palms
        self._exclusions, self._rejected = exclusions, rejected
        self._ways = moves.robot.scale.speed * SWING_SPEED * np.array([timing.swing for timing in timings])

    def out_of(self, contacts: np.ndarray, last: int) -> Candidates | None:
        """Candidates out of contact numbers (4,) whose limb `last` moved last; None where there are none."""
        limbs: list[np.ndarray] = []
        numbers: list[np.ndarray] = []
        held = [palm for palm in PALMS if contacts[palm] >= 0 and palm not in self._palms]
        for palm in held:  # in contact at the start, and not to be used
            limbs.append(np.array([int(palm)]))
            numbers.append(np.array([-1]))
        for foot in FEET:
            if foot == last or held:
                continue
            old, standing = int(contacts[foot]), int(contacts[foot.mirrored])
            moves = self._moves.steps(foot, standing)
            self._rejected += moves.rejected
            if len(moves.numbers):
                codes = self._moves.swings(foot, moves.numbers, old, standing, self._ways.max())
                self._rejected += np.bincount(codes, minlength=len(Reason))
                limbs.append(np.full(int((codes == 0).sum()), foot))
                numbers.append(moves.numbers[codes == 0])
        for palm in self._palms:
            if palm == last or held:
                continue
            moves = self._moves.palms(palm, int(contacts[0]), int(contacts[1]))
            self._rejected += moves.rejected
            places = moves.numbers[moves.numbers != contacts[palm]]
            if contacts[palm] >= 0:
                places = np.append(places, -1)
            limbs.append(np.full(len(places), palm))
            numbers.append(places)
        self._rejected[0] = 0
        limb = np.concatenate(limbs) if limbs else np.zeros(0, int)
        n = len(limb)
        if n == 0:
            return None
        number = np.concatenate(numbers)
        after = np.repeat(contacts[None], n, axis=0)
        after[np.arange(n), limb] = number
        if self._exclusions:
            position = np.vstack([self._table.position, np.full(3, np.nan)])  # number -1: no contact
            allowed = ~excluded(self._exclusions, position[contacts], limb, position[number])
            self._rejected[Reason.EXCLUDED] += n - int(allowed.sum())
            limb, number, after, n = limb[allowed], number[allowed], after[allowed], int(allowed.sum())
            if n == 0:
                return None
        return Candidates.of(self._table, contacts[None], limb, after, np.zeros(n, int))

    def timed(self, contacts: np.ndarray, candidates: Candidates) -> Candidates:
        """Each candidate out of contact numbers (4,) once for every timing that its swing allows."""
        if len(self._ways) == 1:  # the screen of the swings has checked the speed
            return candidates
        table, old = self._table, contacts[candidates.limb]
        way = np.hypot(*(table.position[candidates.number] - table.position[old])[:, :2].T)
        way[(candidates.limb > Limb.RIGHT_FOOT) | (candidates.number < 0)] = 0.0
        rows, timing = np.nonzero(way[:, None] <= self._ways)
        return replace(candidates.select(rows), timing=timing)
