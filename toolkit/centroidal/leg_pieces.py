"""What a leg can do as CasADi pieces: the expressions of `toolkit.contacts.reach` and `toolkit.centroidal.body`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import casadi as ca

from toolkit.centroidal.blocks import Parameters, Piece

WRENCH = 6


@dataclass(frozen=True)
class Posture:
    """The leg of `toolkit.contacts.reach.LegPosture` as expressions."""

    length: ca.SX
    hip_roll: ca.SX
    hip_pitch: ca.SX
    ankle_pitch: ca.SX
    ankle_roll: ca.SX
    hip: ca.SX
    knee: ca.SX
    ankle: ca.SX
    pitch_axis: ca.SX


def displacement(rotation: ca.SX, offset: ca.SX) -> ca.SX:
    """(3,) displacement in the world of a contact that moves by `offset` (2 or none) along its own axes."""
    return rotation[:, :2] @ offset if offset.numel() else ca.SX.zeros(3)


def stretched(multiplier: ca.SX, reach: ca.SX, length: ca.SX, v: ca.SX) -> ca.SX:
    """Curvature of an upper bound on a length, which is convex: the Hessian of |reach| wherever the bound is active.

    Without it, the solvers' steps along a bow that a leg's length allows would swing ever farther around the solution.

    Args:
        multiplier: of the row `upper - length`, not positive where it is active.
        reach: (3,) linear in `v`.
        length: of `reach`.
        v: (nv,) variables.
    """
    across = ca.jacobian(reach, v) - (reach / length) @ ca.jacobian(length, v)
    return ca.fmax(-multiplier, 0) / length * (across.T @ across)


def _posture(com: ca.SX, p: Parameters, offset: ca.SX) -> tuple[Posture, ca.SX]:
    """Posture of a leg, and world_from_sole.

    Parameters: hip relative to the CoM in the world (3), ankle in the world (3), R of the sole (9, row-major), thigh,
    shin. The sole is displaced by `offset` (2 or none) along its own axes.
    """
    hip_offset, ankle, rotation = p(3), p(3), ca.reshape(p(9), 3, 3).T
    thigh, shin = p(), p()
    ankle = ankle + displacement(rotation, offset)
    hip = com + hip_offset
    h = rotation.T @ (hip - ankle)
    square = ca.sumsqr(h) + 1e-12
    length = ca.sqrt(square)
    roll = ca.atan2(h[1], h[2])
    cosine = (square + shin**2 - thigh**2) / (2 * shin * length)
    lean = ca.atan2(h[0], ca.sqrt(h[1] ** 2 + h[2] ** 2 + 1e-12)) + ca.acos(ca.fmin(ca.fmax(cosine, -0.9999), 0.9999))
    axis = rotation @ ca.vertcat(0, ca.cos(roll), -ca.sin(roll))
    up = ca.vertcat(ca.sin(lean), ca.sin(roll) * ca.cos(lean), ca.cos(roll) * ca.cos(lean))
    knee = ankle + shin * (rotation @ up)
    thigh_z = hip - knee
    thigh_x = ca.cross(axis, thigh_z)
    posture = Posture(
        length=length,
        hip_roll=ca.asin(ca.fmin(ca.fmax(axis[2], -0.9999), 0.9999)),
        hip_pitch=ca.atan2(-thigh_x[2], thigh_z[2]),
        ankle_pitch=-lean,
        ankle_roll=roll,
        hip=hip,
        knee=knee,
        ankle=ankle,
        pitch_axis=axis,
    )
    return posture, rotation


def leg(moving: bool) -> Piece:
    """Joint ranges of a leg.

    Parameters: of the posture; (2) length, then (2) lower and upper of ankle pitch, ankle roll, hip pitch, hip roll;
    wanted margins of length, ankle, hip.
    """
    p = Parameters()
    com, slack, offset = ca.SX.sym("c", 3), ca.SX.sym("s"), ca.SX.sym("d", 2 * moving)
    posture, _ = _posture(com, p, offset)
    values = [posture.length, posture.ankle_pitch, posture.ankle_roll, posture.hip_pitch, posture.hip_roll]
    ranges = [p(2) for _ in values]
    length, ankle, hip = p(), p(), p()
    rows = []
    for value, limits, margin, scale in zip(
        values, ranges, (length, ankle, ankle, hip, hip), (5, 1, 1, 1, 1), strict=True
    ):
        kept = margin * (1 - slack)
        rows += [scale * (value - limits[0] - kept), scale * (limits[1] - value - kept)]
    v = ca.vertcat(com, slack, offset)
    curvature = partial(stretched, reach=posture.hip - posture.ankle, length=posture.length, v=v)
    return Piece("leg", v, p.vector, rows=ca.vertcat(*rows), curvature=lambda m: 5 * curvature(m[1]))


def torque(moving: bool) -> Piece:
    """Joint torques of a stance leg in the middle of a step.

    Parameters: half of dt; of the posture; sole position (3); (5) torque limits of knee, hip pitch, hip roll, ankle
    pitch, ankle roll in weights times 1 m; wanted part of the limits.
    """
    p = Parameters()
    com, velocity, wrench = ca.SX.sym("c", 3), ca.SX.sym("v", 3), ca.SX.sym("w", WRENCH)
    slack, half_dt = ca.SX.sym("s"), p()
    middle, offset = ca.SX.sym("middle", 3), ca.SX.sym("d", 2 * moving)
    posture, rotation = _posture(middle, p, offset)
    sole, limits, wanted = p(3) + displacement(rotation, offset), p(5), p()
    force, moment = rotation @ wrench[:3], rotation @ wrench[3:]

    def about(point: ca.SX, axis: ca.SX) -> ca.SX:
        return ca.dot(axis, ca.cross(sole - point, force) + moment)

    w = posture.pitch_axis
    roll_axis = ca.vertcat(w[1], -w[0], 0) / ca.sqrt(w[0] ** 2 + w[1] ** 2 + 1e-12)
    torques = ca.vertcat(
        about(posture.knee, w),
        about(posture.hip, w),
        about(posture.hip, roll_axis),
        about(posture.ankle, w),
        about(posture.ankle, rotation[:, 0]),
    )
    ratio = torques / limits
    reduced = ca.vertcat(middle, wrench, offset)
    slope = ca.jacobian(ratio, reduced)
    by_offset = slope[:, 9:]
    slope = ca.horzcat(slope[:, :3], half_dt * slope[:, :3], slope[:, 3:9])  # the middle is com + dt / 2 velocity
    part, gain = wanted + (1 - wanted) * slack, ca.repmat(1 - wanted, 5, 1)
    rows = ca.vertcat(part - ratio, part + ratio)
    jacobian = ca.vertcat(ca.horzcat(-slope, gain, -by_offset), ca.horzcat(slope, gain, by_offset))
    rows, jacobian = ca.substitute([rows, jacobian], [middle], [com + half_dt * velocity])
    return Piece("torque", ca.vertcat(com, velocity, wrench, slack, offset), p.vector, rows=rows, jacobian=jacobian)
