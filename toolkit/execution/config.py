"""Settings of the simulated execution."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.errors import InputError
from toolkit.execution.disturbance import Disturbance

SCUFF_LIMIT = 0.05
"""Largest change of the CoM's velocity that the touches of one swing may make, in m/s for a body of the usual size
(`toolkit.robot.scale`): their impulse over the robot's mass, 5 ms of its weight. At the height of a humanoid's CoM that
moves the capture point by some 15 mm, which a sole takes up as it does the 20 mm of the other limits; what is more is a
stumble."""


@dataclass(frozen=True)
class ExecutionConfig:
    """The simulated run.

    Attributes:
        timestep: Step of the physics in s.
        control_decimation: Physics steps per control tick.
        slip_limit: Limit of the verdict in m; simulated contacts creep alike under bodies of all sizes.
        com_rms_limit: Limit of the verdict in m, for a body of the usual size (`toolkit.robot.scale`).
        scuff_limit: Limit of the verdict in m/s, for the same.
        replanning: Whether the motion is optimised again during the run.
        disturbance: Differences between the simulation and the plan.
    """

    timestep: float = 0.002
    control_decimation: int = 1
    slip_limit: float = 0.02
    com_rms_limit: float = 0.02
    scuff_limit: float = SCUFF_LIMIT
    replanning: bool = True
    disturbance: Disturbance = Disturbance()

    def __post_init__(self):
        if not self.timestep > 0.0:
            raise InputError(f"physics timestep must be positive, got {self.timestep}; 0.002 s is the default")
        if self.control_decimation < 1:
            raise InputError(f"control_decimation must be at least 1, got {self.control_decimation}")

    @property
    def control_period(self) -> float:
        """Seconds between control ticks."""
        return self.timestep * self.control_decimation
