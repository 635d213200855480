"""FootChains: steps that lead from one pair of foot contacts to another, through contacts that a search would try."""

from __future__ import annotations

import numpy as np

from toolkit.geometry.heading import wrapped
from toolkit.geometry.limb import FEET, Limb
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.world.timing import Timing

_BEAM = 4  # most places that are tried for a new contact in between
# m of distance that 1 rad of turning counts as for a body of the usual size (`toolkit.robot.scale`), to compare places
_TURN = 0.1


class FootChains:
    """Chains of steps out of the moves of one search. They are remembered, as variants of a sequence ask for the same.

    Args:
        screen: The screens of the search.

    Attributes:
        screen: The same.
    """

    def __init__(self, screen: SequenceScreen):
        self.screen = screen
        self._made: dict[tuple, list[np.ndarray]] = {}

    def between(self, start: np.ndarray, end: np.ndarray, limbs: tuple[Limb, ...], timing: Timing) -> list[np.ndarray]:
        """Chains of steps of some feet in turn, near the straight way of each foot.

        Args:
            start: (4,) int; contact numbers of the stance before them.
            end: (4,) int; of the one after them. Its palms do not count.
            limbs: The feet.
            timing: The timing of the steps.

        Returns:
            (steps + 1, 4) contact numbers each; none where a single step does not leave the other foot where it is.
        """
        key = start.tobytes(), end[: len(FEET)].tobytes(), limbs, timing
        if key not in self._made:
            self._made[key] = self._chains(start, end, limbs, timing)
        return self._made[key]

    def _chains(self, start: np.ndarray, end: np.ndarray, limbs: tuple[Limb, ...], timing: Timing) -> list[np.ndarray]:
        """See `between`."""
        position = self.screen.table.position
        if len(limbs) == 1:
            other = limbs[0].mirrored
            if (position[start[other]] != position[end[other]]).any():
                return []
        ends = limbs[max(len(limbs) - 2, 0) :]
        beam = [start[None]]
        for index, limb in enumerate(limbs[: -len(ends)]):
            share = limbs[: index + 1].count(limb) / limbs.count(limb)
            beam = [
                _moved(rows, limb, number)
                for rows in beam
                for number in self._nearest(rows[-1], limb, timing, int(start[limb]), int(end[limb]), share)
            ]
        for limb in ends:
            beam = [_moved(rows, limb, int(end[limb])) for rows in beam]
        return beam

    def _nearest(self, row: np.ndarray, limb: Limb, timing: Timing, first: int, last: int, share: float) -> list[int]:
        """The steps out of a stance that are nearest to a share of the straight way between two contacts."""
        table, steps = self.screen.table, self.screen.steps(row, limb, timing)
        place = table.position[first] + share * (table.position[last] - table.position[first])
        yaw = table.yaw[first] + share * wrapped(table.yaw[last] - table.yaw[first])
        away = np.linalg.norm(table.position[steps] - place, axis=1)
        turn = self.screen.scale.length * _TURN * np.abs(wrapped(table.yaw[steps] - yaw))
        return steps[np.argsort(away + turn, kind="stable")[:_BEAM]].tolist()


def _moved(rows: np.ndarray, limb: Limb, number: int) -> np.ndarray:
    """Stances (k, 4) and the one after a limb has moved, as contact numbers (k + 1, 4)."""
    longer = np.concatenate([rows, rows[-1:]])
    longer[-1, limb] = number
    return longer
