"""A leg by forward kinematics: a chain of rotations from the hip down to the sole, and torques by virtual work."""

import numpy as np

ROLES = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
_AXES = {"yaw": np.array([0.0, 0.0, 1.0]), "roll": np.array([1.0, 0.0, 0.0]), "pitch": np.array([0.0, 1.0, 0.0])}


def turn(axis, angle):
    """Rotation about a unit axis, by the exponential series of its cross product (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def chain(leg, com, heading, angles):
    """Hip, knee, ankle, sole (3,) m and world_from_sole of a leg with joint angles in the order of `ROLES`."""
    base, angle_of = turn(_AXES["yaw"], heading), dict(zip(ROLES, angles, strict=True))
    thigh = base
    for number in leg.hips.order:
        axis = ("roll", "pitch", "yaw")[number]
        thigh = thigh @ turn(_AXES[axis], angle_of[f"hip_{axis}"])
    thigh = thigh @ turn(_AXES["pitch"], -np.arctan2(leg.hips.skew[1], leg.hips.skew[0]))
    shin = thigh @ turn(_AXES["pitch"], angle_of["knee"])
    sole = shin @ turn(_AXES["pitch"], angle_of["ankle_pitch"]) @ turn(_AXES["roll"], angle_of["ankle_roll"])
    hip = com + base @ leg.hip_in_com
    knee = hip - leg.thigh * thigh[:, 2]
    ankle = knee - leg.shin * shin[:, 2]
    return hip, knee, ankle, ankle - sole @ leg.ankle_in_sole, sole


def angles_of(posture):
    """Joint angles of one posture in the order of `ROLES`."""
    return np.array([np.squeeze(getattr(posture, role)) for role in ROLES])


def torques(leg, com, heading, angles, force, moment, step=1e-6):
    """Role -> torque that holds a force and a moment about the sole's centre: their work as a joint turns a little."""
    result = {}
    for k, role in enumerate(ROLES):
        low, high = (chain(leg, com, heading, angles + side * step * np.eye(6)[k])[3:] for side in (-1, 1))
        spin = (high[1] - low[1]) @ chain(leg, com, heading, angles)[4].T  # a cross product, times two steps
        turned = np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2
        result[role] = ((high[0] - low[0]) @ force + turned @ moment) / (2 * step)
    return result
