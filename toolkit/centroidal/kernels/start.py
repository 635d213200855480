"""A start whose CoM follows the feet, inside the contacts' cones where possible.

A linear-quadratic tracking problem around a slow motion above the feet gives a feedback law. Its wrenches are pulled
into the cones step by step, so that later steps make up for what earlier ones could not do.
"""

import math

import numpy as np

from toolkit.centroidal.kernels import elimination, objective, riccati
from toolkit.centroidal.kernels.setup import ROWS
from toolkit.compiled import compiled

FOLLOW = 30.0
"""Weight of the CoM's distance from its guess, per step of 0.2 s."""
EFFORT = 10.0
"""Weight of wrenches that differ from sharing the weight."""
INSIDE = 0.9
"""Part of the cones that the start may use."""
LEAST_FORCE = 0.02
"""Least normal force of a contact at the start, in weights."""
ASTRAY = 20.0
"""m; a start further than this from its guess is given up."""


@compiled(reordered=True)
def share_weight(data, t, inside, u):
    """Fill u of step t with vertical forces that add up to the weight where the contacts' normals allow."""
    total = 0.0
    for j in range(data.first[t], data.first[t + 1]):
        total += max(data.rotation[j, 2, 2], 0.0) ** 2
    for j in range(data.first[t], data.first[t + 1]):
        share = max(data.rotation[j, 2, 2], 0.0) ** 2 / max(total, 0.1)
        for a in range(3):
            u[j, a] = share * data.rotation[j, 2, a]
            u[j, 3 + a] = 0.0
        pull_inside(data.mu[j], data.force_bound[j], data.rows[j], inside, u[j])


@compiled(reordered=True)
def pull_inside(mu, bound, rows, inside, u):
    """Pull a wrench (6,) of a contact in: the normal force into its range; if `inside`, all into the cones."""
    u[2] = min(max(u[2], LEAST_FORCE), INSIDE * bound)
    if not inside:
        return
    factor = 1.0
    lateral = math.sqrt(u[0] * u[0] + u[1] * u[1])
    if lateral > INSIDE * mu * u[2]:
        factor = INSIDE * mu * u[2] / lateral
    for i in range(1, ROWS):  # f_z - load >= 0
        load = u[2]
        for a in range(6):
            load -= rows[i, a] * u[a]
        if load * factor > INSIDE * u[2]:
            factor = INSIDE * u[2] / load
    for a in range(6):
        if a != 2:
            u[a] *= factor


@compiled(reordered=True)
def follow(data, sweep, u, x, w):
    """Fill wrenches u (C, 6), states x (N + 1, 9) and total wrenches w (N, 6)."""
    n = data.h.shape[0]
    contacts = data.mu.shape[0]
    knot_gradient, knot_hessian = np.zeros((n + 1, 9)), np.zeros((n + 1, 9, 9))
    step_gradient, step_hessian = np.zeros((n, 15)), np.empty((n, 15, 15))
    contact_gradient = np.zeros((contacts, 6))
    x_guess, w_guess, ignored = np.zeros((2, 9)), np.zeros(6), np.empty(15)
    w_guess[2] = 1.0
    # The quadratic model around the guess.
    for t in range(n):
        share_weight(data, t, True, u)
        riccati.total_wrench(data.first, data.wrench, t, u, w[t])
        x_guess[:, :3] = data.guess[t : t + 2]
        w_guess[3], w_guess[4] = x_guess[0, 1], -x_guess[0, 0]
        objective.step_terms(data.h[t], data.omega[t], data.weights, x_guess[0], w_guess, ignored, step_hessian[t])
        objective.knot_terms(data.omega[t], data.weights, x_guess[1], knot_gradient[t + 1], knot_hessian[t + 1])
        knot_gradient[t + 1] = 0.0
        for a in range(3):
            knot_hessian[t + 1, a, a] += FOLLOW * data.omega[t]
        for j in range(data.first[t], data.first[t + 1]):
            sweep.hessian[j] = 0.0
            for a in range(6):
                sweep.hessian[j, a, a] = EFFORT if a < 3 else 100.0 * EFFORT
    objective.rollout(data, u, x, w)
    for t in range(n):
        for a in range(9):
            for b in range(9):
                guess = data.guess[t + 1, b] if b < 3 else 0.0
                knot_gradient[t + 1, a] += knot_hessian[t + 1, a, b] * (x[t + 1, b] - guess)
        for a in range(15):
            for b in range(15):
                if b < 9:
                    difference = x[t, b] - (data.guess[t, b] if b < 3 else 0.0)
                else:
                    difference = w[t, b - 9]
                    if b == 11:
                        difference -= 1.0
                    elif b == 12:
                        difference -= data.guess[t, 1]
                    elif b == 13:
                        difference += data.guess[t, 0]
                step_gradient[t, a] += step_hessian[t, a, b] * difference
    elimination.factor(data.first, data.wrench, sweep.hessian, sweep.spread, sweep.total)
    riccati.factor_steps(data, knot_hessian, step_hessian, sweep)
    riccati.sweep_back(data, contact_gradient, knot_gradient, step_gradient, sweep)
    dx, du, before, planned = np.empty(9), np.zeros((contacts, 6)), x.copy(), u.copy()
    for attempt in range(2):
        # Where the cones do not let the CoM follow at all (steep or slippery stones), the wrenches start outside.
        inside, furthest = attempt == 0, 0.0
        for t in range(n):
            for a in range(9):
                dx[a] = x[t, a] - before[t, a]
            riccati.step_forward(data, t, contact_gradient, sweep, dx, du)
            for j in range(data.first[t], data.first[t + 1]):
                for a in range(6):
                    u[j, a] = planned[j, a] + du[j, a]
                pull_inside(data.mu[j], data.force_bound[j], data.rows[j], inside, u[j])
            riccati.total_wrench(data.first, data.wrench, t, u, w[t])
            objective.advance(data.h[t], x[t], w[t], x[t + 1])
            for a in range(3):
                furthest = max(furthest, abs(x[t + 1, a] - data.guess[t + 1, a]))
        if furthest < ASTRAY:
            break
