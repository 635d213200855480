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
        stance: a limb in contact is held still by its velocity only: where it rests is a measured fact.
        stance_palm_rotation: the same for the rotation of a palm, whose patch aligns itself with the surface.
        swing, swing_rotation: a foot in the air.
        swing_share: part of a foot's weights that counts until it prepares to land: where its joints are too slow the
            foot gives way, not the body.
        hand: a palm that approaches or leaves its contact.
        com, base, posture: centre of mass, orientation of the base, joints; arms and trunk that follow momentum rather
            than the plan leave the way that was found clear.
        leg_posture: factor on the posture's weight for joints that carry a foot.
        arm_posture: the same for an arm whose palm is in contact, and not quite where it was planned to be.
        angular_momentum: `weight |(dk/dt - dk_ref/dt - kp (k_ref - k)) / angular_momentum_scale|^2`; kd is unused.
        angular_momentum_scale: kg m^2/s per unit of the task.
        divergence_scale: m; divergence of the CoM that halves the weights of angular momentum and base orientation.
        divergence_rate: 1/s; frequency of the pendulum in `(c - c_ref) + (v - v_ref) / rate`.
        force: weight on squared N of deviation from the planned force.
        moment: weight on squared N m of deviation from the planned moment.
        acceleration: weight on squared joint accelerations (regularisation).
        nesting: where the controller's margins lie between the plan's (1) and the simulation's (0).
        urgent_nesting: the same for the CoP once the CoM diverges by `divergence_scale`.
        max_friction, max_yaw: bounds on the factors on friction and yaw moment, also where the plan has no margin.
        min_foot_force, min_palm_force: N; wanted in every settled contact.
        foot_ramp, palm_ramp: s; the bound on the normal force rises after contact is made.
        release_ramp: s; it falls before contact is broken.
        settle_force, release_force: N; where those bounds start and end.
        loose_force: N; a limb in contact that is measured to bear less bounced off...
        rest_speed: m/s; ... and goes back along the inward normal.
        torque_fraction: fraction of the joint torque limits that may be used.
        velocity_fraction: fraction of the joint velocity limits that may be used.
        range_margin: rad; kept from each end of a joint's range.
        range_rate: 1/s; how fast a joint may approach the end of its range, per rad of distance.
        velocity_time: s; over which a joint may reach its velocity limit.
        max_acceleration: rad/s^2; bound on every joint's acceleration.
    """

    stance: TaskGains = TaskGains(1e4, 0.0, 30.0)
    stance_palm_rotation: TaskGains = TaskGains(20.0, 0.0, 20.0)
    swing: TaskGains = TaskGains(200.0, 400.0, 40.0)
    swing_rotation: TaskGains = TaskGains(20.0, 400.0, 40.0)
    swing_share: float = 0.05
    hand: TaskGains = TaskGains(50.0, 200.0, 28.0)
    com: TaskGains = TaskGains(1000.0, 60.0, 14.0)
    base: TaskGains = TaskGains(50.0, 100.0, 20.0)
    posture: TaskGains = TaskGains(4.0, 60.0, 15.0)
    leg_posture: float = 0.005
    arm_posture: float = 0.01
    angular_momentum: TaskGains = TaskGains(40.0, 5.0, 0.0)
    angular_momentum_scale: float = 10.0
    divergence_scale: float = 0.01
    divergence_rate: float = 3.4
    force: float = 1e-5
    moment: float = 2e-4
    acceleration: float = 1e-4
    nesting: float = 0.5
    urgent_nesting: float = 0.05
    max_friction: float = 1.0
    max_yaw: float = 0.9
    min_foot_force: float = 10.0
    min_palm_force: float = 2.0
    foot_ramp: float = 0.06
    palm_ramp: float = 0.4
    release_ramp: float = 0.06
    settle_force: float = 30.0
    release_force: float = 5.0
    loose_force: float = 15.0
    rest_speed: float = 0.05
    torque_fraction: float = 0.98
    velocity_fraction: float = 0.95
    range_margin: float = 0.01
    range_rate: float = 25.0
    velocity_time: float = 0.02
    max_acceleration: float = 2000.0


@dataclass(frozen=True)
class TouchdownConfig:
    """When a moving limb is taken to be in contact.

    Attributes:
        early_fraction: of the swing, after which a measured force ends it.
        early_foot_force: N; ends a foot's swing early.
        late_foot_force: N; ends a foot's swing after its planned end.
        palm_force: N; makes a palm's contact.
        confirm_ticks: consecutive control ticks above the palm's force.
        late_foot_speed, palm_speed: m/s; along the inward normal after the planned end.
        max_depth: m; how far a limb searches below the planned surface.
    """

    early_fraction: float = 0.6
    early_foot_force: float = 25.0
    late_foot_force: float = 15.0
    palm_force: float = 3.0
    confirm_ticks: int = 2
    late_foot_speed: float = 0.15
    palm_speed: float = 0.08
    max_depth: float = 0.08
