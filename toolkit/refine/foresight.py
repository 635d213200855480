"""A cheap guess of what a variant costs, to optimise the promising ones first. It decides nothing else.

Most of the objective is the integral of the squared momentum of the CoM, which travels from foot to foot. Straight
lines between the places where it has to be in the middle of each swing give sum |way|^2 / time, and the objective of a
sequence that is already optimised gives the scale.
"""

from __future__ import annotations

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from toolkit.robot.scale import USUAL, Scale
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.costs.plan_cost import PlanCost, known_cost
from toolkit.world.world import Goal

_OVER = 0.7  # part of the way from the middle of the feet to the standing one, in the middle of a swing
_HELD = 0.4  # the same while a palm helps
# s in which the CoM of a body of the usual size (`toolkit.robot.scale`) reaches the middle of the feet after the last
# swing, and leaves it before the first
_REST = 0.5


class Foresight:
    """Guesses of the true cost of variants of one sequence.

    Args:
        sequence: A sequence whose motion is optimised.
        cost: Its true cost.
        config: Weights of the true cost.
        goal: The goal.
        scale: The robot's size.
    """

    def __init__(self, sequence: ContactSequence, cost: PlanCost, config: CostConfig, goal: Goal, scale: Scale = USUAL):
        self._config, self._goal, self._scale = config, goal, scale
        self._per_travel = cost.dynamics / max(travel(sequence, scale.time), 1e-9)
        self._rests = cost.total - cost.dynamics - known_cost(sequence, goal, config, scale)

    def __call__(self, sequence: ContactSequence) -> float:
        """The guess for a variant."""
        known, way = known_cost(sequence, self._goal, self._config, self._scale), travel(sequence, self._scale.time)
        return known + self._rests + self._per_travel * way


def travel(sequence: ContactSequence, pace: float = 1.0) -> float:
    """Sum of |way|^2 / time in m^2/s of straight lines between the places of the CoM in the middle of each swing.

    `pace` is the factor on the robot's times.
    """
    n, rest = len(sequence.transitions), pace * _REST
    feet = np.array([[contact.pose.position for contact in sequence.start.feet]] * (n + 1))
    standing, times, now, held = np.full(n, -1), np.empty(n + 2), 0.0, set(sequence.start.palms)
    over = np.full(n, _HELD)
    times[0] = -rest
    for index, transition in enumerate(sequence.transitions):
        if not held:
            over[index] = _OVER
        if transition.contact is None:
            held.discard(transition.limb)
        elif transition.limb.is_foot:
            feet[index + 1 :, transition.limb] = transition.contact.pose.position
            standing[index] = transition.limb.mirrored
        else:
            held.add(transition.limb)
        times[index + 1] = now + transition.timing.shift + transition.timing.swing / 2
        now += transition.timing.shift + transition.timing.swing
    times[-1] = now + rest
    middle = feet.mean(1)
    places = np.empty((n + 2, 3))
    places[0], places[-1], places[1:-1] = middle[0], middle[-1], (middle[:-1] + middle[1:]) / 2
    steps = np.flatnonzero(standing >= 0)
    places[1 + steps] += over[steps, None] * (feet[steps, standing[steps]] - places[1 + steps])
    return float(((np.diff(places, axis=0) ** 2).sum(1) / np.diff(times)).sum())
