"""JointBox: accelerations that keep joints within their ranges and velocity limits."""

from __future__ import annotations

import numpy as np

from toolkit.robot.model import RobotModel

# Rates, times and accelerations are those of a body of the usual size (`toolkit.robot.scale`).
RANGE_MARGIN = 0.01  # rad; kept from each end of a joint's range
RANGE_RATE = 25.0  # 1/s; speed at which a joint may approach the end of its range, per rad of distance
VELOCITY_FRACTION = 0.95  # usable part of the joint velocity limits: a tick's error stays within the limit
VELOCITY_TIME = 0.02  # s; time in which a joint may reach its velocity limit
MAX_ACCELERATION = 2000.0  # rad/s^2; bound on every joint's acceleration: keeps the QP's numbers alike


class JointBox:
    """Bounds on joint accelerations.

    With d the distance to the upper end of the range and r the rate, `qdd <= r^2 d - 2 r v` keeps d >= 0 once
    `v <= r d` holds (a barrier of second order), and `qdd <= (v_max - v) / T` keeps the velocity limit. Both hold for
    the lower ends alike.

    Attributes:
        lower, upper: Each (n,) rad/s^2; lower <= upper.
    """

    def __init__(self, robot: RobotModel):
        margin = np.minimum(RANGE_MARGIN, 0.1 * (robot.upper - robot.lower))
        self._low, self._high = robot.lower + margin, robot.upper - margin
        self._speed = VELOCITY_FRACTION * robot.velocity_limit
        scale = robot.scale
        self._time, self._rate = scale.time * VELOCITY_TIME, RANGE_RATE / scale.time
        self._most = MAX_ACCELERATION / scale.length
        count = len(robot.joint_names)
        self.lower, self.upper = np.zeros(count), np.zeros(count)
        self._work = np.zeros(count)

    def update(self, joints: np.ndarray, velocity: np.ndarray) -> None:
        """Evaluate at (n,) joint positions and velocities."""
        work, rate = self._work, self._rate
        np.subtract(self._high, joints, out=self.upper)
        self.upper *= rate**2
        self.upper -= 2.0 * rate * velocity
        np.subtract(self._speed, velocity, out=work)
        work /= self._time
        np.minimum(self.upper, work, out=self.upper)
        np.subtract(self._low, joints, out=self.lower)
        self.lower *= rate**2
        self.lower -= 2.0 * rate * velocity
        np.add(self._speed, velocity, out=work)
        work /= -self._time
        np.maximum(self.lower, work, out=self.lower)
        np.clip(self.upper, -self._most, self._most, out=self.upper)
        np.clip(self.lower, -self._most, self._most, out=self.lower)
        # Where the two bounds contradict each other, both become the middle.
        np.add(self.lower, self.upper, out=work)
        work *= 0.5
        crossed = self.lower > self.upper
        self.lower[crossed] = self.upper[crossed] = work[crossed]
