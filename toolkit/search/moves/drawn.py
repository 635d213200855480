"""Landing places drawn from the ground itself, where the table of steps leads no farther.

A table has gaps between its rows: none of its steps may reach the far side of a gap, a small stone, or the next place
on a narrow beam. There the places that the legs reach are taken from the surfaces (`contacts.footholds`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toolkit.contacts.footholds import Footholds
from toolkit.contacts.projected import Projected
from toolkit.contacts.surface_table import SurfaceTable
from toolkit.contacts.transition_model import soles_apart
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.robot.model import RobotModel
from toolkit.search.moves.legs import any_lean, legs_of, stances_violated
from toolkit.search.moves.limits import SHIFTS, drops, margins
from toolkit.search.moves.shanks import shanks_of

_ADVANCE = 0.1  # m for a leg of 0.8 m; landing places of the table that lead farther are enough
_ALONG = np.array([-0.25, 0.0, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85])  # m for a leg of 0.8 m; places wanted ahead
_ACROSS = np.array([0.0, 0.1, 0.2, 0.3])  # m for a leg of 0.8 m; and to the side of the foot
_NEAREST = 40  # surfaces that are looked at
_SAME = 0.02  # m for a leg of 0.8 m; places that differ by less are one


class DrawnSteps:
    """Landing places beside a standing foot, drawn from the surfaces in reach.

    Args:
        robot: The robot.
        table: Surfaces.
        footholds: Places for soles on the same surfaces.
        distance: Distance in m to the goal from places (n, 3) m with headings (n,) rad; it says how far steps lead.
        longest: Longest step in m.
    """

    def __init__(
        self,
        robot: RobotModel,
        table: SurfaceTable,
        footholds: Footholds,
        distance: Callable[[np.ndarray, np.ndarray], np.ndarray],
        longest: float,
    ):
        scale = robot.scale.length
        self._table, self._footholds, self._distance, self._longest = table, footholds, distance, longest
        self._advance, self._same = scale * _ADVANCE, scale * _SAME
        across = np.append(scale * _ACROSS, soles_apart(robot))
        self._wishes = np.stack(np.meshgrid(scale * _ALONG, across, indexing="ij"), axis=-1).reshape(-1, 2)

    def wanted(self, stand: np.ndarray, yaw: float, places: np.ndarray, yaws: np.ndarray) -> bool:
        """Whether none of the places (n, 3) m with headings (n,) rad leads farther than the foot that stands."""
        here = float(self._distance(stand[None], np.array([yaw]))[0])
        if here < self._advance:
            return False
        return not len(places) or float(self._distance(places, yaws).min()) > here - self._advance

    def beside(self, limb: Limb, stand: np.ndarray, yaw: float) -> tuple[Projected, np.ndarray]:
        """Places for a foot beside one that stands at (3,) m with heading `yaw` in rad, and their headings (n,) rad."""
        table, turn = self._table, rotation_about_z(yaw)[:2, :2]
        wishes = self._wishes * [1.0, limb.outward] @ turn.T + stand[:2]
        away = np.hypot(*(table.centre - stand)[:, :2].T) - table.radius
        near = np.flatnonzero(table.foot & (away < self._longest))
        nearest = near[np.argsort(away[near], kind="stable")][:_NEAREST].tolist()
        places = [(index, heading) for index in nearest for heading in self._footholds.headings(index, yaw)]
        soles, which = self._footholds.nearest(places, wishes), np.repeat(np.arange(len(places)), len(wishes))
        found = np.flatnonzero(soles.found)
        kept = found[_firsts(np.column_stack([which[found], np.round(soles.position[found] / self._same)]))]
        kept = kept[np.hypot(*(soles.position[kept] - stand)[:, :2].T) < self._longest]
        return soles.select(kept), np.array([heading for _, heading in places])[which[kept]]


def _firsts(rows: np.ndarray) -> np.ndarray:
    """Indices, ascending, of the first of all rows (n, k) that are the same."""
    order = np.lexsort(rows.T)
    new = np.ones(len(rows), bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    return np.sort(order[new])


def longest_step(robot: RobotModel) -> float:
    """The longest step in m that the legs reach on level ground, with the CoM as low as a search lets it be.

    The CoM may be anywhere between the feet where the screens look for it.
    """
    leg = robot.legs[Limb.LEFT_FOOT]
    along = np.arange(0.1, 2.0, 0.01) * (leg.thigh + leg.shin)
    beside = abs(robot.legs[Limb.LEFT_FOOT].hip_in_com[1] - robot.legs[Limb.RIGHT_FOOT].hip_in_com[1])
    left = np.column_stack([along, np.full(len(along), beside), np.zeros(len(along))])
    right, turn = np.zeros_like(left), np.tile(np.eye(3), (len(along), 1, 1))
    legs, shanks = legs_of(robot, margins(robot)), shanks_of(robot)
    soles, heading, leans = (left, turn, right, turn), np.zeros(len(along)), any_lean(len(along))
    reached = np.zeros(len(along), bool)
    for shift in SHIFTS:
        com = (0.5 + shift) * left + [0.0, 0.0, robot.com_height]
        reached |= stances_violated(legs, shanks, com, drops(robot), heading, *soles, leans) == 0
    return float(along[reached].max(initial=0.0))
