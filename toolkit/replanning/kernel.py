"""Compiled interior-point method for the quadratic program of a replan.

States x_t and contact wrenches u_j (6,) minimise a quadratic objective under linear dynamics that the wrenches of a
step enter through their sum w_t alone, hard rows on each wrench, and soft rows on the states:

    min  sum_t 1/2 x_t' Q_t x_t + q_t' x_t + sum_j 1/2 u_j' R_j u_j + sum_k price (v_k + v_k^2 / (2 softness))
    s.t. x_{t+1} = A_t x_t + B_t sum_j E_j u_j + b_t,    G_j u_j <= g_j,    S_k x_{t(k)} <= s_k + v_k,  v_k >= 0

with the last states of x_0 free. It always has a solution where g > 0. Mehrotra's predictor and corrector; the Newton
step of all steps by one Riccati sweep over w, as in `toolkit.centroidal.kernels.riccati`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.centroidal.kernels import elimination
from toolkit.centroidal.kernels.elimination import cholesky, solve_lower, solve_upper
from toolkit.compiled import compiled

GIVEN = 12
"""Number of states that are given at the start; the ones after them are free."""


class Program(NamedTuple):
    """The program's arrays for N steps, C contacts with m rows each, K soft rows and n states.

    Attributes:
        a: (N, n, n), b: (N, n, 6), drift: (N, n).
        cost: (N + 1, n, n), slope: (N + 1, n).
        first: (N + 1,) first contact of each step, and C.
        spread: (C, 6, 6) E.
        weight: (C, 6) diagonal of R.
        rows: (C, m, 6), bound: (C, m).
        knot: (K,) int, soft_rows: (K, n), soft_bound: (K,).
        price: (K,); softness: m or rad by which a violation's price doubles.
        start: (12,).
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


class _Sweep(NamedTuple):
    """Factors of one iteration."""

    hessian: np.ndarray  # (C, 6, 6) lower factors
    half: np.ndarray  # (C, 6, 6) hessian^-1/2 E'
    total: np.ndarray  # (N, 6, 6) lower factor K of sum half' half
    bk: np.ndarray  # (N, n, 6) B K
    value: np.ndarray  # (N + 1, n, n)
    theta: np.ndarray  # (N, 6, 6) lower factor of I + BK' V BK
    gain: np.ndarray  # (N, 6, n) theta^-1/2 BK' V A


@compiled(reordered=True)
def _factor(p, hard_scale, soft_scale, s):
    """Factor the Newton system for the barrier's curvatures of hard (C, m) and soft (K,) rows."""
    n, steps, rows = p.a.shape[1], p.a.shape[0], p.rows.shape[1]
    for j in range(p.rows.shape[0]):
        h = s.hessian[j]
        h[:] = 0.0
        for i in range(6):
            h[i, i] = p.weight[j, i]
        for r in range(rows):
            scale = hard_scale[j, r]
            for i in range(6):
                value = scale * p.rows[j, r, i]
                for k in range(i + 1):
                    h[i, k] += value * p.rows[j, r, k]
    elimination.factor(p.first, p.spread, s.hessian, s.half, s.total)
    for t in range(steps + 1):
        s.value[t] = p.cost[t]
    for k in range(p.knot.shape[0]):
        value = s.value[p.knot[k]]
        for i in range(n):
            entry = soft_scale[k] * p.soft_rows[k, i]
            if entry != 0.0:
                for c in range(n):
                    value[i, c] += entry * p.soft_rows[k, c]
    product, right = np.empty((n, n)), np.empty((n, 6))
    for t in range(steps - 1, -1, -1):
        following, bk, theta, gain = s.value[t + 1], s.bk[t], s.theta[t], s.gain[t]
        _multiply(p.b[t], s.total[t], bk)
        _multiply(following, bk, right)
        for i in range(6):
            for c in range(i + 1):
                entry = 1.0 if i == c else 0.0
                for k in range(n):
                    entry += bk[k, i] * right[k, c]
                theta[i, c] = entry
        cholesky(theta, 6)
        for c in range(n):
            for i in range(6):
                entry = 0.0
                for k in range(n):
                    entry += right[k, i] * p.a[t, k, c]
                for k in range(i):
                    entry -= theta[i, k] * gain[k, c]
                gain[i, c] = entry / theta[i, i]
        _multiply(following, p.a[t], product)
        value = s.value[t]
        for i in range(n):
            for c in range(i + 1):
                entry = 0.0
                for k in range(n):
                    entry += p.a[t, k, i] * product[k, c]
                for k in range(6):
                    entry -= gain[k, i] * gain[k, c]
                value[i, c] += entry
                if i != c:
                    value[c, i] = value[i, c]


@compiled(reordered=True)
def _multiply(a, b, out):
    """Out = a b."""
    for i in range(a.shape[0]):
        for c in range(b.shape[1]):
            out[i, c] = 0.0
        for k in range(a.shape[1]):
            entry = a[i, k]
            if entry != 0.0:
                for c in range(b.shape[1]):
                    out[i, c] += entry * b[k, c]


@compiled(reordered=True)
def _direction(p, hard_gradient, state_gradient, s, dx, du):
    """Newton direction for gradients (C, 6) and (N + 1, n), which are overwritten."""
    n, steps = p.a.shape[1], p.a.shape[0]
    offset, control = np.zeros((steps, 6)), np.empty((steps, 6))
    pushed, v = np.empty(n), np.empty(n)
    for t in range(steps):
        for j in range(p.first[t], p.first[t + 1]):
            g = hard_gradient[j]
            solve_lower(s.hessian[j], g, 6)
            for c in range(6):
                for i in range(6):
                    offset[t, c] += s.half[j, i, c] * g[i]
    for t in range(steps - 1, -1, -1):
        # The wrenches' own pull shifts the next state by -B offset.
        for i in range(n):
            entry = 0.0
            for c in range(6):
                entry -= p.b[t, i, c] * offset[t, c]
            pushed[i] = entry
        for i in range(n):
            entry = state_gradient[t + 1, i]
            for k in range(n):
                entry += s.value[t + 1, i, k] * pushed[k]
            v[i] = entry
        y = control[t]
        for i in range(6):
            entry = 0.0
            for k in range(n):
                entry += s.bk[t, k, i] * v[k]
            y[i] = entry
        solve_lower(s.theta[t], y, 6)
        for i in range(n):
            entry = state_gradient[t, i]
            for k in range(n):
                entry += p.a[t, k, i] * v[k]
            for k in range(6):
                entry -= s.gain[t, k, i] * y[k]
            state_gradient[t, i] = entry
    free = n - GIVEN
    dx[0] = 0.0
    if free:
        factor, chosen = s.value[0, GIVEN:, GIVEN:].copy(), -state_gradient[0, GIVEN:]
        cholesky(factor, free)
        solve_lower(factor, chosen, free)
        solve_upper(factor, chosen, free)
        dx[0, GIVEN:] = chosen
    y, w = np.empty(6), np.empty(6)
    for t in range(steps):
        for i in range(6):
            entry = -control[t, i]
            for k in range(n):
                entry -= s.gain[t, i, k] * dx[t, k]
            y[i] = entry
        solve_upper(s.theta[t], y, 6)
        for i in range(6):
            w[i] = -offset[t, i]
            for k in range(i + 1):
                w[i] += s.total[t, i, k] * y[k]
        for i in range(n):
            entry = 0.0
            for k in range(n):
                entry += p.a[t, i, k] * dx[t, k]
            for k in range(6):
                entry += p.b[t, i, k] * w[k]
            dx[t + 1, i] = entry
        if p.first[t + 1] > p.first[t]:
            solve_upper(s.total[t], y, 6)
        for j in range(p.first[t], p.first[t + 1]):
            for i in range(6):
                entry = -hard_gradient[j, i]
                for c in range(6):
                    entry += s.half[j, i, c] * y[c]
                du[j, i] = entry
            solve_upper(s.hessian[j], du[j], 6)


@compiled(reordered=True)
def _roll_out(p, u, x):
    """States of given wrenches; the free first states stay."""
    n = p.a.shape[1]
    for i in range(GIVEN):
        x[0, i] = p.start[i]
    w = np.empty(6)
    for t in range(p.a.shape[0]):
        w[:] = 0.0
        for j in range(p.first[t], p.first[t + 1]):
            for i in range(6):
                for k in range(6):
                    w[i] += p.spread[j, i, k] * u[j, k]
        for i in range(n):
            entry = p.drift[t, i]
            for k in range(n):
                entry += p.a[t, i, k] * x[t, k]
            for k in range(6):
                entry += p.b[t, i, k] * w[k]
            x[t + 1, i] = entry


@compiled(reordered=True)
def _longest(value, step):
    """Largest part of a step, at most 1, that keeps values positive."""
    longest = 1.0
    for i in range(value.size):
        if step[i] < 0.0:
            longest = min(longest, -value[i] / step[i])
    return longest


def solve(
    p: Program, u: np.ndarray, free: np.ndarray, max_iterations: int, tolerance: float
) -> tuple[np.ndarray, int, float, float]:
    """Solve a program.

    The first call on a machine compiles the kernels, which are then kept on disk.

    Args:
        p: the program.
        u: (C, 6) start, overwritten with the solution.
        free: (n - 12,) start of the free states.
        max_iterations: bound.
        tolerance: on rows' residuals and on the mean complementarity.

    Returns:
        (N + 1, n) states, iterations, last residual and complementarity.
    """
    return _run(p, u, free, max_iterations, tolerance)


@compiled(kept=True)
def _run(p, u, free, max_iterations, tolerance):
    return _solve(p, u, free, max_iterations, tolerance)


@compiled(reordered=True)
def _solve(p, u, free, max_iterations, tolerance):
    """See `solve`."""
    steps, n = p.a.shape[0], p.a.shape[1]
    contacts, rows = p.rows.shape[0], p.rows.shape[1]
    soft = p.knot.shape[0]
    x = np.zeros((steps + 1, n))
    x[0, GIVEN:] = free
    _roll_out(p, u, x)
    hard = contacts * rows
    size = hard + 2 * soft
    # Complementary pairs: hard rows, soft rows, and the soft rows' violations.
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
    sweep = _Sweep(
        np.empty((contacts, 6, 6)),
        np.empty((contacts, 6, 6)),
        np.empty((steps, 6, 6)),
        np.empty((steps, n, 6)),
        np.empty((steps + 1, n, n)),
        np.empty((steps, 6, 6)),
        np.empty((steps, 6, n)),
    )
    scale, soft_scale = np.empty((contacts, rows)), np.empty(soft)
    dslack, ddual, target = np.zeros(size), np.zeros(size), np.empty(size)
    dx, du = np.zeros((steps + 1, n)), np.zeros((contacts, 6))
    largest = gap = np.inf
    iterations = 0
    for _ in range(max_iterations):
        _residuals(p, u, x, slack[hard + soft :], slack, residual)
        largest = np.abs(residual).max() if residual.size else 0.0
        gap = (slack * dual).sum() / max(size, 1)
        if largest < tolerance and gap < tolerance:
            break
        _curvatures(p, slack, dual, scale, soft_scale)
        _factor(p, scale, soft_scale, sweep)
        target[:] = 0.0
        _newton(p, u, x, slack, dual, residual, target, scale, soft_scale, sweep, dx, du, dslack, ddual)
        reach = min(_longest(slack, dslack), _longest(dual, ddual))
        ahead = ((slack + reach * dslack) * (dual + reach * ddual)).sum() / max(size, 1)
        centring = (max(ahead, 0.0) / gap) ** 3
        for i in range(size):
            target[i] = centring * gap - dslack[i] * ddual[i]
        _newton(p, u, x, slack, dual, residual, target, scale, soft_scale, sweep, dx, du, dslack, ddual)
        reach = min(1.0, 0.99 * min(_longest(slack, dslack), _longest(dual, ddual)))
        slack += reach * dslack
        dual += reach * ddual
        u += reach * du
        x += reach * dx
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
def _curvatures(p, slack, dual, scale, soft_scale):
    """What the rows add to the Hessians."""
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
def _newton(p, u, x, slack, dual, residual, target, scale, soft_scale, sweep, dx, du, dslack, ddual):
    """Newton direction towards slack * dual = target, into dx, du, dslack and ddual."""
    contacts, rows = scale.shape
    hard, soft, n = contacts * rows, soft_scale.size, x.shape[1]
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
    _direction(p, hard_gradient, state_gradient, sweep, dx, du)
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
