"""A cheap guess of what a variant costs, to optimise the promising ones first. It decides nothing else.

Most of the objective is the integral of the squared momentum of the CoM, which travels from foot to foot. Straight
lines between the places where it has to be in the middle of each swing give sum |way|^2 / time, and the objective of a
sequence that is already optimised gives the scale.
"""

from __future__ import annotations

from typing import NamedTuple

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
    return float(Walk.of(sequence).travel(pace))


class Walk(NamedTuple):
    """Where the feet stand in a sequence of n transitions, or in several that differ in places and feet only.

    Attributes:
        feet: (..., n + 1, 2, 3) m; their places in each stance.
        standing: (..., n) int; the foot that stands while the other one swings, -1 while a palm moves.
        over: (n,); part of the way from the middle of the feet to the standing one, in the middle of a swing.
        times: (n, 2) s; shift and swing.
    """

    feet: np.ndarray
    standing: np.ndarray
    over: np.ndarray
    times: np.ndarray

    @classmethod
    def of(cls, sequence: ContactSequence) -> Walk:
        """The walk of one sequence."""
        n, held = len(sequence.transitions), set(sequence.start.palms)
        feet = np.array([[contact.pose.position for contact in sequence.start.feet]] * (n + 1))
        standing, over, times = np.full(n, -1), np.full(n, _HELD), np.empty((n, 2))
        for index, transition in enumerate(sequence.transitions):
            times[index] = transition.timing.shift, transition.timing.swing
            if not held:
                over[index] = _OVER
            if transition.contact is None:
                held.discard(transition.limb)
            elif transition.limb.is_foot:
                feet[index + 1 :, transition.limb] = transition.contact.pose.position
                standing[index] = transition.limb.mirrored
            else:
                held.add(transition.limb)
        return cls(feet, standing, over, times)

    def linked(self, first: int, last: int, feet: np.ndarray, standing: np.ndarray) -> Walk:
        """Walks, m of them, in which k steps stand for those from one stance to a later one.

        Args:
            first: Number of the stance; only feet move from there on
            last: to this one.
            feet: (m, k - 1, 2, 3) m; places of the feet in the stances in between.
            standing: (m, k) int; the feet that stand.
        """
        many, steps = standing.shape
        ends = [np.broadcast_to(part, (many, *part.shape)) for part in (self.feet[: first + 1], self.feet[last:])]
        limbs = [np.broadcast_to(part, (many, *part.shape)) for part in (self.standing[:first], self.standing[last:])]
        return Walk(
            np.concatenate([ends[0], feet, ends[1]], axis=1),
            np.concatenate([limbs[0], standing, limbs[1]], axis=1),
            np.concatenate([self.over[:first], np.repeat(self.over[first], steps), self.over[last:]]),
            np.concatenate([self.times[:first], np.repeat(self.times[first : first + 1], steps, 0), self.times[last:]]),
        )

    def travel(self, pace: float) -> np.ndarray:
        """(...); see `travel`."""
        rest, spans = pace * _REST, self.times.sum(1)
        begins = np.concatenate([[0.0], np.cumsum(spans)])
        times = np.concatenate([[-rest], begins[:-1] + self.times[:, 0] + self.times[:, 1] / 2, begins[-1:] + rest])
        middle = self.feet.mean(-2)
        swings = (middle[..., :-1, :] + middle[..., 1:, :]) / 2
        foot = np.maximum(self.standing, 0)[..., None, None]
        stands = np.take_along_axis(self.feet[..., :-1, :, :], foot, axis=-2)[..., 0, :]
        swings = swings + np.where(self.standing >= 0, self.over, 0.0)[..., None] * (stands - swings)
        places = np.concatenate([middle[..., :1, :], swings, middle[..., -1:, :]], axis=-2)
        return ((np.diff(places, axis=-2) ** 2).sum(-1) / np.diff(times)).sum(-1)
