"""The constraints as one map s = c + A (u, x) into a product of half lines and second-order cones.

Half lines: 13 rows per contact, then the planes. Cones: the friction cone of each contact, then the balls.
"""

import math
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.kernels import cone
from toolkit.centroidal.kernels.setup import ROWS
from toolkit.compiled import compiled


class Point(NamedTuple):
    """A point of the product: slacks, multipliers or a change of them.

    Attributes:
        line: (13 C + P,); entries of the half lines.
        round: (C + K, 4); entries of the second-order cones.
    """

    line: np.ndarray
    round: np.ndarray


@compiled(reordered=True)
def room(lines, rounds):
    """A point with undefined entries."""
    return Point(np.empty(lines), np.empty((rounds, 4)))


@compiled(reordered=True)
def add(point, factor, change):
    """Point += factor change."""
    for i in range(point.line.shape[0]):
        point.line[i] += factor * change.line[i]
    for i in range(point.round.shape[0]):
        for a in range(4):
            point.round[i, a] += factor * change.round[i, a]


@compiled(reordered=True)
def copy(point, out):
    """Out = point."""
    for i in range(point.line.shape[0]):
        out.line[i] = point.line[i]
    for i in range(point.round.shape[0]):
        for a in range(4):
            out.round[i, a] = point.round[i, a]


@compiled(reordered=True)
def largest(point):
    """Largest absolute entry."""
    value = 0.0
    for i in range(point.line.shape[0]):
        value = max(value, abs(point.line[i]))
    for i in range(point.round.shape[0]):
        for a in range(4):
            value = max(value, abs(point.round[i, a]))
    return value


@compiled(reordered=True)
def dot(x, y):
    """Inner product of two points."""
    value = 0.0
    for i in range(x.line.shape[0]):
        value += x.line[i] * y.line[i]
    for i in range(x.round.shape[0]):
        for a in range(4):
            value += x.round[i, a] * y.round[i, a]
    return value


@compiled(reordered=True)
def invert(s, mu, z):
    """Z = mu s^-1: the multipliers that are central with the slacks s."""
    for i in range(s.line.shape[0]):
        z.line[i] = mu / s.line[i]
    for i in range(s.round.shape[0]):
        factor = mu / cone.norm_squared(s.round[i])
        z.round[i, 0] = factor * s.round[i, 0]
        for a in range(1, 4):
            z.round[i, a] = -factor * s.round[i, a]


@compiled(reordered=True)
def barrier(s):
    """Sum of log s of the half lines and of half the log s_0^2 - |s_1|^2 of the cones."""
    value = 0.0
    for i in range(s.line.shape[0]):
        value += math.log(max(s.line[i], 1e-300))
    for i in range(s.round.shape[0]):
        value += 0.5 * math.log(max(cone.norm_squared(s.round[i]), 1e-300))
    return value


@compiled(reordered=True)
def constants(data, out):
    """Fill a point with c."""
    line, round = out.line, out.round
    contacts = data.mu.shape[0]
    for j in range(contacts):
        for i in range(ROWS):
            line[j * ROWS + i] = data.offset[j, i]
        round[j] = 0.0
    for p in range(data.plane_offset.shape[0]):
        line[contacts * ROWS + p] = data.plane_offset[p]
    for b in range(data.ball_radius.shape[0]):
        round[contacts + b, 0] = data.ball_radius[b]
        for a in range(3):
            round[contacts + b, 1 + a] = -data.ball_center[b, a]


@compiled(reordered=True)
def apply(data, u, x, out):
    """Fill a point with A (u, x)."""
    line, round = out.line, out.round
    contacts = data.mu.shape[0]
    for j in range(contacts):
        for i in range(ROWS):
            value = 0.0
            for a in range(6):
                value += data.rows[j, i, a] * u[j, a]
            line[j * ROWS + i] = value
        round[j, 0], round[j, 1], round[j, 2], round[j, 3] = data.mu[j] * u[j, 2], u[j, 0], u[j, 1], 0.0
    for t in range(1, x.shape[0]):
        for p in range(data.plane_first[t], data.plane_first[t + 1]):
            normal = data.plane_normal[p]
            line[contacts * ROWS + p] = normal[0] * x[t, 0] + normal[1] * x[t, 1] + normal[2] * x[t, 2]
        for b in range(data.ball_first[t], data.ball_first[t + 1]):
            round[contacts + b, 0] = 0.0
            for a in range(3):
                round[contacts + b, 1 + a] = x[t, a]


@compiled(reordered=True)
def subtract_adjoint(data, point, contact_gradient, knot_gradient):
    """Subtract A' of a point from the gradients of contacts (C, 6) and knots (N + 1, 9)."""
    line, round = point.line, point.round
    contacts = data.mu.shape[0]
    for j in range(contacts):
        g = contact_gradient[j]
        for i in range(ROWS):
            value = line[j * ROWS + i]
            for a in range(6):
                g[a] -= data.rows[j, i, a] * value
        g[0] -= round[j, 1]
        g[1] -= round[j, 2]
        g[2] -= data.mu[j] * round[j, 0]
    for t in range(1, knot_gradient.shape[0]):
        g = knot_gradient[t]
        for p in range(data.plane_first[t], data.plane_first[t + 1]):
            for a in range(3):
                g[a] -= data.plane_normal[p, a] * line[contacts * ROWS + p]
        for b in range(data.ball_first[t], data.ball_first[t + 1]):
            for a in range(3):
                g[a] -= round[contacts + b, 1 + a]


@compiled(reordered=True)
def add_hessian(data, weight, w, eta, contact_hessian, knot_hessian):
    """Add A' W^-2 A: `weight` is W^-2 of the half lines, (w, eta) the scaling of the cones. Lower triangles only."""
    contacts = data.mu.shape[0]
    q = np.empty(3)
    for j in range(contacts):
        hessian = contact_hessian[j]
        for i in range(ROWS):
            row, factor = data.rows[j, i], weight[j * ROWS + i]
            for a in range(6):
                scaled = factor * row[a]
                for b in range(a + 1):
                    hessian[a, b] += scaled * row[b]
        mu, inverse = data.mu[j], 1.0 / (eta[j] * eta[j])
        q[0], q[1], q[2] = -w[j, 1], -w[j, 2], mu * w[j, 0]
        for a in range(3):
            for b in range(a + 1):
                hessian[a, b] += 2.0 * inverse * q[a] * q[b]
        hessian[0, 0] += inverse
        hessian[1, 1] += inverse
        hessian[2, 2] -= inverse * mu * mu
    for t in range(1, knot_hessian.shape[0]):
        hessian = knot_hessian[t]
        for p in range(data.plane_first[t], data.plane_first[t + 1]):
            normal, factor = data.plane_normal[p], weight[contacts * ROWS + p]
            for a in range(3):
                for b in range(3):
                    hessian[a, b] += factor * normal[a] * normal[b]
        for k in range(data.ball_first[t], data.ball_first[t + 1]):
            i = contacts + k
            inverse = 1.0 / (eta[i] * eta[i])
            for a in range(3):
                for b in range(3):
                    hessian[a, b] += 2.0 * inverse * w[i, 1 + a] * w[i, 1 + b]
                hessian[a, a] += inverse


@compiled(reordered=True)
def longest_step(point, change):
    """Largest step <= 1e10 with point + step change in the cones."""
    step = 1e10
    for i in range(point.line.shape[0]):
        if change.line[i] < 0.0:
            step = min(step, -point.line[i] / change.line[i])
    for i in range(point.round.shape[0]):
        step = min(step, cone.longest_step(point.round[i], change.round[i]))
    return step


@compiled(reordered=True)
def refutes(data, multipliers, y_rest):
    """Whether multipliers of the knots' constraints prove that no motion exists.

    With z in the dual cone, every motion has z's + y'v_N >= 0 for the knots' slacks s, which are linear in the forces:
    a constant plus sum_t c_t'F_t. A force in its cone with bounded normal force adds at most
    max(0, bound (c_n + mu |c_tangential|)). If even so the sum is negative, there is no motion.

    `multipliers` is a point of the dual cones, whose contacts' part is not used. `y_rest` (3,) is the final velocity's
    multiplier of any sign, zero if it is free.
    """
    z_line, z_round = multipliers.line, multipliers.round
    n, contacts = data.h.shape[0], data.mu.shape[0]
    constant, size = 0.0, 0.0
    on_r, on_v = np.zeros(3), y_rest.copy()
    for t in range(n, 0, -1):
        for p in range(data.plane_first[t], data.plane_first[t + 1]):
            value = z_line[contacts * ROWS + p]
            constant += value * data.plane_offset[p]
            size += abs(value * data.plane_offset[p])
            for a in range(3):
                on_r[a] += value * data.plane_normal[p, a]
        for k in range(data.ball_first[t], data.ball_first[t + 1]):
            z = z_round[contacts + k]
            constant += z[0] * data.ball_radius[k]
            size += z[0] * data.ball_radius[k]
            for a in range(3):
                constant -= z[1 + a] * data.ball_center[k, a]
                on_r[a] += z[1 + a]
        h = data.h[t - 1]
        best = 0.0
        c = np.empty(3)
        for a in range(3):
            c[a] = 0.5 * h * h * on_r[a] + h * on_v[a]
        constant -= c[2]  # gravity
        for j in range(data.first[t - 1], data.first[t]):
            local = np.zeros(3)
            for a in range(3):
                for b in range(3):
                    local[a] += data.rotation[j, b, a] * c[b]
            tangential = math.sqrt(local[0] * local[0] + local[1] * local[1])
            best += max(0.0, data.force_bound[j] * (local[2] + data.mu[j] * tangential))
        constant += best
        size += best
        for a in range(3):
            on_v[a] += h * on_r[a]
    for a in range(3):
        constant += on_r[a] * data.x0[a] + on_v[a] * data.x0[3 + a]
    return constant < -1e-9 * size
