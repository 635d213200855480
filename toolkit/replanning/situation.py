"""What a replan starts from: the measured situation, and which contacts hold in its steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.control.corrector import Cones
from toolkit.geometry.limb import Limb
from toolkit.replanning.nominal import Nominal


@dataclass(frozen=True)
class Situation:
    """Measured state at a replan, world frame, SI units.

    Attributes:
        time: s.
        com, velocity, spin: (3,); spin: angular momentum about the CoM per mass.
        standing: limbs in contact: the swing that made it (-1: none), (3,) position and (3, 3) rotation of the patch.
        fixed: swings under way whose landing point is kept -> (3,) m shift from the plan.
        moving: swings under way whose landing point may still move -> (3,) m shift of the limb by now.
        goal: swings -> (3,) m shift that was decided last.
        landing: swings under way -> s; when they end as decided last.
        earliest: swings under way -> s; when they may end at the earliest.
        com_shift: (3,) m; of the plan with the feet that bear it.
        displaced: whether feet stand or go elsewhere than planned, or come earlier.
        cones: what the controller allows.
    """

    time: float
    com: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    standing: dict[Limb, tuple[int, np.ndarray, np.ndarray]]
    fixed: dict[int, np.ndarray]
    moving: dict[int, np.ndarray]
    goal: dict[int, np.ndarray]
    landing: dict[int, float]
    earliest: dict[int, float]
    com_shift: np.ndarray
    displaced: bool
    cones: Cones


@dataclass(frozen=True)
class HorizonContacts:
    """Contacts in N steps of a horizon.

    Attributes:
        active: (N, 4) bool. position: (N, 4, 3) m as planned. rotation: (N, 4, 3, 3). friction: (N, 4).
        event: (N, 4) swing that makes or made the contact; -1 for those of the start.
        shift: (N, 4, 3) m; of the contacts that stand or whose landing point is kept, from the plan.
    """

    active: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    friction: np.ndarray
    event: np.ndarray
    shift: np.ndarray

    @classmethod
    def of(cls, nominal: Nominal, situation: Situation, first: int, times: np.ndarray, early: dict[int, float]):
        """The contacts of a situation.

        Args:
            nominal: the plan.
            situation: what is measured.
            first: step of the plan that the horizon begins in.
            times: (N + 1,) s; knots of the horizon.
            early: swings -> s; when they end, where that is before their planned end.
        """
        steps, middle = len(times) - 1, (times[:-1] + times[1:]) / 2
        span = slice(first, first + steps)
        active, position = nominal.active[span].copy(), nominal.position[span].copy()
        rotation, friction = nominal.rotation[span].copy(), nominal.friction[span].copy()
        event, shift = nominal.landing[span].copy(), np.zeros((steps, 4, 3))
        landed = {number: -np.inf for number, _, _ in situation.standing.values() if number >= 0}
        for number, time in (early | landed).items():
            swing = nominal.swings[number]
            if swing.contact is None:
                continue
            here, limb = (middle > time) & (middle < swing.end), swing.limb
            active[here, limb], event[here, limb] = True, number
            position[here, limb], rotation[here, limb] = swing.contact.pose.position, swing.contact.pose.rotation
            friction[here, limb] = swing.contact.friction
        for limb in range(4):
            if active[0, limb] and limb not in situation.standing:
                active[0, limb] = False  # late: it bears nothing yet
        for limb, (number, place, turned) in situation.standing.items():
            here = event[:, limb] == number
            rotation[here, limb] = turned
            shift[here, limb] = place - position[here, limb]
        for number, moved in situation.fixed.items():
            limb = nominal.swings[number].limb
            shift[event[:, limb] == number, limb] = moved
        return cls(active, position, rotation, friction, event, shift)
