"""Compiled interior-point method for the quadratic program of a replan.

States x_t and contact wrenches u_j (6,) minimise a quadratic objective under linear dynamics that the wrenches of a
step enter through their sum w_t alone, hard rows on each wrench, and soft rows on the states:

    min  sum_t 1/2 x_t' Q_t x_t + q_t' x_t + sum_j 1/2 u_j' R_j u_j + sum_k price (v_k + v_k^2 / (2 softness))
    s.t. x_{t+1} = A_t x_t + B_t sum_j E_j u_j + b_t,    G_j u_j <= g_j,    S_k x_{t(k)} <= s_k + v_k,  v_k >= 0

with the last states of x_0 free. It always has a solution where g > 0. The method is Mehrotra's predictor and
corrector; one Riccati sweep over w gives the Newton step (see `sweep`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.replanning.sweep import GIVEN, Curvature, allocate, direction, factor, roll_out


class Program(NamedTuple):
    """The program's arrays for N steps, C contacts with m rows each, K soft rows and n states.

    Attributes:
        a, b, drift: (N, n, n) A, (N, n, 6) B and (N, n) b.
        cost, slope: (N + 1, n, n) Q and (N + 1, n) q.
        first: (N + 1,) first contact of each step, and C.
        spread: (C, 6, 6) E.
        weight: (C, 6) diagonal of R.
        rows, bound: (C, m, 6) G and (C, m) g.
        knot, soft_rows, soft_bound: (K,) t(k), (K, n) S and (K,) s.
        price, softness: (K,) prices, and the violation in m or rad that doubles them.
        start: (12,) given states of x_0.
    """

    a: np.ndarray
    b: np.ndarray
    drift: np.ndarray
    cost: np.ndarray
    slope: np.ndarray
    first: np.ndarray
    spread: np.ndarray
    weight: np.ndarray
    rows: np.ndarray
    bound: np.ndarray
    knot: np.ndarray
    soft_rows: np.ndarray
    soft_bound: np.ndarray
    price: np.ndarray
    softness: float
    start: np.ndarray


class _Point(NamedTuple):
    """An iterate or its step: wrenches (C, 6), states (N + 1, n), and complementary pairs (C m + 2 K,).

    The pairs belong to the hard rows, the soft rows, and the soft rows' violations.
    """

    u: np.ndarray
    x: np.ndarray
    slack: np.ndarray
    dual: np.ndarray


@compiled(reordered=True)
def _longest(value, step):
    """Largest part of a step, at most 1, that keeps values positive."""
    longest = 1.0
    for i in range(value.size):
        if step[i] < 0.0:
            longest = min(longest, -value[i] / step[i])
    return longest


@compiled(kept=True)
def solve(p, u, free, max_iterations, tolerance):
    """Solve a program.

    Args:
        p: The `Program`.
        u: Wrenches (C, 6) to start from; the solution replaces them.
        free: Free states (n - 12,) to start from.
        max_iterations: Largest number of iterations.
        tolerance: Bound on the rows' residuals and on the mean complementarity.

    Returns:
        States (N + 1, n), number of iterations, last residual and last complementarity.
    """
    return _solve(p, u, free, max_iterations, tolerance)


@compiled(reordered=True)
def _solve(p, u, free, max_iterations, tolerance):
    """See `solve`."""
    steps, n = p.a.shape[0], p.a.shape[1]
    contacts, rows = p.rows.shape[0], p.rows.shape[1]
    soft = p.knot.shape[0]
    x = np.zeros((steps + 1, n))
    x[0, GIVEN:] = free
    roll_out(p, u, x)
    hard = contacts * rows
    size = hard + 2 * soft
    slack, dual = np.empty(size), np.empty(size)
    residual = np.empty(hard + soft)
    _residuals(p, u, x, np.zeros(soft), np.zeros(size), residual)
    for i in range(hard):
        slack[i] = max(-residual[i], 1e-3)
        dual[i] = 1e-3 / slack[i]
    for k in range(soft):
        violation = max(residual[hard + k], 0.0) + 1e-3
        slack[hard + soft + k] = violation
        slack[hard + k] = max(violation - residual[hard + k], 1e-3)
        dual[hard + k] = min(1e-3 / slack[hard + k], 0.5 * p.price[k])
        dual[hard + soft + k] = p.price[k] * (1.0 + violation / p.softness) - dual[hard + k]
    sweep = allocate(steps, contacts, n)
    curvature = Curvature(np.empty((contacts, rows)), np.empty(soft))
    point = _Point(u, x, slack, dual)
    step = _Point(np.zeros((contacts, 6)), np.zeros((steps + 1, n)), np.zeros(size), np.zeros(size))
    target = np.empty(size)
    largest = gap = np.inf
    iterations = 0
    for _ in range(max_iterations):
        _residuals(p, u, x, slack[hard + soft :], slack, residual)
        largest = np.abs(residual).max() if residual.size else 0.0
        gap = (slack * dual).sum() / max(size, 1)
        if largest < tolerance and gap < tolerance:
            break
        _curve(p, point, curvature)
        factor(p, curvature, sweep)
        target[:] = 0.0
        _newton(p, point, residual, target, curvature, sweep, step)
        reach = min(_longest(slack, step.slack), _longest(dual, step.dual))
        ahead = ((slack + reach * step.slack) * (dual + reach * step.dual)).sum() / max(size, 1)
        centring = (max(ahead, 0.0) / gap) ** 3
        for i in range(size):
            target[i] = centring * gap - step.slack[i] * step.dual[i]
        _newton(p, point, residual, target, curvature, sweep, step)
        reach = min(1.0, 0.99 * min(_longest(slack, step.slack), _longest(dual, step.dual)))
        slack += reach * step.slack
        dual += reach * step.dual
        u += reach * step.u
        x += reach * step.x
        iterations += 1
    return x, iterations, largest, gap


@compiled(reordered=True)
def _residuals(p, u, x, violation, slack, residual):
    """Fill the residuals of hard and soft rows with their slacks."""
    rows, hard = p.rows.shape[1], p.rows.shape[0] * p.rows.shape[1]
    for j in range(p.rows.shape[0]):
        for r in range(rows):
            entry = slack[j * rows + r] - p.bound[j, r]
            for i in range(6):
                entry += p.rows[j, r, i] * u[j, i]
            residual[j * rows + r] = entry
    for k in range(p.knot.shape[0]):
        entry = slack[hard + k] - p.soft_bound[k] - violation[k]
        for i in range(x.shape[1]):
            entry += p.soft_rows[k, i] * x[p.knot[k], i]
        residual[hard + k] = entry


@compiled(reordered=True)
def _curve(p, point, curvature):
    """Fill in the curvature that the rows add to the Hessians."""
    slack, dual, scale, soft_scale = point.slack, point.dual, curvature.hard, curvature.soft
    contacts, rows = scale.shape
    hard, soft = contacts * rows, soft_scale.size
    for j in range(contacts):
        for r in range(rows):
            scale[j, r] = dual[j * rows + r] / slack[j * rows + r]
    for k in range(soft):
        row = dual[hard + k] / slack[hard + k]
        total = p.price[k] / p.softness + dual[hard + soft + k] / slack[hard + soft + k] + row
        soft_scale[k] = row - row * row / total


@compiled(reordered=True)
def _newton(p, point, residual, target, curvature, sweep, step):
    """Newton direction towards slack * dual = target, into `step`."""
    u, x, slack, dual, scale = point.u, point.x, point.slack, point.dual, curvature.hard
    du, dx, dslack, ddual = step.u, step.x, step.slack, step.dual
    contacts, rows = scale.shape
    hard, soft, n = contacts * rows, p.knot.size, x.shape[1]
    hard_gradient, state_gradient = np.empty((contacts, 6)), np.empty(x.shape)
    for j in range(contacts):
        for i in range(6):
            hard_gradient[j, i] = p.weight[j, i] * u[j, i]
        for r in range(rows):
            m = j * rows + r
            pull = target[m] / slack[m] + scale[j, r] * residual[m]
            for i in range(6):
                hard_gradient[j, i] += p.rows[j, r, i] * pull
    for t in range(x.shape[0]):
        for i in range(n):
            entry = p.slope[t, i]
            for k in range(n):
                entry += p.cost[t, i, k] * x[t, k]
            state_gradient[t, i] = entry
    inner = np.empty((soft, 2))
    for k in range(soft):
        a, b = hard + k, hard + soft + k
        row, bend = dual[a] / slack[a], p.price[k] / p.softness
        total = bend + dual[b] / slack[b] + row
        lack = p.price[k] + bend * slack[b] - dual[a] - dual[b]
        first, second = target[a] / slack[a] - dual[a], target[b] / slack[b] - dual[b]
        inner[k, 0] = first + row * residual[a]
        inner[k, 1] = inner[k, 0] + second - lack
        pull = dual[a] + inner[k, 0] - row * inner[k, 1] / total
        for i in range(n):
            state_gradient[p.knot[k], i] += p.soft_rows[k, i] * pull
    direction(p, hard_gradient, state_gradient, sweep, step)
    for j in range(contacts):
        for r in range(rows):
            m = j * rows + r
            entry = -residual[m]
            for i in range(6):
                entry -= p.rows[j, r, i] * du[j, i]
            dslack[m] = entry
            ddual[m] = (target[m] - dual[m] * entry) / slack[m] - dual[m]
    for k in range(soft):
        a, b = hard + k, hard + soft + k
        row = dual[a] / slack[a]
        total = p.price[k] / p.softness + dual[b] / slack[b] + row
        along = 0.0
        for i in range(n):
            along += p.soft_rows[k, i] * dx[p.knot[k], i]
        dslack[b] = (inner[k, 1] + row * along) / total
        dslack[a] = -residual[a] - along + dslack[b]
        ddual[a] = (target[a] - dual[a] * dslack[a]) / slack[a] - dual[a]
        ddual[b] = (target[b] - dual[b] * dslack[b]) / slack[b] - dual[b]
