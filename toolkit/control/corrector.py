"""What the controller tracks at a tick, its contact cones, and the interface of what may correct it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.centroidal.problem import Margins
from toolkit.control.dynamics import RobotDynamics
from toolkit.control.limb_target import LimbTargets
from toolkit.control.sampled_plan import Reference

PENDULUM_RATE = 3.4
"""Rate in 1/s of an inverted pendulum like a humanoid of the usual size (`toolkit.robot.scale`).

The CoM diverges by `(c - c_plan) + (v - v_plan) / rate`.
"""


@dataclass(frozen=True)
class Cones:
    """What the controller allows of a contact wrench.

    Attributes:
        friction: factor on the friction.
        yaw: factor on the friction that may be used for the yaw moment.
        margins: those of the plan.
        part: what the controller keeps of the plan's margin of the centre of pressure.
    """

    friction: float
    yaw: float
    margins: Margins
    part: float

    def within(self, half_size: np.ndarray) -> np.ndarray:
        """(..., 2) m half extents within which the centre of pressure stays, of those that bear."""
        return self.margins.within(half_size, self.part)


@dataclass
class MotionTarget:
    """What the controller tracks at a tick; world frame, SI units.

    Attributes:
        com, com_velocity, com_acceleration: Each (3,).
        angular_momentum, angular_momentum_rate: Each (3,), about the CoM.
        wrench: (4, 6) wrenches about the patches' centres in the contact frames.
    """

    com: np.ndarray
    com_velocity: np.ndarray
    com_acceleration: np.ndarray
    angular_momentum: np.ndarray
    angular_momentum_rate: np.ndarray
    wrench: np.ndarray

    @classmethod
    def zeros(cls) -> MotionTarget:
        """A target of zeros."""
        com, velocity, acceleration, momentum, rate = np.zeros((5, 3))
        return cls(com, velocity, acceleration, momentum, rate, np.zeros((4, 6)))

    def follow(self, reference: Reference, index: int) -> None:
        """Copy a row of the plan."""
        self.com[:], self.com_velocity[:] = reference.com[index], reference.com_velocity[index]
        self.com_acceleration[:] = reference.com_acceleration[index]
        self.angular_momentum[:] = reference.angular_momentum[index]
        self.angular_momentum_rate[:] = reference.angular_momentum_rate[index]
        self.wrench[:] = reference.wrench[index]


class Corrector(Protocol):
    """Optimises the motion anew while the plan is carried out; see `toolkit.replanning.replanner.Replanner`."""

    com_shift: np.ndarray

    def update(
        self, index: int, dynamics: RobotDynamics, targets: LimbTargets, cones: Cones, aim: MotionTarget
    ) -> None:
        """Move the aim and the landing points of the targets at a row of the reference."""
        ...
