"""Settings of the simulated execution."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolkit.control.config import ControllerConfig
from toolkit.errors import InputError
from toolkit.execution.disturbance import Disturbance
from toolkit.replanning.config import ReplanConfig


@dataclass(frozen=True)
class ExecutionConfig:
    """The simulated run.

    Attributes:
        timestep: s; of the physics.
        control_decimation: physics steps per control tick.
        slip_limit, com_rms_limit: m; of the verdict.
        controller, replanning, disturbance: see the classes.
    """

    timestep: float = 0.002
    control_decimation: int = 1
    slip_limit: float = 0.02
    com_rms_limit: float = 0.02
    controller: ControllerConfig = field(default_factory=ControllerConfig)
    replanning: ReplanConfig = field(default_factory=ReplanConfig)
    disturbance: Disturbance = field(default_factory=Disturbance)

    def __post_init__(self):
        if not self.timestep > 0.0:
            raise InputError(f"physics timestep must be positive, got {self.timestep}; 0.002 s is the default")
        if self.control_decimation < 1:
            raise InputError(f"control_decimation must be at least 1, got {self.control_decimation}")

    @property
    def control_period(self) -> float:
        """Seconds between control ticks."""
        return self.timestep * self.control_decimation
