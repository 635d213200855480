"""How far the postures of a search may go: margins of the legs and heights of the CoM."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.physics.leg import ReachMargins
from toolkit.robot.model import RobotModel

SHIFTS = (0.0, -0.25, 0.25)  # parts of the way from one sole to the other, from their middle, where the CoM may be
_DROP = 0.25  # part of its height at home by which the CoM may be lower
# Margins of the legs of a body of the usual size (`toolkit.robot.scale`). The hips' is negative, as the base, which the
# closed form keeps upright, may help them.
_MARGINS = ReachMargins(length=0.005, ankle=0.05, hip=-0.1)
# What is added to them, up to `MOST_CARE` times, after searches of which no sequence had a motion for the legs.
_MORE = ReachMargins(length=0.005, ankle=0.05, hip=0.05)
MOST_CARE = 3
_CLIMB = 0.55  # part of thigh and shin together by which the heights of two soles may differ

_APART = 0.02  # m; least distance between two soles
_TOUCH = 0.001  # m; how far the outlines of two feet may reach into each other, less than postures may


def sole_room(robot: RobotModel) -> np.ndarray:
    """Half extents (2,) m of the room of a foot, into which no other foot may step.

    It holds the sole with half the distance between two soles, and all of a foot that is wider than its sole.
    """
    half = robot.half_sizes[Limb.LEFT_FOOT] + robot.scale.length * _APART / 2
    return np.maximum(half, robot.foot_outline - _TOUCH)


def margins(robot: RobotModel, care: int = 0) -> ReachMargins:
    """Margins of the legs, which have grown so many times (`care`)."""
    wanted = {name: value + care * getattr(_MORE, name) for name, value in asdict(_MARGINS).items()}
    return ReachMargins(**wanted).scaled(robot.scale.length)


def climb(robot: RobotModel) -> float:
    """Largest difference of the heights of two soles in m."""
    leg = robot.legs[Limb.LEFT_FOOT]
    return _CLIMB * (leg.thigh + leg.shin)


def drops(robot: RobotModel) -> np.ndarray:
    """(k,) m; heights by which the CoM may be lower than at home."""
    return np.linspace(0.0, _DROP, 7) * robot.com_height
