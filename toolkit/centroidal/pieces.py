"""The pieces of the whole-sequence problem, independent of robot, contacts and timing.

Scaled variables of a stage: x = [CoM r (m), velocity v (m/s), kappa = k / m (m^2/s), acceleration a of the step before
(m/s^2)] and u = [per contact: force and moment at the patch centre, in the contact frame, in weights (and weights
times 1 m), slacks of friction and CoP (weights); per step: excess (weights) and the body's slack]. The angular momentum
is about the CoM, and its exact integral under constant wrenches is a sum over the contacts:

    kappa+ = kappa + dt g sum_i [ (p_i - r - dt v / 2 - dt^2 g_vec / 6) x f_i + tau_i ]

Slacks take back the wanted margins, at a price and down to the physical limit; what goes beyond it, the excess of a
step and a body's slack above 1, costs much more. So the program always has a solution, and says where it had to cheat.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from toolkit.centroidal.blocks import Parameters, Piece
from toolkit.centroidal.leg_pieces import WRENCH, leg, torque
from toolkit.centroidal.problem import GRAVITY

STATE = 12
CONTACT = WRENCH + 2
SLACKS = 2
EVEN = 0.1  # part of a slack's price on its square: shared out evenly where the linear price is indifferent
G = float(-GRAVITY[2])


@dataclass(frozen=True)
class Pieces:
    """All pieces.

    Attributes:
        stage: number of contacts -> dynamics and momentum objective of a step.
        contact: cone, patch and yaw moment of a contact in a step, and its objective.
        leg: joint ranges of a stance leg at a knot.
        torque: joint torques of a stance leg in the middle of a step.
        distance: hip or shoulder to tip, between two bounds, at a knot.
        height: CoM above the lowest foot at a knot.
        slack: price of the excess and the body's slack of a step.
        initial: the given state.
        final: rest, box and centring at the end.
    """

    stage: dict[int, Piece]
    contact: Piece
    leg: Piece
    torque: Piece
    distance: Piece
    height: Piece
    slack: Piece
    initial: Piece
    final: Piece


@lru_cache(maxsize=1)
def pieces() -> Pieces:
    """The pieces; building them takes tens of milliseconds once."""
    return Pieces(
        stage={n: _stage(n) for n in range(1, 5)},
        contact=_contact(),
        leg=leg(),
        torque=torque(),
        distance=_distance(),
        height=_height(),
        slack=_slack(),
        initial=_initial(),
        final=_final(),
    )


def _stage(contacts: int) -> Piece:
    """Dynamics and momentum objective of a step with so many contacts.

    Parameters: dt, per contact R (9, row-major) and p (3); square roots of the weights of v, a, kappa, kappa rate,
    acceleration change, height; wanted height.
    """
    p = Parameters()
    x, after = ca.SX.sym("x", STATE), ca.SX.sym("after", STATE)
    wrenches = ca.SX.sym("w", WRENCH * contacts)
    dt = p()
    r, v, kappa, before = ca.vertsplit(x, 3)
    gravity = ca.DM(GRAVITY)
    total, moment = ca.SX.zeros(3), ca.SX.zeros(3)
    middle = r + dt / 2 * v + dt**2 / 6 * gravity
    for i in range(contacts):
        rotation, position = ca.reshape(p(9), 3, 3).T, p(3)
        force = rotation @ wrenches[WRENCH * i : WRENCH * i + 3]
        total += force
        moment += ca.cross(position - middle, force) + rotation @ wrenches[WRENCH * i + 3 : WRENCH * i + 6]
    acceleration = G * total + gravity
    following = ca.vertcat(
        r + dt * v + dt**2 / 2 * acceleration, v + dt * acceleration, kappa + dt * G * moment, acceleration
    )
    weights, height = p(6), p()
    rho = ca.vertcat(
        weights[0] * after[3:6],
        weights[1] * after[9:12],
        weights[2] * after[6:9],
        weights[3] * G * moment,
        weights[4] * (acceleration - before),
        weights[5] * (after[2] - height),
    )
    return Piece(f"stage{contacts}", ca.vertcat(x, wrenches, after), p.vector, rho=rho, rows=after - following)


def _contact() -> Piece:
    """Friction cone, patch and yaw moment (Caron et al., ICRA 2015) of a contact, and its objective.

    Variables: wrench, slacks of friction and CoP, excess. Slacks in weights: at the normal force the margin is gone.
    Parameters: mu, (2) half extents; wanted friction factor, (2) CoP margin in m, yaw factor; square roots of the
    weights of force, lateral force, torque (in weights), CoP, CoP times load, and distance from a wanted normal force;
    that force; price of a slack.
    """
    p = Parameters()
    wrench, slack, excess = ca.SX.sym("w", WRENCH), ca.SX.sym("s", 2), ca.SX.sym("e")
    mu, half, wanted, cop_margin, yaw_factor, weights, load, price = p(), p(2), p(), p(2), p(), p(6), p(), p()
    fx, fy, fz, tx, ty, tz = ca.vertsplit(wrench)
    held = mu * (wanted * fz + (1 - wanted) * slack[0] + excess) + 1e-7
    cone = held - (fx**2 + fy**2) / held  # smooth at rest, unlike the square root
    x, y = ca.vertsplit((half - cop_margin) * fz + cop_margin * slack[1] + half * excess)
    rows = [cone, x - ty, x + ty, y - tx, y + tx, fz - slack[0], fz - slack[1]]
    # Yaw: the wanted part of the range under the margins, and the whole physical range: a moment of the wrong sign can
    # be within a part of the range but not in the range itself.
    most = 2 * mu * (half[0] + half[1])
    ranges = [
        (yaw_factor, mu * wanted, half - cop_margin, most * (slack[0] + slack[1] + excess)),
        (1, mu, half, most * excess),
    ]
    for factor, friction, (hx, hy), more in ((a, b, ca.vertsplit(c), d) for a, b, c, d in ranges):
        room = friction * (hx + hy) * fz
        for s in (-1, 1):
            for q in (-1, 1):
                low = room + s * (hy * fx - friction * tx) + q * (hx * fy - friction * ty)
                high = room + s * (hy * fx + friction * tx) + q * (hx * fy + friction * ty)
                rows += [factor * low + more + tz, factor * high + more - tz]
    v = ca.vertcat(wrench, slack, excess)
    tilt = ca.jacobian(wrench[:2], v) - ca.vertcat(fx, fy) / held @ ca.jacobian(held, v)

    def curvature(multiplier: ca.SX) -> ca.SX:
        return (20 * ca.fmax(-multiplier[0], 0) / held) * (tilt.T @ tilt)

    pressed = fz + 0.01  # an unloaded contact has no CoP: keeps the objective smooth there
    cop_x, cop_y = -ty / pressed, tx / pressed
    rho = ca.vertcat(
        weights[0] * wrench[:3],
        weights[1] * wrench[:2],
        weights[2] * (tz - cop_x * fy + cop_y * fx),
        weights[3] * ca.vertcat(cop_x, cop_y) / (2 * half),
        weights[4] * ca.vertcat(-ty, tx) / (2 * half),
        weights[5] * (fz - load),
        ca.sqrt(EVEN * price) * slack,
    )
    linear = price * (slack[0] + slack[1])
    return Piece("contact", v, p.vector, rho=rho, linear=linear, rows=10 * ca.vertcat(*rows), curvature=curvature)


def _distance() -> Piece:
    """Distance from hip or shoulder to a tip.

    Parameters: root relative to the CoM in the world (3), tip (3), lower and upper bound, wanted margin.
    """
    p = Parameters()
    com, slack = ca.SX.sym("c", 3), ca.SX.sym("s")
    root, tip, lower, upper, margin = p(3), p(3), p(), p(), p()
    length = ca.sqrt(ca.sumsqr(com + root - tip) + 1e-12)
    kept = margin * (1 - slack)
    rows = ca.vertcat(5 * (length - lower - kept), 5 * (upper - length - kept))
    return Piece("distance", ca.vertcat(com, slack), p.vector, rows=rows)


def _height() -> Piece:
    """Least height of the CoM; parameters: that height in the world, wanted margin."""
    p = Parameters()
    z, slack, least, margin = ca.SX.sym("z"), ca.SX.sym("s"), p(), p()
    return Piece("height", ca.vertcat(z, slack), p.vector, rows=5 * (z - least - margin * (1 - slack)))


def _slack() -> Piece:
    """Price of the excess and of the body's slack of a step; parameters: both prices."""
    p = Parameters()
    slack, prices = ca.SX.sym("s", SLACKS), p(SLACKS)
    return Piece("slack", slack, p.vector, rho=ca.sqrt(EVEN * prices) * slack, linear=ca.dot(prices, slack))


def _initial() -> Piece:
    """Given state; parameters: the state (12), its acceleration is what the first step is compared with."""
    p = Parameters()
    x = ca.SX.sym("x", STATE)
    rows = x - p(STATE)
    return Piece("initial", x, p.vector, rows=rows)


def _final() -> Piece:
    """Rest, box and centring; rows: the velocity (3), and the offset from the centre in the yaw frame (3).

    Parameters: centre (3), (2) cos and sin of the final yaw, square roots of the weights of centring, acceleration and
    angular momentum.
    """
    p = Parameters()
    x = ca.SX.sym("x", STATE)
    center, heading, weights = p(3), p(2), p(3)
    dx, dy, dz = ca.vertsplit(x[:3] - center)
    offset = ca.vertcat(heading[0] * dx + heading[1] * dy, -heading[1] * dx + heading[0] * dy, dz)
    rho = ca.vertcat(weights[0] * offset[:2], weights[1] * x[9:12], weights[2] * x[6:9])
    return Piece("final", x, p.vector, rho=rho, rows=ca.vertcat(x[3:6], offset))
