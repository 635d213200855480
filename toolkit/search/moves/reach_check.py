"""What legs and arms reach in a transition, once the CoM before and after it is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.arm_map import ArmMap
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.robot.model import RobotModel
from toolkit.search.moves.candidates import Candidates, mean_feet
from toolkit.search.moves.legs import Legs, stances_violated
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.shanks import Shanks
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.timing import Timing


@dataclass(frozen=True)
class ReachConfig:
    """Settings of the check.

    Attributes:
        com_drops: m; the predicted CoM may be lower by any of these for the legs to reach.
        lift_off: parts of the shift time at whose CoM the legs may reach at lift-off, since when the CoM moves is the
            optimiser's choice.
        arm_margin: m; an arm in contact reaches so much less far than it could, since the CoM moves in between.
        arm_sway: m; how far the CoM may stay short of being over the foot that stands while the other one swings, for
            the sake of an arm in contact.
    """

    com_drops: tuple[float, ...] = (0.0, 0.03, 0.06, 0.1)
    lift_off: tuple[float, ...] = (1.0, 0.5)
    arm_margin: float = 0.05
    arm_sway: float = 0.05


class ReachCheck:
    """Checks the candidates of one search.

    Args:
        robot: the robot.
        legs: its legs with the margins of the search.
        shanks: capsules inside them.
        arms: where each arm can hold its palm.
        table: contacts.
        palms: in use.
        timings: to choose from.
        config: settings.
    """

    def __init__(
        self,
        robot: RobotModel,
        legs: Legs,
        shanks: Shanks,
        arms: Mapping[Limb, ArmMap],
        table: ContactTable,
        palms: Sequence[Limb],
        timings: tuple[Timing, ...],
        config: ReachConfig,
    ):
        self._robot, self._legs, self._shanks, self._table = robot, legs, shanks, table
        self._palms, self._config, self._arms = palms, config, arms
        self._drops = np.array(config.com_drops)
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

        Args:
            contacts: (4,) int; numbers before.
            com: (3,) m; before.
            velocity: (3,) m/s.
            candidates: n of them.
            end: (n, 3) m; CoM afterwards.
            end_velocity: (n, 3) m/s.
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
        for lag in self._config.lift_off:
            if len(rows):
                part, time = lag * shift[rows] / total[rows], total[rows]
                lift = _cubic(com, velocity, end[rows], end_velocity[rows], part, time)
                broken[rows] = self._violated(lift, yaw[rows], left[rows], right[rows])
                rows = rows[broken[rows] > 0]
        codes = np.where(broken > 0, broken, codes)
        for palm in self._palms:
            held = np.flatnonzero(after[:, palm] >= 0)
            if len(held):
                arm = self._robot.arms[palm]
                turn = rotation_about_z(candidates.yaw[held])
                shoulder = end[held] + turn @ arm.shoulder_in_com
                reach, normal = table.position[after[held, palm]] - shoulder, table.rotation[after[held, palm], :, 2]
                local = [np.einsum("nij,ni->nj", turn, vectors) for vectors in (reach, normal)]
                distance, margin = np.linalg.norm(reach, axis=1), self._config.arm_margin
                within = (distance > arm.min_reach + margin / 2) & (distance < arm.max_reach - margin)
                limb = candidates.limb[held]
                standing = after[held, np.where(limb == Limb.LEFT_FOOT, Limb.RIGHT_FOOT, Limb.LEFT_FOOT)]
                aside = table.position[standing] - end[held]  # to where the CoM goes while the other foot swings
                aside[:, 2] = 0.0
                stretched = np.linalg.norm(reach - aside, axis=1) > arm.max_reach + self._config.arm_sway
                within &= ~(stretched & (limb < len(FEET)))
                codes[held[~(within & self._arms[palm].serves(*local))]] = Reason.ARM
        return codes

    def _violated(self, com: np.ndarray, yaw: np.ndarray, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        table = self._table
        return stances_violated(
            self._legs,
            self._shanks,
            com,
            self._drops,
            yaw,
            table.position[left],
            table.rotation[left],
            table.position[right],
            table.rotation[right],
        )


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
