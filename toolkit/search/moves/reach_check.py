"""Check of what legs and arms reach in a transition whose CoM before and after it is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.search.moves.candidates import Candidates, mean_feet
from toolkit.search.moves.legs import any_lean, legs_of, stances_violated
from toolkit.search.moves.limits import margins
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reasons import Reason
from toolkit.world.timing import Timing

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_COM_DROPS = np.array([0.0, 0.03, 0.06, 0.1])  # m by which the CoM may be lower than predicted for the legs to reach
_LIFT_OFF = (1.0, 0.5)  # parts of the shift at whose CoM the legs may reach at lift-off; the optimiser chooses the time
_ARM_MARGIN = 0.05  # m that an arm in contact reaches less far than it could, since the CoM moves in between
_ARM_SWAY = 0.05  # m that the CoM may stay short of the standing foot during a swing, for an arm in contact


class ReachCheck:
    """Checks the candidates of one search, with its moves, the palms in use and the timings to choose from.

    The margins of the legs have grown `care` times.
    """

    def __init__(self, moves: MoveGenerator, palms: Sequence[Limb], timings: tuple[Timing, ...], care: int = 0):
        self._moves, self._table, self._palms = moves, moves.table, palms
        self._legs = legs_of(moves.robot, margins(moves.robot, care))
        scale = moves.robot.scale.length
        self._drops, self._margin, self._sway = scale * _COM_DROPS, scale * _ARM_MARGIN, scale * _ARM_SWAY
        self._shift = np.array([item.shift for item in timings])
        self._total = self._shift + np.array([item.swing for item in timings])

    def codes(
        self,
        contacts: np.ndarray,
        com: np.ndarray,
        velocity: np.ndarray,
        candidates: Candidates,
        end: np.ndarray,
        end_velocity: np.ndarray,
    ) -> np.ndarray:
        """Codes (n,) of candidates by what legs and arms reach with the CoM at lift-off and after touch-down.

        The candidates lead out of contact numbers (4,) with the CoM (3,) m and its velocity (3,) m/s, and end with
        CoMs (n, 3) m and velocities (n, 3) m/s.
        """
        table, after = self._table, candidates.contacts
        n = len(candidates)
        # Touch-down: the new stance under the predicted CoM.
        codes = self._violated(end, candidates.yaw, after[:, 0], after[:, 1])
        # Lift-off: the old stance under the CoM at the end of the shift, on the cubic between the known ends.
        shift, total = self._shift[candidates.timing], self._total[candidates.timing]
        yaw = np.full(n, mean_feet(table, contacts[None])[1][0])
        left, right = np.full(n, contacts[0]), np.full(n, contacts[1])
        broken, rows = np.zeros(n, int), np.arange(n)
        for lag in _LIFT_OFF:
            if len(rows):
                part, time = lag * shift[rows] / total[rows], total[rows]
                lift = _cubic(com, velocity, end[rows], end_velocity[rows], part, time)
                broken[rows] = self._violated(lift, yaw[rows], left[rows], right[rows])
                rows = rows[broken[rows] > 0]
        codes = np.where(broken > 0, broken, codes)
        for palm in self._palms:
            held = np.flatnonzero(after[:, palm] >= 0)
            if len(held):
                arm = self._moves.robot.arms[palm]
                turn = rotation_about_z(candidates.yaw[held])
                shoulder = end[held] + turn @ arm.shoulder_in_com
                reach, normal = table.position[after[held, palm]] - shoulder, table.rotation[after[held, palm], :, 2]
                local = [np.einsum("nij,ni->nj", turn, vectors) for vectors in (reach, normal)]
                distance = np.linalg.norm(reach, axis=1)
                within = (distance > arm.min_reach + self._margin / 2) & (distance < arm.max_reach - self._margin)
                limb = candidates.limb[held]
                standing = after[held, np.where(limb == Limb.LEFT_FOOT, Limb.RIGHT_FOOT, Limb.LEFT_FOOT)]
                aside = table.position[standing] - end[held]  # to where the CoM goes while the other foot swings
                aside[:, 2] = 0.0
                stretched = np.linalg.norm(reach - aside, axis=1) > arm.max_reach + self._sway
                within &= ~(stretched & (limb < len(FEET)))
                codes[held[~(within & self._moves.arms[palm].serves(*local))]] = Reason.ARM
        return codes

    def _violated(self, com: np.ndarray, yaw: np.ndarray, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        moves, table = self._moves, self._table

        def codes(rows: np.ndarray, leans: np.ndarray) -> np.ndarray:
            a, b = left[rows], right[rows]
            soles = table.position[a], table.rotation[a], table.position[b], table.rotation[b]
            return stances_violated(self._legs, moves.shanks, com[rows], self._drops, yaw[rows], *soles, leans)

        found = codes(np.arange(len(com)), any_lean(len(com)))
        passed = np.flatnonzero(found == 0)  # few do, and few of those stand before something
        leans = np.column_stack([moves.leans(left[passed]), moves.leans(right[passed])])
        near = np.isfinite(leans).any(1)
        found[passed[near]] = codes(passed[near], leans[near])
        return found


def _cubic(
    start: np.ndarray, velocity: np.ndarray, end: np.ndarray, end_velocity: np.ndarray, s: np.ndarray, time: np.ndarray
) -> np.ndarray:
    """Points (n, 3) at the part s (n,) of Hermite cubics of duration `time` (n,) between positions and velocities."""
    s, time = s[:, None], time[:, None]
    rise = s * s * (3.0 - 2.0 * s)
    return (
        start * (1.0 - rise)
        + end * rise
        + velocity * time * s * (1.0 - s) ** 2
        - end_velocity * time * s * s * (1.0 - s)
    )
