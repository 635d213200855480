"""Settings of the controller."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TaskGains:
    """One task of the controller: `weight |J qdd + dJ v - a*|^2` with `a* = a_ref + kp e + kd de`.

    Attributes:
        weight: per squared m/s^2 or rad/s^2.
        kp: 1/s^2.
        kd: 1/s.
    """

    weight: float
    kp: float
    kd: float


@dataclass(frozen=True)
class ControllerConfig:
    """Inverse-dynamics controller; the defaults walked on flat ground, stones, stairs and with a palm on a wall.

    Attributes:
        swing, swing_rotation: a foot in the air.
        hand: a palm that approaches or leaves its contact.
        com, base, posture: centre of mass, orientation of the base, joints; arms and trunk that follow momentum rather
            than the plan leave the way that was found clear.
        angular_momentum: `weight |(dk/dt - dk_ref/dt - kp (k_ref - k)) / 10 kg m^2/s|^2`; kd is unused.
        nesting: where the controller's margins lie between the plan's (1) and the simulation's (0).
    """

    swing: TaskGains = TaskGains(200.0, 400.0, 40.0)
    swing_rotation: TaskGains = TaskGains(20.0, 400.0, 40.0)
    hand: TaskGains = TaskGains(50.0, 200.0, 28.0)
    com: TaskGains = TaskGains(1000.0, 60.0, 14.0)
    base: TaskGains = TaskGains(50.0, 100.0, 20.0)
    posture: TaskGains = TaskGains(4.0, 60.0, 15.0)
    angular_momentum: TaskGains = TaskGains(40.0, 5.0, 0.0)
    nesting: float = 0.5
