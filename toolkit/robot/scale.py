"""Scale: how large a robot is beside the one that the toolkit's lengths, times and forces are written for."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

_LEG = 0.8  # m; thigh and shin of the body that the numbers are written for
_MASS = 68.0  # kg; its mass


_HEIGHT = 1.0  # m; CoM of a body that the times are written for
_ROTORS = 18.0  # such times, per root of a joint's armature over its torque


def pendulum_pace(com_height: float) -> float:
    """Factor on times that are written for a body whose CoM is 1 m high: that of a pendulum as high as this one, m."""
    return math.sqrt(com_height / _HEIGHT)


def rotor_factor(com_height: float, armature: np.ndarray, torque: np.ndarray) -> float:
    """Factor, 1 or more, by which the rotors of the legs make times longer than `pendulum_pace` does.

    In the quickest swing of 0.3 s times the pace, a joint that turns by 1 rad spends at most a fifth of its `torque`
    (n,) N m on its own rotor of `armature` (n,) kg m^2. (With the least jerk, the peak acceleration is 5.8 rad over the
    square of the time.)
    """
    least = _ROTORS * math.sqrt(float((armature / torque).max()))
    return max(least / pendulum_pace(com_height), 1.0)


def force_factor(mass: float) -> float:
    """Factor on forces for a body of a mass in kg, in three digits: contact forces carry its weight."""
    return float(f"{mass / _MASS:.3g}")


class Scale(NamedTuple):
    """Factors on numbers that are written for a body with legs of 0.8 m (thigh and shin) and a mass of 68 kg.

    Bodies of any size that move alike under the same gravity have the same accelerations and angles. Lengths then go
    with the leg, times and speeds with its root, forces with the mass.

    Attributes:
        length: Factor on lengths, rounded to 1 %, so that bodies of nearly the same size are treated alike.
        force: Factor on forces; see `force_factor`.
    """

    length: float = 1.0
    force: float = 1.0

    @classmethod
    def of(cls, leg: float, mass: float) -> Scale:
        """The scale of a body with legs of so many m, thigh and shin, and a mass in kg."""
        return cls(max(round(leg / _LEG, 2), 0.01), force_factor(mass))

    @property
    def time(self) -> float:
        """Factor on times: the root of that on lengths, as for a pendulum."""
        return math.sqrt(self.length)

    @property
    def speed(self) -> float:
        """Factor on speeds, a length per time."""
        return math.sqrt(self.length)

    @property
    def moment(self) -> float:
        """Factor on moments of force and rates of angular momentum."""
        return self.force * self.length


USUAL = Scale()
"""The scale of the body that the numbers are written for."""
