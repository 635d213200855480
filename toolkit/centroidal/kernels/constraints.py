"""The constraints as one map s = c + A (u, x) into a product of half lines and second-order cones.

Half lines: 13 rows per contact, then the planes. Cones: the friction cone of each contact, then the balls.
"""

import math

import numpy as np

from toolkit.centroidal.kernels import compiled, cone
from toolkit.centroidal.kernels.setup import ROWS


@compiled
def constants(data, line, round):
    """Fill line (13 C + P,) and round (C + K, 4) with c."""
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


@compiled
def apply(data, u, x, line, round):
    """Fill line and round with A (u, x)."""
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


@compiled
def subtract_adjoint(data, line, round, contact_gradient, knot_gradient):
    """Subtract A' (line, round) from the gradients of contacts (C, 6) and knots (N + 1, 9)."""
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


@compiled
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


@compiled
def longest_step(line, d_line, round, d_round):
    """Largest step that keeps (line, round) + step (d_line, d_round) in the cones."""
    step = 1e10
    for i in range(line.shape[0]):
        if d_line[i] < 0.0:
            step = min(step, -line[i] / d_line[i])
    for i in range(round.shape[0]):
        step = min(step, cone.longest_step(round[i], d_round[i]))
    return step


@compiled
def refutes(data, z_line, z_round, y_rest):
    """Whether multipliers of the knots' constraints prove that no motion exists.

    With z in the dual cone, every motion has z's + y'v_N >= 0 for the knots' slacks s, which are linear in the forces:
    a constant plus sum_t c_t'F_t. A force in its cone with bounded normal force adds at most
    max(0, bound (c_n + mu |c_tangential|)). If even so the sum is negative, there is no motion.

    Args:
        data: the problem.
        z_line: (13 C + P,) and
        z_round: (C + K, 4) multipliers inside the dual cones; those of the contacts are not needed.
        y_rest: (3,) of the final velocity, any sign; zero if it is free.
    """
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
