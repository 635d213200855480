"""Settings of the whole-body inverse kinematics, and the weights of its tasks."""

from __future__ import annotations

from dataclasses import dataclass

# Weights of tasks per squared m or rad, from the strongest; they suit humanoids of any size.
FOOT_POSITION, FOOT_ORIENTATION = 1e6, 1e5  # of a foot in contact
COM = 1e5
PALM_POSITION, PALM_NORMAL, PALM_TWIST = 1e5, 1e4, 0.1  # a palm may turn about its normal as the arm likes
# In the middle of a swing: where joints are too slow the foot gives way, not the base.
AIR_POSITION, AIR_ORIENTATION = 1e4, 30.0
AVOID = 1e3  # per squared m by which an arm comes nearer to something than its damper allows
BASE = 10.0

# Weights per squared rad of a tick's deviation from the eased return to the home posture. The trunk is what carries
# both arms, the rest is a head and the like.
ARMS, TRUNK, LEGS, REST = 1.5, 5.0, 0.01, 50.0
POSTURE_TIME = 0.1  # s; time constant of that return
INERTIA = 2.0  # weight of the last tick's displacement in that return; it smooths free joints over as many ticks

SETTLE = 200  # iterations for the first sample, at most
RANGE_RATE = 25.0  # 1/s; how fast a joint may approach the end of its range, per rad of distance


@dataclass(frozen=True)
class IKConfig:
    """Settings of the inverse kinematics; the defaults suit humanoids of any size.

    Attributes:
        substeps: quadratic programs per sample of the trajectory.
        arm_swing: rad; a free arm's joints stay this close to the home posture, or come no farther away.
        angular_momentum: weight per squared rad of a tick's deviation from the planned angular momentum, divided by
            mass times squared CoM height; a large one makes trunk and arms swing wide.
        velocity_fraction: share of the joint velocity limits that may be used.
        range_margin: rad; kept from each end of a joint's range.
        min_knee: rad; least knee flexion.
    """

    substeps: int = 2
    arm_swing: float = 0.6
    angular_momentum: float = 5e3
    velocity_fraction: float = 0.95
    range_margin: float = 0.02
    min_knee: float = 0.12
