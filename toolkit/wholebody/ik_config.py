"""Settings of the whole-body inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolkit.wholebody.avoidance import AvoidanceConfig


@dataclass(frozen=True)
class IKConfig:
    """Weights of the inverse kinematics; the defaults suit humanoids of any size.

    Attributes:
        substeps: quadratic programs per sample of the trajectory.
        settle: iterations for the first sample.
        foot_position, foot_orientation: weights per squared m or rad of a foot in contact.
        air_position, air_orientation: the same in the middle of a swing: where joints are too slow the foot gives way,
            not the base.
        com, palm_position, palm_normal, palm_twist, base: weights per squared m or rad.
        arms, trunk, legs, rest: weights per squared rad of a tick's deviation from the eased return to the home
            posture; the trunk is what carries both arms, the rest is a head and the like.
        posture_time: s; time constant of that return.
        inertia: weight of the last tick's displacement in that return; it smooths free joints over as many ticks.
        arm_swing: rad; a free arm's joints stay this close to the home posture, or come no farther away.
        angular_momentum: weight per squared rad of a tick's deviation from the planned angular momentum, divided by
            mass times squared CoM height; a large one makes trunk and arms swing wide.
        velocity_fraction: share of the joint velocity limits that may be used.
        range_margin: rad; kept from each end of a joint's range.
        range_rate: 1/s; how fast a joint may approach the end of its range, per rad of distance.
        min_knee: rad; least knee flexion.
        avoid: weight per squared m by which an arm comes nearer to something than its damper allows.
        avoidance: see the class.
    """

    substeps: int = 2
    settle: int = 200
    foot_position: float = 1e6
    foot_orientation: float = 1e5
    air_position: float = 1e4
    air_orientation: float = 30.0
    com: float = 1e5
    palm_position: float = 1e5
    palm_normal: float = 1e4
    palm_twist: float = 0.1
    base: float = 10.0
    arms: float = 1.5
    trunk: float = 5.0
    legs: float = 0.01
    rest: float = 50.0
    posture_time: float = 0.1
    inertia: float = 2.0
    arm_swing: float = 0.6
    angular_momentum: float = 5e3
    velocity_fraction: float = 0.95
    range_margin: float = 0.02
    range_rate: float = 25.0
    min_knee: float = 0.12
    avoid: float = 1e3
    avoidance: AvoidanceConfig = field(default_factory=AvoidanceConfig)
