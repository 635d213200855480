"""Newton steps of an optimal-control program by a backward and a forward sweep, linear in the number of stages.

Stage t has variables y = (x, u): a state x and controls u. Its quadratic cost is 1/2 y'H y + q'y, and the state of the
next stage changes by F y + c. The last stage has controls too, but no successor.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled

TINY = 1e-14
"""Smallest pivot relative to the diagonal entry before elimination."""


class Sweep(NamedTuple):
    """Factors of the backward sweep of T stages with n states and at most m variables.

    Attributes:
        lower: (T, m, m) Cholesky factors of the controls' Hessians, from their first row and column on.
        gain: (T, m, n) L^-1 H_ux.
        value: (T, n, n) Hessians of the cost to go.
        offset: (T, m) L^-1 q_u of the last right-hand side.
        slope: (T, n) gradients of the cost to go of the last right-hand side, where the state does not change.
    """

    lower: np.ndarray
    gain: np.ndarray
    value: np.ndarray
    offset: np.ndarray
    slope: np.ndarray


def allocate(stages: int, states: int, variables: int) -> Sweep:
    """Room for the factors."""
    return Sweep(
        np.zeros((stages, variables - states, variables - states)),
        np.zeros((stages, variables - states, states)),
        np.zeros((stages, states, states)),
        np.zeros((stages, variables - states)),
        np.zeros((stages, states)),
    )


@compiled(reordered=True, allocates=True)
def factor(begin, end, size, hessian, following, sweep):
    """Factor the stages from `begin` to before `end`, of T with `size` (T,) variables and dynamics (T - 1, n, m).

    Those from `end` on have been factored. Stage t's Hessian is number t modulo k of (k, m, m); its lower triangle
    counts, and is overwritten.
    """
    stages, n = sweep.slope.shape
    m = hessian.shape[1]
    product = np.empty((n, m))
    for t in range(end - 1, begin - 1, -1):
        k = size[t]
        full = hessian[t % len(hessian)]
        if t < stages - 1:
            map_, value = following[t], sweep.value[t + 1]
            product[:, :k] = 0.0
            for a in range(n):
                for b in range(n):
                    v = value[a, b]
                    for c in range(k):
                        product[a, c] += v * map_[b, c]
            for a in range(n):
                for b in range(k):
                    v = map_[a, b]
                    if v != 0.0:
                        for c in range(b + 1):
                            full[b, c] += v * product[a, c]
        lower, gain, u = sweep.lower[t], sweep.gain[t], k - n
        for j in range(u):
            for i in range(j, u):
                lower[i, j] = full[n + i, n + j]
        for j in range(u):
            pivot = lower[j, j]
            limit = TINY * abs(pivot) + 1e-300
            for c in range(j):
                pivot -= lower[j, c] * lower[j, c]
            pivot = np.sqrt(max(pivot, limit))
            lower[j, j] = pivot
            inverse = 1.0 / pivot
            for i in range(j + 1, u):
                entry = lower[i, j]
                for c in range(j):
                    entry -= lower[i, c] * lower[j, c]
                lower[i, j] = entry * inverse
        for i in range(u):
            for c in range(n):
                gain[i, c] = full[n + i, c]
            for j in range(i):
                v = lower[i, j]
                for c in range(n):
                    gain[i, c] -= v * gain[j, c]
            inverse = 1.0 / lower[i, i]
            for c in range(n):
                gain[i, c] *= inverse
        out = sweep.value[t]
        for a in range(n):
            for b in range(a + 1):
                out[a, b] = full[a, b]
        for i in range(u):
            for a in range(n):
                v = gain[i, a]
                for b in range(a + 1):
                    out[a, b] -= v * gain[i, b]
        for a in range(n):
            for b in range(a):
                out[b, a] = out[a, b]


@compiled(reordered=True, allocates=True)
def backward(begin, end, size, following, defect, gradient, sweep):
    """Sweep gradients (T, m), which are overwritten, and defects (T - 1, n) over the stages, like `factor` before."""
    stages, n = sweep.slope.shape
    ahead = np.empty(n)
    for t in range(end - 1, begin - 1, -1):
        k, q = size[t], gradient[t]
        if t < stages - 1:
            value = sweep.value[t + 1]
            for a in range(n):
                entry = sweep.slope[t + 1, a]
                for b in range(n):
                    entry += value[a, b] * defect[t, b]
                ahead[a] = entry
            for a in range(n):
                v = ahead[a]
                for c in range(k):
                    q[c] += v * following[t, a, c]
        lower, gain, offset, u = sweep.lower[t], sweep.gain[t], sweep.offset[t], k - n
        for i in range(u):
            entry = q[n + i]
            for j in range(i):
                entry -= lower[i, j] * offset[j]
            offset[i] = entry / lower[i, i]
        for a in range(n):
            sweep.slope[t, a] = q[a]
        for i in range(u):
            v = offset[i]
            for a in range(n):
                sweep.slope[t, a] -= gain[i, a] * v


@compiled(reordered=True)
def forward(size, following, defect, sweep, change):
    """Fill the Newton step (T, m) after `backward`; the first state does not change."""
    stages, n = sweep.slope.shape
    for a in range(n):
        change[0, a] = 0.0
    for t in range(stages):
        lower, gain, offset, u = sweep.lower[t], sweep.gain[t], sweep.offset[t], size[t] - n
        dx, du = change[t, :n], change[t, n:]
        for i in range(u):
            entry = -offset[i]
            for a in range(n):
                entry -= gain[i, a] * dx[a]
            du[i] = entry
        for i in range(u - 1, -1, -1):
            du[i] /= lower[i, i]
            v = du[i]
            for j in range(i):
                du[j] -= lower[i, j] * v
        if t < stages - 1:
            for a in range(n):
                entry = defect[t, a]
                for c in range(size[t]):
                    entry += following[t, a, c] * change[t, c]
                change[t + 1, a] = entry
