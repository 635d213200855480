"""Limits of a leg as CasADi pieces: the laws of `toolkit.physics.leg` on symbols."""

from __future__ import annotations

from functools import partial

import casadi as ca

from toolkit.centroidal.stages.rows import MARGINS, TINY
from toolkit.centroidal.stages.steps import WRENCH
from toolkit.physics.leg import PLANNED, TORQUE_ROLES, LegPosture, hip_joints, joint_torques, posture_between
from validation.reference.assembly import Parameters, Piece


def displacement(rotation: ca.SX, offset: ca.SX) -> ca.SX:
    """(3,) displacement in the world of a contact that moves by `offset` (2 or none) along its own axes."""
    return rotation[:, :2] @ offset if offset.numel() else ca.SX.zeros(3)


def stretched(multiplier: ca.SX, reach: ca.SX, length: ca.SX, v: ca.SX) -> ca.SX:
    """Curvature of an upper bound on a length, which is convex: the Hessian of |reach| wherever the bound is active.

    Without it, the solver's steps along the sphere that a leg's length allows would oscillate around the solution. The
    multiplier is that of the row `upper - length`; `reach` (3,) is linear in the variables `v`.
    """
    across = ca.jacobian(reach, v) - (reach / length) @ ca.jacobian(length, v)
    return ca.fmax(-multiplier, 0) / length * (across.T @ across)


def _posture(com: ca.SX, p: Parameters, offset: ca.SX) -> tuple[LegPosture, ca.SX]:
    """Posture of a leg, and world_from_sole.

    Parameters: hip relative to the CoM in the world (3), ankle in the world (3), R of the sole (9, row-major), thigh,
    shin, cosine and sine of the base's heading, numbers of the hip's joints (8). The sole is displaced by `offset` (2
    or none) along its own axes.
    """
    if hasattr(ca.GlobalOptions, "setNumpyMode"):  # since CasADi 3.8: let NumPy's functions take symbols, silently
        ca.GlobalOptions.setNumpyMode(-1)
    hip_offset, ankle, rotation = p(3), p(3), ca.reshape(p(9), 3, 3).T
    hip, ankle = com + hip_offset, ankle + displacement(rotation, offset)
    thigh, shin, heading, joints = p(), p(), p(2), hip_joints(p(8), 0)
    return posture_between(hip, ankle, rotation, heading, thigh, shin, joints, TINY), rotation


def leg(moving: bool) -> Piece:
    """Limits of a leg that motions keep.

    Parameters: those of `_posture`; then those of `program.leg_limits`.
    """
    p = Parameters()
    com, slack, offset = ca.SX.sym("c", 3), ca.SX.sym("s"), ca.SX.sym("d", 2 * moving)
    posture, _ = _posture(com, p, offset)
    ranges = [p(2) for _ in PLANNED]
    margins = {name: p() for name in MARGINS}
    rows = []
    for limit, (lower, upper) in zip(PLANNED, map(ca.vertsplit, ranges), strict=True):
        value, kept = getattr(posture, limit.quantity), margins[limit.margin] * (1 - slack)
        scale = 5 if limit.quantity == "length" else 1
        rows += [scale * (value - lower - kept), scale * (upper - value - kept)]
    v = ca.vertcat(com, slack, offset)
    reach = ca.vertcat(*posture.hip_point) - ca.vertcat(*posture.ankle_point)
    longest = 2 * [limit.quantity for limit in PLANNED].index("length") + 1  # the row of the upper end
    curvature = partial(stretched, reach=reach, length=posture.length, v=v)
    return Piece("leg", v, p.vector, rows=ca.vertcat(*rows), curvature=lambda m: 5 * curvature(m[longest]))


def torque(moving: bool) -> Piece:
    """Joint torques of a stance leg in the middle of a step.

    Parameters: half of dt; those of `_posture`; sole position (3); torque limits in the order of `TORQUE_ROLES` in
    weights times 1 m; the parts of the limits that are wanted, and allowed, at most.
    """
    p = Parameters()
    com, velocity, wrench = ca.SX.sym("c", 3), ca.SX.sym("v", 3), ca.SX.sym("w", WRENCH)
    slack, half_dt = ca.SX.sym("s"), p()
    middle, offset = ca.SX.sym("middle", 3), ca.SX.sym("d", 2 * moving)
    posture, rotation = _posture(middle, p, offset)
    sole, limits, wanted = p(3) + displacement(rotation, offset), p(len(TORQUE_ROLES)), p()
    more = p() - wanted
    force, moment = rotation @ wrench[:3], rotation @ wrench[3:]
    ratio = ca.vertcat(*joint_torques(posture, sole, rotation, force, moment, TINY)) / limits
    reduced = ca.vertcat(middle, wrench, offset)
    slope = ca.jacobian(ratio, reduced)
    by_offset = slope[:, 9:]
    slope = ca.horzcat(slope[:, :3], half_dt * slope[:, :3], slope[:, 3:9])  # the middle is com + dt / 2 velocity
    part, gain = wanted + more * slack, ca.repmat(more, len(TORQUE_ROLES), 1)
    rows = ca.vertcat(part - ratio, part + ratio)
    jacobian = ca.vertcat(ca.horzcat(-slope, gain, -by_offset), ca.horzcat(slope, gain, by_offset))
    rows, jacobian = ca.substitute([rows, jacobian], [middle], [com + half_dt * velocity])
    return Piece("torque", ca.vertcat(com, velocity, wrench, slack, offset), p.vector, rows=rows, jacobian=jacobian)
