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
        extra_rest: s; on the last stance, beyond the plan's own rest.
        slip_force: N; a patch that carries more is in contact (measurement).
        contact_gap: s; shorter interruptions do not end a contact (measurement).
        settle_time: s; from touchdown to the pose that slip is counted from.
        max_tilt: rad; of the base, beyond which the robot has fallen.
        min_height: fraction of the home CoM height above the lowest foot, below which the robot has fallen.
        slip_limit, com_rms_limit: m; of the verdict.
        range_tolerance: rad; of the verdict on joint ranges.
        controller, replanning, disturbance: see the classes.
    """

    timestep: float = 0.002
    control_decimation: int = 1
    extra_rest: float = 0.5
    slip_force: float = 20.0
    contact_gap: float = 0.03
    settle_time: float = 0.02
    max_tilt: float = 1.0471975511965976
    min_height: float = 0.5
    slip_limit: float = 0.02
    com_rms_limit: float = 0.02
    range_tolerance: float = 1e-3
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
