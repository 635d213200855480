"""Primal-dual interior-point method with Gauss-Newton Hessians that follow the iterates.

Mehrotra's predictor and corrector on the cone program whose objective is linearised anew in every iteration; slacks
start inside their cones, so the start need not be feasible. The answer "infeasible" is a proof (`constraints.refutes`).

Reference: L. Vandenberghe, The CVXOPT linear and quadratic cone program solvers (2010), Sec. 5.
"""

import math

import numpy as np

from toolkit.centroidal.kernels import compiled, cone, constraints, objective, riccati, start
from toolkit.centroidal.kernels.setup import ROWS

SOLVED, INFEASIBLE, UNDECIDED = 0, 1, 2
REST_STIFFNESS = 1e7
"""Of the proximal term that carries the final rest; the multiplier makes it exact."""


@compiled
def solve(data, tolerance, max_iterations, u, x, w):
    """Solve; fills u (C, 6), x (N + 1, 9) and w (N, 6), returns (status, iterations)."""
    n, contacts, balls = data.h.shape[0], data.mu.shape[0], data.ball_radius.shape[0]
    lines, rounds = contacts * ROWS + data.plane_offset.shape[0], contacts + balls
    c_line, c_round = np.empty(lines), np.empty((rounds, 4))
    s_line, s_round = np.empty(lines), np.empty((rounds, 4))
    z_line, z_round = np.empty(lines), np.empty((rounds, 4))
    r_line, r_round = np.empty(lines), np.empty((rounds, 4))
    ds_line, ds_round = np.empty(lines), np.empty((rounds, 4))
    dz_line, dz_round = np.empty(lines), np.empty((rounds, 4))
    t_line, t_round = np.empty(lines), np.empty((rounds, 4))
    inverse, eta, scaling, lam = np.empty(lines), np.empty(rounds), np.empty((rounds, 4)), np.empty((rounds, 4))
    contact_gradient = np.empty((contacts, 6))
    knot_gradient, knot_hessian = np.empty((n + 1, 9)), np.empty((n + 1, 9, 9))
    step_gradient, step_hessian = np.empty((n, 15)), np.empty((n, 15, 15))
    g_contact, g_knot = np.empty((contacts, 6)), np.empty((n + 1, 9))
    sweep = riccati.allocate(n, contacts)
    du, dx = np.empty((contacts, 6)), np.empty((n + 1, 9))
    y_rest, y_next = np.zeros(3), np.zeros(3)
    p4, q4 = np.empty(4), np.empty(4)
    degree = float(lines + rounds)

    constraints.constants(data, c_line, c_round)
    start.follow(data, sweep, u, x, w)
    constraints.apply(data, u, x, s_line, s_round)
    mu = 0.0
    for i in range(lines):
        r_line[i] = s_line[i] + c_line[i]
        s_line[i] = max(r_line[i], 0.05)
    for i in range(rounds):
        for a in range(4):
            s_round[i, a] += c_round[i, a]
            r_round[i, a] = s_round[i, a]
        tail = math.sqrt(s_round[i, 1] ** 2 + s_round[i, 2] ** 2 + s_round[i, 3] ** 2)
        s_round[i, 0] = max(s_round[i, 0], tail + 0.05)
    mu = 0.01
    for i in range(lines):
        z_line[i] = mu / s_line[i]
    for i in range(rounds):
        norm = mu / cone.norm_squared(s_round[i])
        z_round[i, 0] = norm * s_round[i, 0]
        for a in range(1, 4):
            z_round[i, a] = -norm * s_round[i, a]

    for iteration in range(max_iterations):
        # Where we are: residual of the slacks, scaling, objective.
        constraints.apply(data, u, x, r_line, r_round)
        worst, gap = 0.0, 0.0
        for i in range(lines):
            r_line[i] += c_line[i] - s_line[i]
            worst = max(worst, abs(r_line[i]))
            inverse[i] = z_line[i] / s_line[i]
            gap += s_line[i] * z_line[i]
        for i in range(rounds):
            for a in range(4):
                r_round[i, a] += c_round[i, a] - s_round[i, a]
                worst = max(worst, abs(r_round[i, a]))
                gap += s_round[i, a] * z_round[i, a]
            eta[i] = cone.scale(s_round[i], z_round[i], scaling[i], lam[i])
        mu = gap / degree
        value = 0.0
        knot_gradient[:], knot_hessian[:] = 0.0, 0.0
        for t in range(n):
            omega = data.omega[t]
            for j in range(data.first[t], data.first[t + 1]):
                value += objective.contact_terms(data, t, j, u[j], contact_gradient[j], sweep.hessian[j])
            value += objective.step_terms(data.h[t], omega, data.weights, x[t], w[t], step_gradient[t], step_hessian[t])
            value += objective.knot_terms(omega, data.weights, x[t + 1], knot_gradient[t + 1], knot_hessian[t + 1])
        if data.rest:
            for a in range(3):
                worst = max(worst, abs(x[n, 3 + a]))
                knot_gradient[n, 3 + a] += y_rest[a] + REST_STIFFNESS * x[n, 3 + a]
                knot_hessian[n, 3 + a, 3 + a] += REST_STIFFNESS
        constraints.add_hessian(data, inverse, scaling, eta, sweep.hessian, knot_hessian)
        riccati.factor_contacts(data, sweep)
        riccati.factor_steps(data, knot_hessian, step_hessian, sweep)

        step, sigma, decrement = 0.0, 0.0, 0.0
        for phase in range(2):
            # What z + dz is before the new slack is known: z + W^-1 (lambda \ d) - W^-2 r.
            for i in range(lines):
                t_line[i] = -inverse[i] * r_line[i]
                if phase == 1:
                    t_line[i] += (sigma * mu - ds_line[i] * dz_line[i]) / s_line[i]
            for i in range(rounds):
                cone.divide_twice(scaling[i], eta[i], r_round[i], t_round[i])
                for a in range(4):
                    t_round[i, a] = -t_round[i, a]
                if phase == 1:
                    cone.divide(scaling[i], eta[i], ds_round[i], p4)
                    cone.multiply(scaling[i], eta[i], dz_round[i], q4)
                    first = sigma * mu
                    for a in range(4):
                        first -= p4[a] * q4[a]
                    for a in range(1, 4):
                        ds_round[i, a] = -(p4[0] * q4[a] + q4[0] * p4[a])
                    ds_round[i, 0] = first
                    cone.jordan_divide(lam[i], ds_round[i], p4)
                    cone.divide(scaling[i], eta[i], p4, q4)
                    for a in range(4):
                        t_round[i, a] += q4[a]
            for j in range(contacts):
                for a in range(6):
                    g_contact[j, a] = contact_gradient[j, a]
            for t in range(n + 1):
                for a in range(9):
                    g_knot[t, a] = knot_gradient[t, a]
            constraints.subtract_adjoint(data, t_line, t_round, g_contact, g_knot)
            riccati.solve(data, g_contact, g_knot, step_gradient, sweep, du, dx)
            constraints.apply(data, du, dx, ds_line, ds_round)
            for i in range(lines):
                dz_line[i] = t_line[i] - z_line[i] - inverse[i] * ds_line[i]
                ds_line[i] += r_line[i]
            for i in range(rounds):
                cone.divide_twice(scaling[i], eta[i], ds_round[i], p4)
                for a in range(4):
                    dz_round[i, a] = t_round[i, a] - z_round[i, a] - p4[a]
                    ds_round[i, a] += r_round[i, a]
            step = min(
                constraints.longest_step(s_line, ds_line, s_round, ds_round),
                constraints.longest_step(z_line, dz_line, z_round, dz_round),
            )
            if phase == 0:
                step = min(1.0, step)
                # Below the floor the objective gains nothing more, and unloaded contacts would lose their CoP's digits.
                floor = 0.2 * tolerance * (value + 1e-4) / degree
                sigma = max((1.0 - step) ** 3, floor / mu)
                # How much the objective can still fall, to first order.
                decrement = 0.0
                for j in range(contacts):
                    for a in range(6):
                        decrement -= contact_gradient[j, a] * du[j, a]
                for t in range(n):
                    for a in range(9):
                        decrement -= knot_gradient[t + 1, a] * dx[t + 1, a]
                        decrement -= step_gradient[t, a] * dx[t, a]
                    # the part of w follows from the contacts
                    for j in range(data.first[t], data.first[t + 1]):
                        for a in range(6):
                            for b in range(6):
                                decrement -= step_gradient[t, 9 + a] * data.wrench[j, a, b] * du[j, b]
        step = min(1.0, 0.99 * step)
        done = worst < 1e-9 and abs(decrement) < tolerance * (value + 1e-4) and gap < tolerance * (value + 1e-4)
        if done:
            return SOLVED, iteration

        if data.rest:
            for a in range(3):
                y_rest[a] += step * REST_STIFFNESS * (x[n, 3 + a] + dx[n, 3 + a])
        for j in range(contacts):
            for a in range(6):
                u[j, a] += step * du[j, a]
        objective.rollout(data, u, x, w)
        for i in range(lines):
            s_line[i] += step * ds_line[i]
            z_line[i] += step * dz_line[i]
        for i in range(rounds):
            for a in range(4):
                s_round[i, a] += step * ds_round[i, a]
                z_round[i, a] += step * dz_round[i, a]
        for a in range(3):
            y_next[a] = -y_rest[a]
        if constraints.refutes(data, z_line, z_round, y_next):
            return INFEASIBLE, iteration + 1
    return UNDECIDED, max_iterations
