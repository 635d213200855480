"""How the posture of a leg and the torques about its joints change as its hip moves, the sole at rest.

In its plane a leg has two angles: the shin's lean, and the thigh's. The plane turns about the sole's x axis. So the
thigh's angular velocity is the rate of the ankle's roll about the one axis and that of the thigh's lean about the
pitch axis, and the hip's joints share it by their axes. All slopes are gradients by the hip's place: three components
in the axes of the world.

The heading and the posture are those of `toolkit.physics.leg`. Beyond the length of its two links, where a leg is taken
to be nearly straight, the slopes of the hip's angles hold approximately.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from toolkit.compiled import law
from toolkit.physics.leg import (
    STRAIGHT,
    between,
    by_axis,
    dot,
    from_base,
    hip_axes,
    moment_about,
    picked_vector,
    vectors_by_axis,
)
from toolkit.physics.momentum import cross
from toolkit.robot.model import HipJoints


class LegSlopes(NamedTuple):
    """Gradients by the hip's place of what the others follow from.

    Attributes:
        length: Of the distance from hip to ankle; its unit vector.
        roll, shin, thigh: rad/m; of the ankle's roll, and of the lean of shin and thigh in the plane of the leg.
        forward: Unit vector; the sole's x axis, about which the plane turns against the roll.
    """

    length: Any
    roll: Any
    shin: Any
    thigh: Any
    forward: Any


@law
def leg_slopes(posture, rotation, thigh, shin, tiny=0.0):
    """Slopes of a posture of links of `thigh` and `shin` m; the rotation is world_from_sole, `tiny` in m^2 as there."""
    hip, knee, ankle, across = posture.hip_point, posture.knee_point, posture.ankle_point, posture.pitch_axis
    forward = rotation[0, 0], rotation[1, 0], rotation[2, 0]
    length, line = posture.length, between(knee, hip)
    along = _scaled(1.0 / length, between(ankle, hip))
    cosine = (length * length + shin * shin - thigh * thigh) / (2.0 * shin * length)
    bends = (np.fabs(cosine) < STRAIGHT) / np.sqrt(np.fmax(1.0 - cosine * cosine, 1.0 - STRAIGHT * STRAIGHT))
    # The lean of the line from ankle to hip, and of the shin from there.
    shin_lean = _sum(1.0 / length, cross(across, along), (cosine / length - 1.0 / shin) * bends, along)
    out = length * dot(along, forward)
    square = dot(line, line)
    thigh_lean = _sum(1.0 / square, cross(across, line), -dot(between(ankle, knee), line) / square, shin_lean)
    roll = _scaled(1.0 / np.sqrt(length * length - out * out + tiny), across)
    return LegSlopes(along, roll, shin_lean, thigh_lean, forward)


@law
def quantity_slopes(posture, slopes, tiny=0.0):
    """Gradients of `leg.quantities`, in their order."""
    hips = posture.hips
    first = (1.0 * (hips.order[0] == 0), 1.0 * (hips.order[0] == 1), 1.0 * (hips.order[0] == 2))
    pure = HipJoints(hips.order, first, hips.skew)  # whose angles the posture has
    by_roll, by_thigh = _hip_shares(posture, pure, slopes, tiny)
    return (
        slopes.length,
        _scaled(-1.0, slopes.shin),
        slopes.roll,
        _sum(by_roll[1], slopes.roll, by_thigh[1], slopes.thigh),
        _sum(by_roll[0], slopes.roll, by_thigh[0], slopes.thigh),
        _sum(by_roll[2], slopes.roll, by_thigh[2], slopes.thigh),
        _sum(1.0, slopes.shin, -1.0, slopes.thigh),
    )


@law
def _hip_shares(posture, joints, slopes, tiny):
    """Rates of hip roll, pitch and yaw per rate of the ankle's roll, and per rate of the thigh's lean."""
    order, heading = joints.order, posture.heading
    first, middle, last = hip_axes(posture.thigh_axes, joints, tiny)
    skew = dot(first, last)
    first, middle, last = from_base(first, heading), from_base(middle, heading), from_base(last, heading)
    return (
        _shared(order, first, middle, last, skew, _scaled(-1.0, slopes.forward), tiny),
        _shared(order, first, middle, last, skew, posture.pitch_axis, tiny),
    )


@law
def _shared(order, first, middle, last, skew, spin, tiny):
    """Rates of hip roll, pitch and yaw that give the thigh an angular velocity; `skew` is first . last."""
    a, b, scale = dot(first, spin), dot(last, spin), 1.0 / (1.0 - skew * skew + tiny)
    return by_axis(order, (scale * (a - skew * b), dot(middle, spin), scale * (b - skew * a)))


@law
def torque_slopes(posture, slopes, lines, sole, force, moment):
    """Gradients of `leg.joint_torques`, in the order of `TORQUE_ROLES`, of a sole's force and moment.

    The lines are `leg.joint_lines` of the posture; the other arguments those of `joint_torques`.
    """
    order, across, hip, knee = posture.hips.order, posture.pitch_axis, posture.hip_point, posture.knee_point
    at_hip, at_knee = moment_about(hip, sole, force, moment), moment_about(knee, sole, force, moment)
    at_ankle = moment_about(posture.ankle_point, sole, force, moment)
    tipped, moved = cross(across, slopes.forward), between(posture.ankle_point, knee)
    pushed = cross(force, across)
    knee_roll = dot(tipped, at_knee) + dot(cross(slopes.forward, moved), pushed)
    axes = lines[1][0], lines[2][0], lines[3][0]
    first, middle, last = picked_vector(order[0], axes), picked_vector(order[1], axes), picked_vector(order[2], axes)
    skew, turning = dot(first, last), cross(first, middle)
    scale = dot(turning, at_hip) / (1.0 - skew * skew)
    spin = _sum(scale, first, -scale * skew, last)
    carried = cross(last, at_hip)
    middle_slope = _sum(-dot(spin, slopes.forward), slopes.roll, dot(spin, across), slopes.thigh)
    last_slope = _sum(-dot(carried, slopes.forward), slopes.roll, dot(carried, across), slopes.thigh)
    none = _scaled(0.0, across)
    by_roll, by_pitch, by_yaw = vectors_by_axis(order, (none, middle_slope, last_slope))
    return (
        _sum(knee_roll, slopes.roll, -dot(cross(across, moved), pushed), slopes.shin),
        _sum(1.0, by_roll, -1.0, cross(force, axes[0])),
        _sum(1.0, by_pitch, -1.0, cross(force, axes[1])),
        _sum(1.0, by_yaw, -1.0, cross(force, axes[2])),
        _scaled(dot(tipped, at_ankle), slopes.roll),
        none,
    )


@law
def _scaled(factor, a):
    return factor * a[0], factor * a[1], factor * a[2]


@law
def _sum(p, a, q, b):
    """The vector p a + q b."""
    return p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2]
