"""Settings of replanning during the execution."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReplanConfig:
    """The centroidal motion is optimised again over the next contacts from the measured state.

    Attributes:
        enabled: whether that is done at all...
        max_friction: ... where the plan keeps to this part of the friction: a descent at the limit of friction has
            nothing left to correct with, and was better followed as planned.
        period: s between replans.
        horizon: s that a replan looks ahead.
        landings: contacts to be made whose places are free, at most.
        max_shift: m; of one landing point.
        deadband: m; divergence from the plan that the controller's gains settle without a replan, where every foot is
            also as near to its planned place: the plan is followed as it is.
    """

    enabled: bool = True
    max_friction: float = 0.9
    period: float = 0.04
    horizon: float = 1.6
    landings: int = 2
    max_shift: float = 0.15
    deadband: float = 0.01
