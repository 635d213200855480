"""A cheap guess of what a variant costs, to optimise the promising ones first. It decides nothing else.

Most of the objective is the integral of the squared momentum of the CoM, which travels from foot to foot. Straight
lines between the places where it has to be in the middle of each swing give sum |way|^2 / time, and the objective of a
sequence that is already optimised gives the scale.
"""

from __future__ import annotations

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import Limb
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.costs.plan_cost import PlanCost, known_cost
from toolkit.world.world import Goal

_OVER = 0.7  # part of the way from the middle of the feet to the standing one, in the middle of a swing
_HELD = 0.4  # the same while a palm helps
_REST = 0.5  # s in which the CoM reaches the middle of the feet after the last swing, and leaves it before the first


class Foresight:
    """Guesses of the true cost of variants of one sequence.

    Args:
        sequence: A sequence whose motion is optimised.
        cost: Its true cost.
        config: Weights of the true cost.
        goal: The goal.
    """

    def __init__(self, sequence: ContactSequence, cost: PlanCost, config: CostConfig, goal: Goal):
        self._config, self._goal = config, goal
        self._scale = cost.dynamics / max(_travel(sequence), 1e-9)
        self._rests = cost.total - cost.dynamics - known_cost(sequence, goal, config)

    def __call__(self, sequence: ContactSequence) -> float:
        """The guess for a variant."""
        return known_cost(sequence, self._goal, self._config) + self._rests + self._scale * _travel(sequence)


def _travel(sequence: ContactSequence) -> float:
    """Sum of |way|^2 / time in m^2/s of straight lines between the places of the CoM in the middle of each swing."""
    stances = sequence.stances
    places, times, now = [stances[0].mean_feet.position], [-_REST], 0.0
    for index, transition in enumerate(sequence.transitions):
        timing = transition.timing
        times.append(now + timing.shift + timing.swing / 2)
        places.append(_over(stances[index], stances[index + 1], transition.limb))
        now += timing.shift + timing.swing
    places.append(stances[-1].mean_feet.position)
    times.append(now + _REST)
    way = np.diff(np.array(places), axis=0)
    return float(((way**2).sum(1) / np.diff(times)).sum())


def _over(before: Stance, after: Stance, limb: Limb) -> np.ndarray:
    """(3,) m; where the CoM is in the middle of a swing, seen from above, at the height of the feet."""
    middle = (before.mean_feet.position + after.mean_feet.position) / 2
    if not limb.is_foot:
        return middle
    standing = before[limb.mirrored].pose.position
    return middle + (_HELD if before.palms else _OVER) * (standing - middle)
