"""Weights and settings of the whole-body inverse kinematics, for a body of the usual size (`toolkit.robot.scale`).

Weights per squared m go with the inverse square of the lengths, times with the robot's, and all else suits any size.
"""

from __future__ import annotations

import math

# Weights of tasks per squared m or rad, from the strongest.
FOOT_POSITION, FOOT_ORIENTATION = 1e6, 1e5  # of a foot in contact
COM = 1e5
PALM_POSITION, PALM_NORMAL, PALM_TWIST = 1e5, 1e4, 0.1  # a palm may turn about its normal as the arm likes
# In the middle of a swing: where joints are too slow the foot gives way, not the base.
AIR_POSITION, AIR_ORIENTATION = 1e4, 30.0
EFFORT = 1e5  # per squared rad by which a joint's displacement asks its motor for more than its share
BASE = 10.0
STEADY = 1e3  # of the base from where the last tick's turn would take it
# Share of the last tick's turn, less the wanted one, that the next begins with. The base is an oscillator with a
# frequency of sqrt(BASE / STEADY) per tick: with all of it the pelvis rocks under the trunk, with this share it is
# critically damped.
KEPT_TURN = 1.0 - 2.0 * math.sqrt(BASE / STEADY)
# Per squared rad of a tick's deviation from the planned angular momentum, divided by mass times squared CoM height.
# A larger weight makes trunk and arms swing wide.
ANGULAR_MOMENTUM = 5e3

# Weights per squared rad of a tick's deviation from the eased return to the home posture. The trunk carries both arms.
# The rest is a head and the like.
ARMS, TRUNK, LEGS, REST = 1.5, 5.0, 0.01, 50.0
POSTURE_TIME = 0.1  # s; time constant of that return
INERTIA = 2.0  # weight of the last tick's displacement in that return; it smooths free joints over as many ticks

SUBSTEPS = 2  # quadratic programs per sample of the trajectory
EASING = 3  # most solutions of a quadratic program whose motion asks motors for too much
SETTLE = 200  # most iterations for the first sample
RANGE_RATE = 25.0  # 1/s; how fast a joint may approach the end of its range, per rad of distance
ARM_SWING = 0.6  # rad; a free arm's joints stay this close to the home posture, or come no farther away
GIVING_WAY = 1.0  # rad; the same for arms that have to give way
SWING_RATE = 10.0  # 1/s; the same as RANGE_RATE for that range: an arm that runs into its ends has to brake
VELOCITY_FRACTION = 0.95  # share of the joint velocity limits that may be used
RANGE_MARGIN = 0.02  # rad; kept from each end of a joint's range
MIN_KNEE = 0.12  # rad; least knee flexion
