"""Primal-dual interior-point method with Gauss-Newton Hessians that follow the iterates.

Mehrotra's predictor and corrector on the cone program whose objective is linearised anew in every iteration; slacks
start inside their cones, so the start need not be feasible. Steps near feasibility must lower the barrier function.
The answer "infeasible" is a proof (`constraints.refutes`).

Reference: L. Vandenberghe, The CVXOPT linear and quadratic cone program solvers (2010), Sec. 5.
"""

import math
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.kernels import cone, constraints, elimination, objective, riccati, start
from toolkit.centroidal.kernels.setup import ROWS
from toolkit.compiled import compiled

SOLVED, INFEASIBLE, UNDECIDED = 0, 1, 2
REST_STIFFNESS = 1e7
"""Stiffness of the proximal term for the final rest; a multiplier makes the rest exact."""
FEASIBLE = 1e-9
"""Largest residual of the constraints at a solution."""
NEARLY_FEASIBLE = 1e-1
"""Residual below which steps must lower the barrier function."""
INITIAL_GAP = 0.3
"""Complementarity at the start, relative to the objective there."""
SMALL = 1e-4
"""Objective (scaled) below which accuracy is absolute."""


class Model(NamedTuple):
    """Quadratic model of the objective: gradients and Hessians, those of the contacts in `riccati.Sweep`."""

    contact_gradient: np.ndarray
    knot_gradient: np.ndarray
    knot_hessian: np.ndarray
    step_gradient: np.ndarray
    step_hessian: np.ndarray


@compiled(reordered=True)
def linearise(data, u, x, w, y_rest, model, sweep):
    """Fill the model at a motion; returns the objective."""
    n = data.h.shape[0]
    value = 0.0
    model.knot_gradient[:] = 0.0
    model.knot_hessian[:] = 0.0
    for t in range(n):
        h, omega = data.h[t], data.omega[t]
        for j in range(data.first[t], data.first[t + 1]):
            gradient, hessian = model.contact_gradient[j], sweep.hessian[j]
            value += objective.contact_terms(omega, data.weights, data.cop_weight[j], u[j], gradient, hessian)
        gradient, hessian = model.step_gradient[t], model.step_hessian[t]
        value += objective.step_terms(h, omega, data.weights, x[t], w[t], gradient, hessian)
        gradient, hessian = model.knot_gradient[t + 1], model.knot_hessian[t + 1]
        value += objective.knot_terms(omega, data.weights, x[t + 1], gradient, hessian)
    if data.rest:
        for a in range(3, 6):
            model.knot_gradient[n, a] += y_rest[a - 3] + REST_STIFFNESS * x[n, a]
            model.knot_hessian[n, a, a] += REST_STIFFNESS
    return value


@compiled(reordered=True)
def rest_terms(data, x, y_rest):
    """Terms of the final rest in the barrier function."""
    total = 0.0
    if data.rest:
        for a in range(3):
            v = x[data.h.shape[0], 3 + a]
            total += y_rest[a] * v + 0.5 * REST_STIFFNESS * v * v
    return total


@compiled(reordered=True)
def slope(data, model, du, dx):
    """Derivative of the objective along a direction."""
    total = 0.0
    dw = np.empty(6)
    for t in range(data.h.shape[0]):
        for j in range(data.first[t], data.first[t + 1]):
            for a in range(6):
                total += model.contact_gradient[j, a] * du[j, a]
        riccati.total_wrench(data.first, data.wrench, t, du, dw)
        for a in range(9):
            total += model.knot_gradient[t + 1, a] * dx[t + 1, a] + model.step_gradient[t, a] * dx[t, a]
        for a in range(6):
            total += model.step_gradient[t, 9 + a] * dw[a]
    return total


class Change(NamedTuple):
    """Change of the wrenches (C, 6), the states (N + 1, 9), the slacks and the multipliers."""

    wrenches: np.ndarray
    states: np.ndarray
    slacks: constraints.Point
    multipliers: constraints.Point


class Scaling(NamedTuple):
    """Nesterov-Todd scaling: W^-2 of the half lines; w, eta and lambda of the cones (see `cone`)."""

    inverse: np.ndarray
    w: np.ndarray
    eta: np.ndarray
    lam: np.ndarray


@compiled(reordered=True)
def scale(s, z, scaling):
    """Fill the scaling of (s, z); returns s'z."""
    gap = 0.0
    for i in range(s.line.shape[0]):
        scaling.inverse[i] = z.line[i] / s.line[i]
        gap += s.line[i] * z.line[i]
    for i in range(s.round.shape[0]):
        scaling.eta[i] = cone.scale(s.round[i], z.round[i], scaling.w[i], scaling.lam[i])
        for a in range(4):
            gap += s.round[i, a] * z.round[i, a]
    return gap


@compiled(reordered=True)
def enter_cones(residual, s):
    """Fill s with a point well inside the cones, equal to `residual` where that lies inside."""
    for i in range(s.line.shape[0]):
        s.line[i] = max(residual.line[i], 0.1, -residual.line[i])
    for i in range(s.round.shape[0]):
        here, there = residual.round[i], s.round[i]
        tail = math.sqrt(here[1] ** 2 + here[2] ** 2 + here[3] ** 2)
        there[0] = max(here[0], tail + max(0.1, tail - here[0]))
        for a in range(1, 4):
            there[a] = here[a]


@compiled(reordered=True)
def direction(data, model, sweep, scaling, residual, s, z, gap, correct, targets, scratch, change):
    """Fill the change of slacks s and multipliers z that aims at complementarity `gap`, which is sigma mu.

    The residual is A (u, x) + c - s. Where `correct`, the change holds the predictor, whose second-order term is
    corrected. `targets` is room for a point, `scratch` for the gradients of the contacts and of the knots.
    """
    du, dx, ds, dz = change
    p, q = np.empty(4), np.empty(4)
    # The multipliers that the step leads to, before the change of the slacks is known.
    for i in range(s.line.shape[0]):
        targets.line[i] = -scaling.inverse[i] * residual.line[i] + gap / s.line[i]
        if correct:
            targets.line[i] -= ds.line[i] * dz.line[i] / s.line[i]
    for i in range(s.round.shape[0]):
        w, eta, target = scaling.w[i], scaling.eta[i], targets.round[i]
        for a in range(4):
            target[a] = 0.0
        if correct:
            cone.divide(w, eta, ds.round[i], p)
            cone.multiply(w, eta, dz.round[i], q)
            cone.jordan_multiply(p, q, target)
        for a in range(4):
            target[a] = -target[a]
        target[0] += gap
        cone.jordan_divide(scaling.lam[i], target, p)
        cone.divide(w, eta, p, target)
        cone.divide_twice(w, eta, residual.round[i], p)
        for a in range(4):
            target[a] -= p[a]
    for j in range(du.shape[0]):
        for a in range(6):
            scratch[0][j, a] = model.contact_gradient[j, a]
    for t in range(dx.shape[0]):
        for a in range(9):
            scratch[1][t, a] = model.knot_gradient[t, a]
    constraints.subtract_adjoint(data, targets, scratch[0], scratch[1])
    riccati.solve(data, scratch[0], scratch[1], model.step_gradient, sweep, du, dx)
    constraints.apply(data, du, dx, ds)
    for i in range(s.line.shape[0]):
        dz.line[i] = targets.line[i] - z.line[i] - scaling.inverse[i] * ds.line[i]
        ds.line[i] += residual.line[i]
    for i in range(s.round.shape[0]):
        cone.divide_twice(scaling.w[i], scaling.eta[i], ds.round[i], p)
        for a in range(4):
            dz.round[i, a] = targets.round[i, a] - z.round[i, a] - p[a]
            ds.round[i, a] += residual.round[i, a]


@compiled(reordered=True)
def solve(data, tolerance, max_iterations, u, x, w, z):
    """Solve a problem to a suboptimality of `tolerance` relative to the objective; returns status and iterations.

    Fills the contact wrenches u (C, 6), states x (N + 1, 9), total wrenches w (N, 6) and multipliers z.
    """
    n, contacts = data.h.shape[0], data.mu.shape[0]
    lines, rounds = contacts * ROWS + data.plane_offset.shape[0], contacts + data.ball_radius.shape[0]
    degree = float(lines + rounds)
    s, ds, dz = constraints.room(lines, rounds), constraints.room(lines, rounds), constraints.room(lines, rounds)
    targets, trial = constraints.room(lines, rounds), constraints.room(lines, rounds)
    constant, residual = constraints.room(lines, rounds), constraints.room(lines, rounds)
    scaling = Scaling(np.empty(lines), np.empty((rounds, 4)), np.empty(rounds), np.empty((rounds, 4)))
    model = Model(
        np.empty((contacts, 6)), np.empty((n + 1, 9)), np.empty((n + 1, 9, 9)), np.empty((n, 15)), np.empty((n, 15, 15))
    )
    sweep = riccati.allocate(n, contacts)
    scratch = (np.empty((contacts, 6)), np.empty((n + 1, 9)))
    du, dx, u_trial = np.empty((contacts, 6)), np.empty((n + 1, 9)), np.empty((contacts, 6))
    change = Change(du, dx, ds, dz)
    y_rest, velocity, y_refuting = np.zeros(3), np.zeros(3), np.zeros(3)

    constraints.constants(data, constant)
    start.follow(data, sweep, u, x, w)
    constraints.apply(data, u, x, residual)
    constraints.add(residual, 1.0, constant)
    enter_cones(residual, s)
    constraints.invert(s, max(0.01, INITIAL_GAP * objective.value(data, u, x, w) / degree), z)

    iteration = 0
    for iteration in range(max_iterations):
        constraints.apply(data, u, x, residual)
        constraints.add(residual, 1.0, constant)
        constraints.add(residual, -1.0, s)
        worst = constraints.largest(residual)
        if data.rest:
            for a in range(3):
                worst = max(worst, abs(x[n, 3 + a]))
        gap = scale(s, z, scaling)
        mu = gap / degree
        value = linearise(data, u, x, w, y_rest, model, sweep)
        if not (value < np.inf and gap < np.inf):
            break
        constraints.add_hessian(data, scaling.inverse, scaling.w, scaling.eta, sweep.hessian, model.knot_hessian)
        elimination.factor(data.first, data.wrench, sweep.hessian, sweep.spread, sweep.total)
        riccati.factor_steps(data, model.knot_hessian, model.step_hessian, sweep)

        # Predictor; corrector; or a plain step where the corrector does not lower the barrier function.
        accepted = tolerance * (value + SMALL)
        goal, before, step = 0.0, 0.0, 0.0
        for phase in range(3):
            correct = phase == 1
            direction(data, model, sweep, scaling, residual, s, z, goal, correct, targets, scratch, change)
            if phase == 0:
                if worst < FEASIBLE and gap < accepted and abs(slope(data, model, du, dx)) < accepted:
                    return SOLVED, iteration
                step = min(1.0, constraints.longest_step(s, ds), constraints.longest_step(z, dz))
                # Far below the accepted gap nothing is gained, and unloaded contacts lose the digits of their CoP.
                goal = mu * min(1.0, max((1.0 - step) ** 3, 0.2 * accepted / gap))
                before = value + rest_terms(data, x, y_rest) - goal * constraints.barrier(s)
                for a in range(3):
                    velocity[a] = x[n, 3 + a]
                continue
            step = min(constraints.longest_step(s, ds), constraints.longest_step(z, dz))
            for j in range(contacts):  # the objective needs f_z > 0, also where the start is outside the cones
                if du[j, 2] < 0.0:
                    step = min(step, -u[j, 2] / du[j, 2])
            step = min(1.0, 0.99 * step)
            # By how much full steps change the Lagrangian through the residual of the slacks.
            owed = constraints.dot(z, residual) + constraints.dot(dz, residual)
            lower = False
            for trials in range(1 if correct else 5):
                step *= 0.5 if trials > 0 else 1.0
                for j in range(contacts):
                    for a in range(6):
                        u_trial[j, a] = u[j, a] + step * du[j, a]
                objective.rollout(data, u_trial, x, w)
                lower = worst > NEARLY_FEASIBLE
                if lower:
                    break
                constraints.copy(s, trial)
                constraints.add(trial, step, ds)
                after = objective.value(data, u_trial, x, w) + rest_terms(data, x, y_rest)
                lower = after - goal * constraints.barrier(trial) <= before - step * owed + 0.1 * accepted
                if lower:
                    break
            if lower:
                break

        for j in range(contacts):
            for a in range(6):
                u[j, a] = u_trial[j, a]
        if data.rest:
            for a in range(3):
                # The velocity that the full step leads to.
                y_rest[a] += step * REST_STIFFNESS * (velocity[a] + dx[n, 3 + a])
        constraints.add(s, step, ds)
        constraints.add(z, step, dz)
        for a in range(3):
            y_refuting[a] = -y_rest[a]
        if constraints.refutes(data, z, y_refuting):
            return INFEASIBLE, iteration + 1
    return UNDECIDED, iteration
