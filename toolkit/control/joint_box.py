"""JointBox: accelerations that keep joints within their ranges and velocity limits."""

from __future__ import annotations

import numpy as np

from toolkit.control.config import ControllerConfig
from toolkit.robot.model import RobotModel


class JointBox:
    """Bounds on joint accelerations.

    With d the distance to the upper end of the range and r the rate, `qdd <= r^2 d - 2 r v` keeps d >= 0 for ever once
    `v <= r d` holds (a barrier of second order); `qdd <= (v_max - v) / T` keeps the velocity limit. The same downwards.

    Attributes:
        lower, upper: (n,) rad/s^2, lower <= upper.
    """

    def __init__(self, robot: RobotModel, config: ControllerConfig):
        self._config = config
        margin = np.minimum(config.range_margin, 0.1 * (robot.upper - robot.lower))
        self._low, self._high = robot.lower + margin, robot.upper - margin
        self._speed = config.velocity_fraction * robot.velocity_limit
        count = len(robot.joint_names)
        self.lower, self.upper = np.zeros(count), np.zeros(count)
        self._work = np.zeros(count)

    def update(self, joints: np.ndarray, velocity: np.ndarray) -> None:
        """Evaluate at (n,) joint positions and velocities."""
        config, work = self._config, self._work
        rate, bound = config.range_rate, config.max_acceleration
        np.subtract(self._high, joints, out=self.upper)
        self.upper *= rate**2
        self.upper -= 2.0 * rate * velocity
        np.subtract(self._speed, velocity, out=work)
        work /= config.velocity_time
        np.minimum(self.upper, work, out=self.upper)
        np.subtract(self._low, joints, out=self.lower)
        self.lower *= rate**2
        self.lower -= 2.0 * rate * velocity
        np.add(self._speed, velocity, out=work)
        work /= -config.velocity_time
        np.maximum(self.lower, work, out=self.lower)
        np.clip(self.upper, -bound, bound, out=self.upper)
        np.clip(self.lower, -bound, bound, out=self.lower)
        # Where a joint is pressed from both sides the middle is the best that can be done.
        np.add(self.lower, self.upper, out=work)
        work *= 0.5
        crossed = self.lower > self.upper
        self.lower[crossed] = self.upper[crossed] = work[crossed]
