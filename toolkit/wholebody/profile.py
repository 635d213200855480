"""Scalar timing profiles: how far along a move is, with its rate and acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MINIMUM_JERK_SHARE = 0.3


def blend(x):
    """Smooth step from 0 to 1 with zero rate at both ends, `0.3 minimum-jerk + 0.7 cubic`.

    The mix has a lower peak velocity and acceleration than a pure minimum-jerk profile, which trackers pay for.

    Args:
        x: float or (k,) float in [0, 1].

    Returns:
        Value, first and second derivative with respect to x, each of the kind of `x`.
    """
    a, b, y = MINIMUM_JERK_SHARE, 1.0 - MINIMUM_JERK_SHARE, 1.0 - x
    value = a * x**3 * (10.0 - 15.0 * x + 6.0 * x**2) + b * x**2 * (3.0 - 2.0 * x)
    rate = a * 30.0 * x**2 * y**2 + b * 6.0 * x * y
    acceleration = (a * 60.0 * x * y + b * 6.0) * (y - x)
    return value, rate, acceleration


@dataclass(frozen=True)
class Window:
    """The part of a swing, as fractions of its duration, during which a move takes place."""

    start: float
    end: float

    def value(self, u: np.ndarray) -> np.ndarray:
        """(k,) values at (k,) fractions of the swing of a smooth step from 0 to 1 within the window."""
        return blend(np.clip((u - self.start) / (self.end - self.start), 0.0, 1.0))[0]

    def step(self, u: float) -> tuple[float, float, float]:
        """That step at one fraction with its first and second derivative with respect to u; 0 outside the window."""
        width = self.end - self.start
        x = (u - self.start) / width
        if x < 0.0:
            return 0.0, 0.0, 0.0
        if x > 1.0:
            return 1.0, 0.0, 0.0
        value, rate, acceleration = blend(x)
        return value, rate / width, acceleration / width**2

    def bump(self, u: float) -> tuple[float, float, float]:
        """A smooth bump from 0 to 1 and back, `4 s (1 - s)` of that step s, with its derivatives."""
        s, rate, acceleration = self.step(u)
        curvature = 4.0 * (1.0 - 2.0 * s) * acceleration - 8.0 * rate**2
        return 4.0 * s * (1.0 - s), 4.0 * (1.0 - 2.0 * s) * rate, curvature
