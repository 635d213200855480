"""The Newton step of a replan's program: one Riccati sweep over the sums of the steps' wrenches.

As in `toolkit.centroidal.kernels.riccati`, for dynamics and costs that are full matrices and first states that are
partly free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.replanning import elimination
from toolkit.replanning.elimination import cholesky, solve_lower, solve_upper

GIVEN = 12  # number of states that are given at the start; the ones after them are free


class Curvature(NamedTuple):
    """Curvature that the barrier adds to the Hessian along the rows: hard (C, m) and soft (K,)."""

    hard: np.ndarray
    soft: np.ndarray


class Sweep(NamedTuple):
    """Factors of one iteration.

    Attributes:
        hessian, half: Lower factors (C, 6, 6) of the wrenches' Hessians, and hessian^-1/2 E' (C, 6, 6).
        total, bk: Lower factor K (N, 6, 6) of the sum of half' half, and B K (N, n, 6).
        value: Hessians V (N + 1, n, n) of the cost-to-go.
        theta, gain: Lower factor (N, 6, 6) of I + BK' V BK, and theta^-1/2 BK' V A (N, 6, n).
    """

    hessian: np.ndarray
    half: np.ndarray
    total: np.ndarray
    bk: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    gain: np.ndarray


@compiled(reordered=True)
def allocate(steps, contacts, n):
    """Allocate the factors."""
    return Sweep(
        np.empty((contacts, 6, 6)),
        np.empty((contacts, 6, 6)),
        np.empty((steps, 6, 6)),
        np.empty((steps, n, 6)),
        np.empty((steps + 1, n, n)),
        np.empty((steps, 6, 6)),
        np.empty((steps, 6, n)),
    )


@compiled(reordered=True)
def factor(p, curvature, s):
    """Factor the Newton system for the barrier's curvature."""
    n, steps, rows = p.a.shape[1], p.a.shape[0], p.rows.shape[1]
    for j in range(p.rows.shape[0]):
        h = s.hessian[j]
        h[:] = 0.0
        for i in range(6):
            h[i, i] = p.weight[j, i]
        for r in range(rows):
            scale = curvature.hard[j, r]
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
            entry = curvature.soft[k] * p.soft_rows[k, i]
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
    """Write the product of two matrices into a third."""
    for i in range(a.shape[0]):
        for c in range(b.shape[1]):
            out[i, c] = 0.0
        for k in range(a.shape[1]):
            entry = a[i, k]
            if entry != 0.0:
                for c in range(b.shape[1]):
                    out[i, c] += entry * b[k, c]


@compiled(reordered=True)
def direction(p, hard_gradient, state_gradient, s, step):
    """Newton direction of states and wrenches, for gradients (C, 6) and (N + 1, n), which are overwritten."""
    dx, du = step.x, step.u
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
def roll_out(p, u, x):
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
