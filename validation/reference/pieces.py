"""The pieces of the centroidal problem in CasADi, independent of robot, contacts and timing.

They say a second time what `toolkit.centroidal.stages` evaluates, with derivatives that CasADi finds.

Scaled variables of a stage: x = [CoM r (m), velocity v (m/s), kappa = k / m (m^2/s), acceleration a of the step before
(m/s^2)] and u = [per contact: force and moment at the patch centre, in the contact frame, in weights (and weights
times 1 m), slacks of friction and CoP (weights); per step: excess (weights) and the body's slack]. The angular momentum
is about the CoM. The dynamics are those of `toolkit.physics.momentum`, the cones those of `toolkit.physics.wrench`.

Slacks take back the wanted margins, at a price and down to the least margins. The excess of a step goes beyond those
and beyond the physical limit, and costs much more, as does a body's slack above 1. So the program always has a
solution, and the excess says where it is not physical.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from toolkit.centroidal.problem import GRAVITY
from toolkit.centroidal.problem import STANDARD_GRAVITY as G
from toolkit.centroidal.stages.rows import EVEN
from toolkit.centroidal.stages.steps import STATE, WRENCH
from toolkit.physics.momentum import advanced, mean_com
from toolkit.physics.wrench import SIGNS, pressure, pressure_rows, yaw_row
from validation.reference.assembly import Parameters, Piece
from validation.reference.leg_pieces import displacement, leg, stretched, torque


@lru_cache(maxsize=4)
def pieces(moving: bool = False, pyramid: bool = False) -> dict[str, Piece]:
    """All pieces by their names; contacts are displaced by variables where `moving`. Building takes tens of ms once.

    With `pyramid`, friction is |fx| + |fy| <= sqrt(2) mu fz in place of the cone, which lies inside it.
    """
    made = [_stage(contacts, moving) for contacts in range(1, 5)]
    made += [_contact(pyramid), leg(moving), torque(moving), _distance(moving), _height(moving), _final(moving)]
    made += [_bound(1), _bound(3), _price(), _fixed(STATE + 6 * moving), _fixed(3)]
    made += [_carry()] * moving
    return {piece.name: piece for piece in made}


def _stage(contacts: int, moving: bool) -> Piece:
    """Dynamics and momentum objective of a step with so many contacts.

    Variables: state, wrenches, next state; where contacts move, the displacement (2) of each along its own axes.
    Parameters: dt; per contact R (9, row-major), p (3) and, where contacts move, whether this one does; square roots
    of the weights of v, a, kappa, kappa rate, acceleration change, height; wanted height and kappa rate (3).
    """
    p = Parameters()
    x, after = ca.SX.sym("x", STATE), ca.SX.sym("after", STATE)
    wrenches, offsets = ca.SX.sym("w", WRENCH * contacts), ca.SX.sym("d", 2 * contacts * moving)
    dt = p()
    r, v, kappa, before = ca.vertsplit(x, 3)
    total, moment = ca.SX.zeros(3), ca.SX.zeros(3)  # about the mean CoM: the rate of the angular momentum
    middle = ca.vertcat(*mean_com(dt, G, x))
    for i in range(contacts):
        rotation, position = ca.reshape(p(9), 3, 3).T, p(3)
        if moving:
            position += p() * displacement(rotation, offsets[2 * i : 2 * i + 2])
        force = rotation @ wrenches[WRENCH * i : WRENCH * i + 3]
        total += force
        moment += ca.cross(position - middle, force) + rotation @ wrenches[WRENCH * i + 3 : WRENCH * i + 6]
    acceleration = G * total + ca.DM(GRAVITY)
    moved = ca.vertcat(*advanced(dt, G, x, acceleration, G * moment)[:6])
    following = ca.vertcat(moved, kappa + dt * G * moment, acceleration)
    weights, height, turning = p(6), p(), p(3)
    rho = ca.vertcat(
        weights[0] * after[3:6],
        weights[1] * after[9:12],
        weights[2] * after[6:9],
        weights[3] * (G * moment - turning),
        weights[4] * (acceleration - before),
        weights[5] * (after[2] - height),
    )
    return Piece(f"stage{contacts}", ca.vertcat(x, wrenches, after, offsets), p.vector, rho=rho, rows=after - following)


def _contact(pyramid: bool) -> Piece:
    """Friction cone, patch and yaw moment (Caron et al., ICRA 2015) of a contact, and its objective.

    Variables: wrench, slacks of friction and CoP, excess. Slacks in weights: at the normal force the least
    margin is left.
    Parameters: mu, (2) half extents; wanted friction factor, (2) CoP margin in m, yaw factor, and the least of each;
    square roots of the weights of force, lateral force, torque (in weights), CoP, CoP times load, and distance from a
    wanted normal force; that force; price of a slack.
    """
    p = Parameters()
    wrench, slack, excess = ca.SX.sym("w", WRENCH), ca.SX.sym("s", 2), ca.SX.sym("e")
    mu, half, wanted, cop_margin, yaw_factor = p(), p(2), p(), p(2), p()
    least, least_cop, least_yaw, weights, load, price = p(), p(2), p(), p(6), p(), p()
    fx, fy, fz, tx, ty, tz = ca.vertsplit(wrench)
    held = mu * (wanted * fz + (least - wanted) * slack[0] + excess) + 1e-7
    cone = held - (fx**2 + fy**2) / held  # smooth at rest, unlike the square root
    loaded = ca.vertsplit((half - cop_margin) * fz + (cop_margin - least_cop) * slack[1] + half * excess)
    inside = [-ca.dot(ca.vertcat(*row), ca.vertcat(fx, fy, 1, tx, ty, tz)) for row in pressure_rows(*loaded)]
    sides = [ca.sqrt(2.0) * held - a * fx - b * fy for a in (1, -1) for b in (1, -1)]
    rows = [*(sides if pyramid else [cone]), *inside, fz - slack[0], fz - slack[1]]
    # Yaw: what the wanted margins leave, and the least ones, which no slack takes back.
    most = 2 * mu * (half[0] + half[1])
    ranges = [
        (yaw_factor * mu * wanted, half - cop_margin, most * (slack[0] + slack[1] + excess)),
        (least_yaw * mu * least, half - least_cop, most * excess),
    ]
    for turning, extents, more in ranges:
        for signs in SIGNS:
            rows.append(more - ca.dot(ca.vertcat(*yaw_row(turning, *ca.vertsplit(extents), *signs)), wrench))
    v = ca.vertcat(wrench, slack, excess)
    tilt = ca.jacobian(wrench[:2], v) - ca.vertcat(fx, fy) / held @ ca.jacobian(held, v)

    def curvature(multiplier: ca.SX) -> ca.SX:
        return (20 * ca.fmax(-multiplier[0], 0) / held) * (tilt.T @ tilt)

    pressed = fz + 0.01  # an unloaded contact has no CoP: keeps the objective smooth there
    cop = ca.vertcat(*pressure(wrench, pressed)[:2])
    off_centre = weights[3] * cop / (2 * half)
    leverage = cop[1] * fx - cop[0] * fy
    spin = weights[2] * (tz + leverage)
    rho = ca.vertcat(
        weights[0] * wrench[:3],
        weights[1] * wrench[:2],
        spin,
        off_centre,
        weights[4] * ca.vertcat(-ty, tx) / (2 * half),
        weights[5] * (fz - load),
        ca.sqrt(EVEN * price) * slack,
    )
    linear = price * (slack[0] + slack[1])
    # The square of a ratio t / f bends three times as much along f as Gauss-Newton knows: where a contact is lightly
    # loaded, steps would swing ever farther around the solution.
    bend = ca.SX(v.numel(), v.numel())
    bend[2, 2] = 4 * (ca.sumsqr(off_centre) + ca.fmax(spin * weights[2] * leverage, 0)) / pressed**2
    rows = 10 * ca.vertcat(*rows)
    return Piece(
        "contact", v, p.vector, rho=rho, linear=linear, rows=rows, bend=bend, curvature=None if pyramid else curvature
    )


def _distance(moving: bool) -> Piece:
    """Distance from hip or shoulder to a tip.

    Parameters: s from the knot, root relative to the CoM in the world (3), tip (3), lower and upper bound, wanted
    margin; where contacts move, how the tip follows the displacements of the two ends of a swing (3 x 4, row-major).
    """
    p = Parameters()
    com, velocity, slack = ca.SX.sym("c", 3), ca.SX.sym("v", 3), ca.SX.sym("s")
    offset, delay = ca.SX.sym("d", 4 * moving), p()
    root, tip, lower, upper, margin = p(3), p(3), p(), p(), p()
    if moving:
        tip += ca.reshape(p(12), 4, 3).T @ offset
    v, reach = ca.vertcat(com, velocity, slack, offset), com + delay * velocity + root - tip
    length = ca.sqrt(ca.sumsqr(reach) + 1e-12)
    kept = margin * (1 - slack)
    rows = ca.vertcat(5 * (length - lower - kept), 5 * (upper - length - kept))
    return Piece("distance", v, p.vector, rows=rows, curvature=lambda m: 5 * stretched(m[1], reach, length, v))


def _height(moving: bool) -> Piece:
    """Least height of the CoM.

    Parameters: that height in the world, wanted margin; how it rises with the lowest foot's displacement (2).
    """
    p = Parameters()
    z, slack, offset = ca.SX.sym("z"), ca.SX.sym("s"), ca.SX.sym("d", 2 * moving)
    least, margin = p(), p()
    if moving:
        least += ca.dot(p(2), offset)
    return Piece("height", ca.vertcat(z, slack, offset), p.vector, rows=5 * (z - least - margin * (1 - slack)))


def _price() -> Piece:
    """Price of a single variable; parameters: linear, quadratic, and the value from which the latter counts."""
    p = Parameters()
    value, linear, quadratic, wanted = ca.SX.sym("u"), p(), p(), p()
    return Piece("price", value, p.vector, rho=ca.sqrt(quadratic) * (value - wanted), linear=linear * value)


def _bound(size: int) -> Piece:
    """Lower bound of variables times factors; parameters: the factors and the bound."""
    p = Parameters()
    values, factors, bound = ca.SX.sym("u", size), p(size), p()
    return Piece("bound" if size == 1 else f"bound{size}", values, p.vector, rows=ca.dot(factors, values) - bound)


def _fixed(size: int) -> Piece:
    """Given values of variables; parameters: the values."""
    p = Parameters()
    value, given = ca.SX.sym("x", size), p(size)
    return Piece(f"fixed{size}", value, p.vector, rows=value - given)


def _final(moving: bool) -> Piece:
    """Box and centring of the last CoM.

    Parameters: centre (3), half sizes (3), (2) cos and sin of the final yaw, weights of centring, acceleration and
    angular momentum; where contacts move, how the centre follows both feet's displacements (3 x 4, row-major).
    """
    p = Parameters()
    x, moved = ca.SX.sym("x", STATE), ca.SX.sym("d", 4 * moving)
    center, half, heading, weights = p(3), p(3), p(2), p(3)
    if moving:
        center += ca.reshape(p(12), 4, 3).T @ moved
    dx, dy, dz = ca.vertsplit(x[:3] - center)
    offset = ca.vertcat(heading[0] * dx + heading[1] * dy, -heading[1] * dx + heading[0] * dy, dz)
    roots = ca.sqrt(weights)
    rho = ca.vertcat(roots[0] * offset[:2], roots[1] * x[9:12], roots[2] * x[6:9])
    pairs = [row for a in range(3) for row in (half[a] + offset[a], half[a] - offset[a])]
    return Piece("final", ca.vertcat(x, moved), p.vector, rho=rho, rows=ca.vertcat(*pairs))


def _carry() -> Piece:
    """Displacements of contacts at the next knot: rows b - a."""
    now, after = ca.SX.sym("a", 6), ca.SX.sym("b", 6)
    return Piece("carry", ca.vertcat(now, after), ca.SX(0, 1), rows=after - now)
