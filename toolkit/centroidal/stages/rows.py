"""The constraints of contacts, legs and arms with their derivatives, as blocks (see `blocks.Block`).

Every `fill_...` fills the rows and slopes of a block at the variables y (T, m), from the first to before the last of a
`span` of applications. It adds what they have of the objective, and of convex curvature, to gradients (T, m) and to
Hessians (k, m, m), where stage t has number t modulo k, and returns that part of the objective. The laws are those of
`toolkit.physics`.

The wanted margins may be taken back by slacks, at a price and down to the least margins. The excess of a step goes
beyond those and beyond the physical limit, and costs much more, as does a body's slack above 1. So the program always
has a solution, and the excess says where it is not physical.
"""

from __future__ import annotations

import numpy as np

from toolkit.compiled import compiled
from toolkit.physics.leg import (
    PLANNED,
    TORQUE_ROLES,
    LegPosture,
    between,
    hip_joints,
    joint_lines,
    posture_between,
    quantities,
    torque_about,
    turned,
)
from toolkit.physics.leg_slopes import leg_slopes, quantity_slopes, torque_slopes
from toolkit.physics.momentum import cross
from toolkit.physics.wrench import SIGNS, pressure_rows, yaw_row

SHARPNESS, STRETCH = 10.0, 5.0
"""Factors on the rows of contacts and of lengths, so that all rows have similar sizes."""
TINY = 1e-12  # m^2; keeps the derivatives of roots finite
EVEN = 0.1  # part of a slack's price that is on its square, so that slacks are shared evenly
UNLOADED = 0.01  # weights added to a normal force under a CoP: an unloaded contact has none
CONE, FIRST_YAW = 0, 7
CONTACT_ROWS = FIRST_YAW + 2 * len(SIGNS)
LEG_ROWS, TORQUE_ROWS, DISTANCE_ROWS, FINAL_ROWS = 2 * len(PLANNED), 2 * len(TORQUE_ROLES), 2, 6
MARGINS = tuple(dict.fromkeys(limit.margin for limit in PLANNED))
_QUANTITY = tuple(LegPosture._fields.index(limit.quantity) for limit in PLANNED)
_MARGIN = tuple(MARGINS.index(limit.margin) for limit in PLANNED)
_FACTOR = tuple(STRETCH if limit.quantity == "length" else 1.0 for limit in PLANNED)
_LENGTH = next(number for number, limit in enumerate(PLANNED) if limit.quantity == "length")

# Parameters of a contact.
_MU, _HALF, _WANTED, _COP, _YAW = 0, 1, 3, 4, 6
_LEAST, _LEAST_COP, _LEAST_YAW, _WEIGHTS, _LOAD, _PRICE = 7, 8, 10, 11, 17, 18
# Parameters of a leg's posture: hip from the CoM, ankle, rotation of the sole, thigh, shin, cosine and sine of the
# base's heading, numbers of the hip's joints.
_HIP, _ANKLE, _TURN, _LINKS, _HEADING, _JOINTS, POSTURE = 0, 3, 6, 15, 17, 19, 27
_LIMITS, _TORQUES = POSTURE + 3, len(TORQUE_ROLES)  # of torques, after those and the place of the sole


@compiled(reordered=True)
def prepare_contacts(block):
    """Fill the slopes of a contact's linear rows: all but the cone.

    Variables: wrench (6) in weights, slacks of friction and CoP, excess. Slacks are in weights: at the normal force
    the least margin is left. Parameters: mu, (2) half extents; wanted friction factor, (2) CoP margin in m, yaw factor,
    and the least of each; (6) square roots of the weights of force, lateral force, torque (in weights), CoP, CoP times
    load, and distance from a wanted normal force; that force; price of a slack.
    """
    for i in range(block.stage.shape[0]):
        p, slope = block.parameters[i], block.slope[i]
        slope[:] = 0.0
        row = 1
        for side in pressure_rows(1.0, 1.0):
            axis = 1 if side[3] != 0.0 else 0
            half, margin = p[_HALF + axis], p[_COP + axis]
            slope[row, 2] = half - margin
            slope[row, 7] = margin - p[_LEAST_COP + axis]
            slope[row, 8] = half
            slope[row, 3], slope[row, 4] = -side[3], -side[4]
            row += 1
        for k in range(2):
            slope[row, 2], slope[row, 6 + k] = 1.0, -1.0
            row += 1
        most = 2 * p[_MU] * (p[_HALF] + p[_HALF + 1])
        for least in range(2):
            if least == 0:
                turning, margin = p[_YAW] * p[_MU] * p[_WANTED], _COP
            else:
                turning, margin = p[_LEAST_YAW] * p[_MU] * p[_LEAST], _LEAST_COP
            x, y = p[_HALF] - p[margin], p[_HALF + 1] - p[margin + 1]
            for sign in SIGNS:
                entries = yaw_row(turning, x, y, sign[0], sign[1], sign[2])
                for k in range(6):
                    slope[row, k] = -entries[k]
                slope[row, 8] = most
                if least == 0:
                    slope[row, 6] = slope[row, 7] = most
                row += 1
        for a in range(CONTACT_ROWS):
            for k in range(9):
                slope[a, k] *= SHARPNESS


@compiled(reordered=True, allocates=True)
def fill_contacts(block, span, y, floor, hessian, gradient):
    """Friction cone, patch and yaw moment (Caron et al., ICRA 2015) of contacts, and their objective.

    A lateral force f may be as large as what friction can hold, h. The row is h - f^2 / h, which is concave where h is
    positive, and has a second branch where it is not. Before the linear rows hold, h may have any sign: below `floor`,
    in weights, the row is h - f^2 / floor.
    """
    v, d_held, row = np.empty(9), np.zeros(9), np.empty(9)
    local, force = np.empty((9, 9)), np.empty(9)
    total = 0.0
    for i in range(span[0], span[1]):
        p, slope, index = block.parameters[i], block.slope[i], block.variables[i]
        for k in range(9):
            v[k] = y[block.stage[i], index[k]]
        for a in range(1, CONTACT_ROWS):
            value = 0.0
            for k in range(9):
                value += slope[a, k] * v[k]
            block.value[i, a] = value
        fx, fy, fz = v[0], v[1], v[2]
        mu, wanted, least = p[_MU], p[_WANTED], p[_LEAST]
        held = mu * (wanted * fz + (least - wanted) * v[6] + v[8]) + 1e-7
        d_held[2], d_held[6], d_held[8] = mu * wanted, mu * (least - wanted), mu
        over, moving = (held, 1.0) if held > floor else (floor, 0.0)
        tilt_x, tilt_y = fx / over, fy / over
        tilt = moving * (tilt_x * tilt_x + tilt_y * tilt_y)
        block.value[i, CONE] = SHARPNESS * (held - fx * tilt_x - fy * tilt_y)  # smooth at rest, unlike the square root
        for k in range(9):
            slope[CONE, k] = SHARPNESS * (1.0 + tilt) * d_held[k]
        slope[CONE, 0] = -2 * SHARPNESS * tilt_x
        slope[CONE, 1] = -2 * SHARPNESS * tilt_y

        local[:] = 0.0
        force[:] = 0.0
        bent = 2 * SHARPNESS * block.multiplier[i, CONE] / over
        for axis in range(2):
            for k in range(9):
                row[k] = -moving * v[axis] / over * d_held[k]
            row[axis] += 1.0
            add_local(0.5 * bent, 0.0, row, local, force)
        total += contact_objective(p, v, row, local, force)
        scatter(local, force, index, hessian[block.stage[i] % len(hessian)], gradient[block.stage[i]])
    return total


@compiled(reordered=True)
def contact_objective(p, v, row, local, force):
    """Add the objective of one contact to a local Hessian (9, 9) and gradient (9,); returns it."""
    w, price = p[_WEIGHTS:], p[_PRICE]
    fx, fy, fz, tx, ty, tz = v[0], v[1], v[2], v[3], v[4], v[5]
    hx, hy = 2 * p[_HALF], 2 * p[_HALF + 1]
    total = 0.0
    for k in range(3):
        stiffness = w[0] * w[0]
        if k < 2:
            stiffness += w[1] * w[1]
        total += add_single(stiffness, v[k], 0.0, k, local, force)
    total += add_single((w[4] / hy) ** 2, tx, 0.0, 3, local, force)
    total += add_single((w[4] / hx) ** 2, ty, 0.0, 4, local, force)
    total += add_single(w[5] * w[5], fz, p[_LOAD], 2, local, force)
    for k in range(6, 8):
        total += add_single(EVEN * price, v[k], 0.0, k, local, force) + price * v[k]
        force[k] += price
    pressed = fz + UNLOADED
    x, y = -ty / pressed, tx / pressed
    leverage = y * fx - x * fy
    row[:] = 0.0
    row[0], row[1], row[2], row[3], row[4], row[5] = y, -x, -leverage / pressed, fx / pressed, fy / pressed, 1.0
    spin = tz + leverage
    total += add_local(w[2] * w[2], spin, row, local, force)
    row[:] = 0.0
    row[2], row[4] = -x / pressed, -1.0 / pressed
    total += add_local((w[3] / hx) ** 2, x, row, local, force)
    row[4] = 0.0
    row[2], row[3] = -y / pressed, 1.0 / pressed
    total += add_local((w[3] / hy) ** 2, y, row, local, force)
    # The square of a ratio t / f bends three times as much along f as Gauss-Newton knows: where a contact is lightly
    # loaded, steps would swing ever farther around the solution.
    ratios = w[3] * w[3] * ((x / hx) ** 2 + (y / hy) ** 2)
    local[2, 2] += 4 * (ratios + max(w[2] * w[2] * spin * leverage, 0.0)) / (pressed * pressed)
    return total


@compiled(reordered=True)
def add_single(weight, value, wanted, k, local, force):
    """Add weight * (v[k] - wanted)^2; returns it."""
    off = value - wanted
    local[k, k] += 2 * weight
    force[k] += 2 * weight * off
    return weight * off * off


@compiled(reordered=True)
def add_local(weight, value, row, local, force):
    """Add weight * value^2 with the derivative `row` to a local Hessian and gradient; returns it."""
    for b in range(row.shape[0]):
        if row[b] != 0.0:
            factor = 2 * weight * row[b]
            force[b] += factor * value
            for c in range(row.shape[0]):
                local[b, c] += factor * row[c]
    return weight * value * value


@compiled(reordered=True)
def scatter(local, force, index, hessian, gradient):
    """Add a local Hessian and gradient to those of a stage."""
    for b in range(index.shape[0]):
        gradient[index[b]] += force[b]
        for c in range(index.shape[0]):
            hessian[index[b], index[c]] += local[b, c]


@compiled(reordered=True)
def posture(p, turn, hip):
    """Posture of a leg with its hip there, and its slopes."""
    thigh, shin = p[_LINKS], p[_LINKS + 1]
    ankle, heading = (p[_ANKLE], p[_ANKLE + 1], p[_ANKLE + 2]), (p[_HEADING], p[_HEADING + 1])
    found = posture_between(hip, ankle, turn, heading, thigh, shin, hip_joints(p, _JOINTS), TINY)
    return found, leg_slopes(found, turn, thigh, shin, TINY)


@compiled(reordered=True)
def hip_of(p, turn, y, t, com, offset, out):
    """Fill `out` (3,) with a hip, given the CoM, less the sole's displacement: only the difference counts."""
    for a in range(3):
        out[a] = com[a] + p[_HIP + a]
        if offset.shape[0] == 2:
            out[a] -= turn[a, 0] * y[t, offset[0]] + turn[a, 1] * y[t, offset[1]]


@compiled(reordered=True)
def limited(values):
    """The limited quantities of a posture, in the order of `PLANNED`."""
    return (
        values[_QUANTITY[0]],
        values[_QUANTITY[1]],
        values[_QUANTITY[2]],
        values[_QUANTITY[3]],
        values[_QUANTITY[4]],
    )


@compiled(reordered=True, allocates=True)
def fill_legs(block, span, y, hessian, gradient):
    """Limits of stance legs at knots.

    Variables: CoM (3), slack of the body, displacement of the sole (2 or none). Parameters: the posture's, lower and
    upper end of each limit, wanted margins (`MARGINS`).
    """
    hip, row = np.empty(3), np.zeros(block.variables.shape[1])
    local, force = np.empty((row.shape[0], row.shape[0])), np.zeros(row.shape[0])
    for i in range(span[0], span[1]):
        p, t, index = block.parameters[i], block.stage[i], block.variables[i]
        turn, offset, full = p[_TURN : _TURN + 9].reshape(3, 3), index[4:], hessian[t % len(hessian)]
        hip_of(p, turn, y, t, y[t, :3], offset, hip)
        (here, slopes), kept = posture(p, turn, hip), 1.0 - y[t, index[3]]
        found, moved = limited(quantities(here)), limited(quantity_slopes(here, slopes, TINY))
        for q in range(len(PLANNED)):
            margin, factor = p[POSTURE + 2 * len(PLANNED) + _MARGIN[q]], _FACTOR[q]
            block.value[i, 2 * q] = factor * (found[q] - p[POSTURE + 2 * q] - margin * kept)
            block.value[i, 2 * q + 1] = factor * (p[POSTURE + 2 * q + 1] - found[q] - margin * kept)
            for side in range(2):
                sign = factor if side == 0 else -factor
                out = block.slope[i, 2 * q + side]
                for a in range(3):
                    out[a] = sign * moved[q][a]
                out[3] = factor * margin
                for k in range(offset.shape[0]):
                    along = moved[q][0] * turn[0, k] + moved[q][1] * turn[1, k] + moved[q][2] * turn[2, k]
                    out[4 + k] = -sign * along
        bend_length(block, i, 2 * _LENGTH + 1, found[_LENGTH], row, local, force, full, gradient[t])
    return 0.0


@compiled(reordered=True)
def bend_length(block, i, at, length, row, local, force, hessian, gradient):
    """Add the curvature of an upper bound on a length |reach|, row `at`, which is convex.

    The Hessian of the length is (D'D - d'd) / length, with d the length's derivative and D that of reach, of which the
    first three variables are the CoM's. Without it, steps along the sphere would oscillate around the solution.
    """
    stiffness = STRETCH * block.multiplier[i, at] / length
    slope, index, k = block.slope[i, at], block.variables[i], row.shape[0]
    local[:] = 0.0
    for a in range(3):
        gradient_of_reach(block, i, a, row)
        add_local(0.5 * stiffness, 0.0, row, local, force)
    for b in range(k):
        row[b] = slope[b] / STRETCH
    row[3 if k < 7 else 6] = 0.0  # the body's slack
    add_local(-0.5 * stiffness, 0.0, row, local, force)
    force[:] = 0.0
    scatter(local, force, index, hessian, gradient)


@compiled(reordered=True)
def gradient_of_reach(block, i, a, row):
    """Fill the derivative of component a of the vector from a tip to a root."""
    p, k = block.parameters[i], row.shape[0]
    row[:] = 0.0
    row[a] = 1.0
    if k < 7:  # a leg: CoM, slack, displacement of the sole
        for b in range(4, k):
            row[b] = -p[_TURN + 3 * a + b - 4]
    else:  # a distance: CoM, velocity, slack, displacements
        row[3 + a] = p[0]
        for b in range(7, k):
            row[b] = -p[10 + 4 * a + b - 7]


@compiled(reordered=True, allocates=True)
def fill_distances(block, span, y, hessian, gradient):
    """Bounds on the distance from a hip or shoulder to a tip, some time after a knot.

    Variables: CoM (3), velocity (3), slack of the body, displacements of the two ends of a swing (4 or none).
    Parameters: s from the knot, root from the CoM (3), tip (3), lower and upper bound, wanted margin; where contacts
    move, how the tip follows the displacements (3 x 4, row-major).
    """
    reach, row = np.empty(3), np.zeros(block.variables.shape[1])
    local, force = np.empty((row.shape[0], row.shape[0])), np.zeros(row.shape[0])
    for i in range(span[0], span[1]):
        p, t, index = block.parameters[i], block.stage[i], block.variables[i]
        square = TINY
        for a in range(3):
            reach[a] = y[t, a] + p[0] * y[t, 3 + a] + p[1 + a] - p[4 + a]
            for k in range(7, index.shape[0]):
                reach[a] -= p[10 + 4 * a + k - 7] * y[t, index[k]]
            square += reach[a] * reach[a]
        length, kept = np.sqrt(square), p[9] * (1.0 - y[t, index[6]])
        block.value[i, 0] = STRETCH * (length - p[7] - kept)
        block.value[i, 1] = STRETCH * (p[8] - length - kept)
        lower, upper = block.slope[i, 0], block.slope[i, 1]
        lower[:] = 0.0
        for a in range(3):
            gradient_of_reach(block, i, a, row)
            for k in range(row.shape[0]):
                lower[k] += STRETCH * reach[a] / length * row[k]
        for k in range(row.shape[0]):
            upper[k] = -lower[k]
        lower[6] = upper[6] = STRETCH * p[9]
        bend_length(block, i, 1, length, row, local, force, hessian[t % len(hessian)], gradient[t])
    return 0.0


@compiled(reordered=True, allocates=True)
def fill_torques(block, span, y):
    """Joint torques of stance legs in the middle of steps.

    Variables: CoM (3), velocity (3), wrench (6), slack of the body, displacement of the sole (2 or none). Parameters:
    half of dt; the posture's; sole (3); limits in the order of `TORQUE_ROLES` in weights times 1 m; the parts of
    the limits that are wanted, and allowed, at most.
    """
    slopes, here, hip, com = np.empty((_TORQUES, 9)), np.empty(_TORQUES), np.empty(3), np.empty(3)
    for i in range(span[0], span[1]):
        p, half, t, index = block.parameters[i, 1:], block.parameters[i, 0], block.stage[i], block.variables[i]
        turn, offset, wrench = p[_TURN : _TURN + 9].reshape(3, 3), index[13:], y[t, index[6] :]
        sole, limits = p[POSTURE:_LIMITS], p[_LIMITS : _LIMITS + _TORQUES]
        wanted, more = p[_LIMITS + _TORQUES], p[_LIMITS + _TORQUES + 1] - p[_LIMITS + _TORQUES]
        for a in range(3):
            com[a] = y[t, a] + half * y[t, 3 + a]
        hip_of(p, turn, y, t, com, offset, hip)
        force, moment = turned(turn, wrench), turned(turn, wrench[3:])
        posed, moved = posture(p, turn, hip)
        lines = joint_lines(posed, turn, TINY)
        by_hip = torque_slopes(posed, moved, lines, sole, force, moment)
        for q in range(_TORQUES):
            here[q] = torque_about(lines[q], sole, force, moment)
            axis, origin = lines[q]
            lever = cross(axis, between(origin, sole))
            for k in range(3):
                slopes[q, k] = by_hip[q][k] / limits[q]
                by_force = turn[0, k] * lever[0] + turn[1, k] * lever[1] + turn[2, k] * lever[2]
                by_moment = turn[0, k] * axis[0] + turn[1, k] * axis[1] + turn[2, k] * axis[2]
                slopes[q, 3 + k], slopes[q, 6 + k] = by_force / limits[q], by_moment / limits[q]
        part = wanted + more * y[t, index[12]]
        for q in range(_TORQUES):
            block.value[i, q] = part - here[q] / limits[q]
            block.value[i, _TORQUES + q] = part + here[q] / limits[q]
            for side in range(2):
                sign, out = (-1.0 if side == 0 else 1.0), block.slope[i, _TORQUES * side + q]
                for a in range(3):
                    out[a], out[3 + a] = sign * slopes[q, a], sign * half * slopes[q, a]
                for k in range(6):
                    out[6 + k] = sign * slopes[q, 3 + k]
                out[12] = more
                for k in range(offset.shape[0]):
                    along = slopes[q, 0] * turn[0, k] + slopes[q, 1] * turn[1, k] + slopes[q, 2] * turn[2, k]
                    out[13 + k] = -sign * along


@compiled(reordered=True)
def fill_heights(block, span, y):
    """Least height of the CoM.

    Variables: z, slack of the body, displacement of the lowest foot (2 or none). Parameters: that height in the world,
    wanted margin, how the height rises with the displacement (2 or none).
    """
    for i in range(span[0], span[1]):
        p, t, index = block.parameters[i], block.stage[i], block.variables[i]
        value = y[t, index[0]] - p[0] - p[1] * (1.0 - y[t, index[1]])
        block.slope[i, 0, 0], block.slope[i, 0, 1] = STRETCH, STRETCH * p[1]
        for k in range(2, index.shape[0]):
            value -= p[k] * y[t, index[k]]
            block.slope[i, 0, k] = -STRETCH * p[k]
        block.value[i, 0] = STRETCH * value


@compiled(reordered=True, allocates=True)
def fill_final(block, span, y, hessian, gradient):
    """Box of the last CoM along the axes of the last heading, and what the last state costs.

    Variables: the state (12), displacements of both feet (4 or none). Parameters: centre (3), half sizes (3), cosine
    and sine of the heading, weights of centring, acceleration and angular momentum; how the centre follows the
    displacements (3 x 4, row-major).
    """
    size = block.variables.shape[1]
    row, off = np.empty(size), np.empty(3)
    local, force = np.zeros((size, size)), np.zeros(size)
    total = 0.0
    for i in range(span[0], span[1]):
        p, t, index = block.parameters[i], block.stage[i], block.variables[i]
        c, s = p[6], p[7]
        for a in range(3):
            off[a] = y[t, a] - p[a]
            for k in range(12, size):
                off[a] -= p[11 + 4 * a + k - 12] * y[t, index[k]]
        for a in range(3):
            x, y_, z = (c, s, 0.0) if a == 0 else (-s, c, 0.0) if a == 1 else (0.0, 0.0, 1.0)
            row[:] = 0.0
            row[0], row[1], row[2] = x, y_, z
            for k in range(12, size):
                row[k] = -(x * p[11 + k - 12] + y_ * p[15 + k - 12] + z * p[19 + k - 12])
            value = x * off[0] + y_ * off[1] + z * off[2]
            block.value[i, 2 * a], block.value[i, 2 * a + 1] = p[3 + a] + value, p[3 + a] - value
            for k in range(size):
                block.slope[i, 2 * a, k], block.slope[i, 2 * a + 1, k] = row[k], -row[k]
            if a < 2:
                total += add_local(p[8], value, row, local, force)
            total += add_single(p[9], y[t, 9 + a], 0.0, 9 + a, local, force)
            total += add_single(p[10], y[t, 6 + a], 0.0, 6 + a, local, force)
        scatter(local, force, index, hessian[t % len(hessian)], gradient[t])
        local[:] = 0.0
        force[:] = 0.0
    return total


@compiled(reordered=True)
def fill_bounds(block, span, y):
    """Lower bounds of sums of variables; parameters: the variables' factors, and the bound."""
    count = block.variables.shape[1]
    for i in range(span[0], span[1]):
        p, value = block.parameters[i], -block.parameters[i, count]
        for k in range(count):
            value += p[k] * y[block.stage[i], block.variables[i, k]]
            block.slope[i, 0, k] = p[k]
        block.value[i, 0] = value


@compiled(reordered=True)
def add_prices(prices, span, y, hessian, gradient):
    """Add linear and quadratic prices of a span of single variables; returns their sum."""
    total = 0.0
    for i in range(span[0], span[1]):
        t, k = prices.stage[i], prices.variable[i]
        off = y[t, k] - prices.wanted[i]
        total += prices.linear[i] * y[t, k] + prices.quadratic[i] * off * off
        gradient[t, k] += prices.linear[i] + 2 * prices.quadratic[i] * off
        hessian[t % len(hessian), k, k] += 2 * prices.quadratic[i]
    return total


@compiled(reordered=True)
def add_squares(squares, span, y, hessian, gradient):
    """Add prices of the squares of a span of sums of variables; returns their sum."""
    total, count = 0.0, squares.variables.shape[1]
    for i in range(span[0], span[1]):
        t, index, factors = squares.stage[i], squares.variables[i], squares.factors[i]
        off = -squares.wanted[i]
        for k in range(count):
            off += factors[k] * y[t, index[k]]
        total += squares.weight[i] * off * off
        for b in range(count):
            pull = 2 * squares.weight[i] * factors[b]
            if pull != 0.0:
                gradient[t, index[b]] += pull * off
                for c in range(count):
                    hessian[t % len(hessian), index[b], index[c]] += pull * factors[c]
    return total
