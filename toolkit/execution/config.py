"""Settings of the simulated execution."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.errors import InputError
from toolkit.execution.disturbance import Disturbance


@dataclass(frozen=True)
class ExecutionConfig:
    """The simulated run.

    Attributes:
        timestep: Step of the physics in s.
        control_decimation: Physics steps per control tick.
        slip_limit, com_rms_limit: Limits of the verdict in m.
        replanning: Whether the motion is optimised again during the run.
        disturbance: Differences between the simulation and the plan.
    """

    timestep: float = 0.002
    control_decimation: int = 1
    slip_limit: float = 0.02
    com_rms_limit: float = 0.02
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
