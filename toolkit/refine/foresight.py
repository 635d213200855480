"""A cheap guess of what a variant costs, to optimise the promising ones first. It decides nothing else.

Most of the objective is the integral of the squared momentum of the CoM, which travels from foot to foot. Straight
lines between the places where it has to be in the middle of each swing give sum |way|^2 / time, and the objective of a
sequence that is already optimised gives the scale.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from toolkit.contacts.sequence import Change, ContactSequence
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.scale import USUAL, Scale
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.costs.plan_cost import PlanCost, known_costs
from toolkit.world.world import Goal

_AROUND = 1  # transitions beside those that differ; the CoM is where they have it in both variants
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
        self._sequence, self._cost = sequence, cost.total
        self._config, self._goal, self._scale = config, goal, scale
        # Known cost, place of the CoM, shift and swing of each transition that was met. Variants share most of them.
        self._met: dict[tuple[bytes, bytes, bool, bytes], np.ndarray] = {}
        self._parts: dict[tuple[int, int], float] = {}  # what parts of the sequence are worth
        _, way = self._known_and_travel(sequence)
        self._per_travel = cost.dynamics / max(way, 1e-9)

    def __call__(self, variant: ContactSequence) -> float:
        """The guess for a variant."""
        change = Change.between(self._sequence, variant, _AROUND)
        part = change.first, len(change.old.transitions)
        if part not in self._parts:
            self._parts[part] = self._worth(change.old)
        return self._cost + self._worth(change.new) - self._parts[part]

    def _worth(self, part: ContactSequence) -> float:
        """What a part of a sequence costs, but for what is equal in all variants."""
        known, way = self._known_and_travel(part)
        return known + self._per_travel * way

    def _known_and_travel(self, sequence: ContactSequence) -> tuple[float, float]:
        """The cost that is known without the motion, and `travel`."""
        contacts = {contact.limb: contact for contact in sequence.start.contacts}
        begin, keys, befores = _middle(contacts), [], []
        for transition in sequence.transitions:
            befores.append(contacts.copy())
            feet = (contacts[foot].identity for foot in FEET)
            keys.append((*feet, len(contacts) > len(FEET), transition.identity))
            if transition.contact is None:
                contacts.pop(transition.limb, None)
            else:
                contacts[transition.limb] = transition.contact
        new = [index for index, key in enumerate(keys) if key not in self._met]
        if new:
            before, span = befores[new[0]], slice(new[0], new[-1] + 1)
            stance = Stance(tuple(before[limb] for limb in sorted(before)))
            rows = self._rows(ContactSequence(stance, sequence.transitions[span]))
            self._met.update(zip(keys[span], rows, strict=True))
        rows = np.array([self._met[key] for key in keys]).reshape(-1, 6)
        way = _travelled(begin[None], rows[:, 1:4], _middle(contacts)[None], rows[:, 4:], self._scale.time)
        return float(rows[:, 0].sum()), float(way)

    def _rows(self, sequence: ContactSequence) -> np.ndarray:
        """(n, 6) known cost, place of the CoM, shift and swing of the transitions of a sequence."""
        walk, known = Walk.of(sequence), known_costs(sequence, self._goal, self._config, self._scale)
        return np.column_stack([known, walk.swings, walk.times])


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

    def part(self, first: int, end: int) -> Walk:
        """The walk of transitions [first, end)."""
        own = slice(first, end)
        return Walk(self.feet[..., first : end + 1, :, :], self.standing[..., own], self.over[own], self.times[own])

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

    @property
    def swings(self) -> np.ndarray:
        """(..., n, 3) m; places of the CoM in the middle of each swing."""
        middle = self.feet.mean(-2)
        swings = (middle[..., :-1, :] + middle[..., 1:, :]) / 2
        foot = np.maximum(self.standing, 0)[..., None, None]
        stands = np.take_along_axis(self.feet[..., :-1, :, :], foot, axis=-2)[..., 0, :]
        return swings + np.where(self.standing >= 0, self.over, 0.0)[..., None] * (stands - swings)

    def travel(self, pace: float) -> np.ndarray:
        """(...); see `travel`."""
        begin, end = (self.feet[..., where, :, :].mean(-2) for where in (slice(1), slice(-1, None)))
        return _travelled(begin, self.swings, end, self.times, pace)


def _travelled(begin: np.ndarray, swings: np.ndarray, end: np.ndarray, times: np.ndarray, pace: float) -> np.ndarray:
    """(...) sum of |way|^2 / time from (..., 1, 3) through the swings' (..., n, 3) to (..., 1, 3) in times (n, 2)."""
    rest, begins = pace * _REST, np.concatenate([[0.0], np.cumsum(times.sum(1))])
    at = np.concatenate([[-rest], begins[:-1] + times[:, 0] + times[:, 1] / 2, begins[-1:] + rest])
    places = np.concatenate([begin, swings, end], axis=-2)
    return ((np.diff(places, axis=-2) ** 2).sum(-1) / np.diff(at)).sum(-1)


def _middle(contacts: Mapping[Limb, Contact]) -> np.ndarray:
    """(3,) m; mean of the feet."""
    left, right = (contacts[foot].pose.position for foot in FEET)
    return (left + right) / 2
