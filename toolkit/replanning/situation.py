"""The measured situation that a replan starts from, and the contacts in its steps."""

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
        time: Time in s.
        com, velocity, spin: Each (3,); `spin` is the angular momentum about the CoM per mass.
        standing: By limb in contact, the swing that made it (-1: none), position (3,) and rotation (3, 3) of the patch.
        fixed: By swing under way whose landing point is kept, its shift (3,) from the plan in m.
        moving: By swing under way whose landing point may still move, the limb's present shift (3,) in m.
        goal: By swing, the shift (3,) in m that was decided last.
        landing, earliest: By swing under way, its end in s as decided last, and its earliest possible end.
        com_shift: (3,) m; shift of the plan with the feet that bear it.
        displaced: Whether feet stand or go elsewhere than planned, or land earlier.
        cones: What the controller allows.
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
        active, rotation, friction, half_size: (N, 4), (N, 4, 3, 3), (N, 4) and (N, 4, 2).
        position: (N, 4, 3) m, as planned.
        event: (N, 4) swing that makes or made the contact; -1 for those of the start.
        shift: (N, 4, 3) m from the plan, of contacts that stand or whose landing point is kept.
    """

    active: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    friction: np.ndarray
    half_size: np.ndarray
    event: np.ndarray
    shift: np.ndarray

    @classmethod
    def of(cls, nominal: Nominal, situation: Situation, first: int, times: np.ndarray, early: dict[int, float]):
        """The contacts of a situation.

        Args:
            nominal: The plan.
            situation: The measured situation.
            first: Step of the plan in which the horizon begins.
            times: Knots (N + 1,) of the horizon in s.
            early: By swing, its end in s where that is before its planned end.
        """
        steps, middle = len(times) - 1, (times[:-1] + times[1:]) / 2
        span = slice(first, first + steps)
        plan = nominal.problem
        active, position = plan.active[span].copy(), plan.position[span].copy()
        rotation, friction = plan.rotation[span].copy(), plan.friction[span].copy()
        half_size = plan.half_size[span].copy()
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
            half_size[here, limb] = plan.half_size[np.argmax(nominal.landing[:, limb] == number), limb]
        for limb in range(4):
            if active[0, limb] and limb not in situation.standing:
                active[0, limb] = False  # the limb is late and bears nothing yet
        for limb, (number, place, turned) in situation.standing.items():
            here = event[:, limb] == number
            rotation[here, limb] = turned
            shift[here, limb] = place - position[here, limb]
        for number, moved in situation.fixed.items():
            limb = nominal.swings[number].limb
            shift[event[:, limb] == number, limb] = moved
        return cls(active, position, rotation, friction, half_size, event, shift)
