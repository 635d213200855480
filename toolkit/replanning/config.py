"""Settings of replanning during the execution."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.centroidal.body import BodyMargins


@dataclass(frozen=True)
class ReplanConfig:
    """The centroidal motion is optimised again over the next contacts from the measured state.

    Attributes:
        enabled: whether that is done at all...
        max_friction: ... where the plan keeps to this part of the friction: a descent at the limit of friction has
            nothing left to correct with, and was better followed as planned.
        period: s between replans.
        horizon: s that a replan looks ahead.
        max_dt: s; longest step of its grid.
        landings: contacts to be made whose places are free, at most.
        max_shift: m; of one landing point.
        slew: m/s; by how much a landing point may still move per second that is left.
        pace: at most so much faster than planned may a swing go on, where its contact is needed earlier...
        pace_rate: 1/s; ... changing its pace by this much per second...
        shortest: s; ... unless the whole swing would be shorter than this.
        early: cost of ending a swing 1 s before its planned end.
        early_gain: by which the objective must improve for that.
        early_objective: from which on it is considered at all.
        fraction: of the swing, after which the landing point is kept.
        margin: m; distance of the sole from the edge of its surface.
        gap: m; distance of a landing sole from the other one.
        deadband: m; divergence from the plan that the controller's gains settle without a replan, where every foot is
            also as near to its planned place: the plan is followed as it is.
        settled: m; divergence left when the next foot lands, up to which landing points stay where they are planned...
        excess: ... and cost of the body's limits exceeded on the way.
        frequency: 1/s; of the pendulum in the divergence `(c - c_plan) + (v - v_plan) / frequency`.
        com, velocity, climb, spin, spin_rate: weights of the deviations from the plan: m^2 s, m^2/s (horizontal and
            vertical), (m^2/s)^2 s and (m^2/s^2)^2 s (spin: angular momentum per mass).
        final: weight of the divergence at the end of the horizon, m^2.
        force, moment: weights of the wrenches' deviations, in weights and weights times 1 m.
        landing: weight of a landing point's shift, m^2; landing_change: of its change since the last replan.
        price: of exceeding the body's limits by 1 m or 1 rad.
        body: margins kept inside the body's limits; smaller than the plan's.
        max_iterations, tolerance: of the solver.
    """

    enabled: bool = True
    max_friction: float = 0.9
    period: float = 0.04
    horizon: float = 1.6
    max_dt: float = 0.1
    landings: int = 2
    max_shift: float = 0.15
    slew: float = 0.8
    pace: float = 1.9
    pace_rate: float = 12.0
    shortest: float = 0.3
    early: float = 3.0
    early_gain: float = 0.3
    early_objective: float = 0.3
    fraction: float = 0.75
    margin: float = 0.01
    gap: float = 0.02
    deadband: float = 0.01
    settled: float = 0.01
    excess: float = 0.02
    frequency: float = 3.4
    com: float = 200.0
    velocity: float = 5.0
    climb: float = 40.0
    spin: float = 100.0
    spin_rate: float = 8.0
    final: float = 2000.0
    force: float = 1.0
    moment: float = 5.0
    landing: float = 30.0
    landing_change: float = 4.0
    price: float = 10.0
    body: BodyMargins = BodyMargins(length=0.007, ankle=0.05, hip=0.025, height=0.01, torque=0.92)
    max_iterations: int = 25
    tolerance: float = 1e-6
