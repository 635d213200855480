"""Window: the plan at the knots of a replan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.replanning.nominal import Nominal

SHORT = 0.5
"""Part of the next step; a first step that is shorter joins it where no contact changes between them.

In a few milliseconds only great forces change a state, and the solver takes many iterations to weigh them.
"""


@dataclass(frozen=True)
class Window:
    """The plan at the N + 1 knots of a replan, the first one at the time of the measured state.

    Attributes:
        first, last: The step of the plan to which the first one belongs, and the last knot.
        times: (N + 1,) s.
        com, velocity: Each (N + 1, 3); the planned CoM.
        spin, wrench_spin: Each (N + 1, 3); angular momentum about the CoM per mass, of postures and wrenches.
    """

    first: int
    last: int
    times: np.ndarray
    com: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    wrench_spin: np.ndarray

    @classmethod
    def of(cls, nominal: Nominal, time: float, horizon: float) -> Window:
        """The knots from a time on, as far as the horizon goes."""
        first = int(np.searchsorted(nominal.times, time + 1e-6, side="right")) - 1
        last = min(int(np.searchsorted(nominal.times, time + horizon, side="left")), len(nominal.times) - 1)
        knots = slice(first, last + 1)
        times, com, velocity = nominal.times[knots].copy(), nominal.com[knots].copy(), nominal.velocity[knots].copy()
        spin, made = nominal.spin[knots].copy(), nominal.wrench_spin[knots].copy()
        inside = time - nominal.times[first]
        times[0] = time
        com[0] += inside * (velocity[0] + 0.5 * inside * nominal.acceleration[first])
        velocity[0] += inside * nominal.acceleration[first]
        for each in (spin, made):
            each[0] += inside / (nominal.times[first + 1] - nominal.times[first]) * (each[1] - each[0])
        active, ahead = nominal.problem.active, np.diff(times[:3])
        if len(ahead) == 2 and ahead[0] < SHORT * ahead[1] and (active[first] == active[first + 1]).all():
            kept = np.delete(np.arange(len(times)), 1)
            times, com, velocity, spin, made = (each[kept] for each in (times, com, velocity, spin, made))
            first += 1
        return cls(first, last, times, com, velocity, spin, made)

    @property
    def steps(self) -> int:
        """The number N of steps."""
        return self.last - self.first

    @property
    def dt(self) -> np.ndarray:
        """Lengths (N,) of the steps in s."""
        return np.diff(self.times)
