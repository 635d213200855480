"""The contacts' part of a Newton step: their wrenches are eliminated in favour of the sum of each step.

A wrench u of Hessian H that enters the dynamics through the sum w = sum B u leaves w the Hessian S^-1 with
S = sum B H^-1 B', see `riccati`.
"""

import math

from toolkit.compiled import compiled


@compiled(reordered=True)
def cholesky(a, n):
    """Lower factor in place of a symmetric matrix whose lower triangle is given; small pivots are lifted."""
    for j in range(n):
        limit = 1e-14 * abs(a[j, j]) + 1e-300
        for k in range(j):
            a[j, j] -= a[j, k] * a[j, k]
        pivot = math.sqrt(max(a[j, j], limit))
        a[j, j] = pivot
        inverse = 1.0 / pivot
        for i in range(j + 1, n):
            value = a[i, j]
            for k in range(j):
                value -= a[i, k] * a[j, k]
            a[i, j] = value * inverse


@compiled(reordered=True)
def solve_lower(lower, b, n):
    """Solve L x = b in place."""
    for i in range(n):
        value = b[i]
        for k in range(i):
            value -= lower[i, k] * b[k]
        b[i] = value / lower[i, i]


@compiled(reordered=True)
def solve_upper(lower, b, n):
    """Solve L' x = b in place."""
    for i in range(n - 1, -1, -1):
        value = b[i]
        for k in range(i + 1, n):
            value -= lower[k, i] * b[k]
        b[i] = value / lower[i, i]


@compiled(reordered=True)
def factor(first, wrench, hessian, spread, total):
    """Factor the contacts' Hessians, and sum them up into K of each step, with S = K K'.

    Takes the `first` (N + 1,) contact of each step, `wrench` (C, 6, 6) B and the lower triangles of `hessian` (C, 6, 6)
    H, which become lower factors. Fills `spread` (C, 6, 6) with H^-1/2 B' and `total` (N, 6, 6) with K.
    """
    for t in range(total.shape[0]):
        total[t] = 0.0
        for j in range(first[t], first[t + 1]):
            cholesky(hessian[j], 6)
            for a in range(6):
                for i in range(6):
                    value = wrench[j, a, i]
                    for k in range(i):
                        value -= hessian[j, i, k] * spread[j, k, a]
                    spread[j, i, a] = value / hessian[j, i, i]
            for i in range(6):
                for a in range(6):
                    for b in range(a + 1):
                        total[t, a, b] += spread[j, i, a] * spread[j, i, b]
        if first[t + 1] > first[t]:
            cholesky(total[t], 6)
        for a in range(6):
            for b in range(a + 1, 6):
                total[t, a, b] = 0.0
