"""Newton step of the whole motion by a backward and a forward sweep, linear in the number of steps.

Each contact's wrench enters the dynamics only through the sum w = sum B u, so its quadratic cost 1/2 u'H u + g'u is
eliminated first: the cost of w is 1/2 (w + w0)' S^-1 (w + w0) with S = sum B H^-1 B' and w0 = sum B H^-1 g, and
u = H^-1 (B' nu - g) with S nu = w + w0. With S = K K' and w = K y - w0 the control y has the unit Hessian, so the
sweep is over 9 states and 6 well scaled controls, however many contacts there are.
"""

import math

import numpy as np

from toolkit.centroidal.kernels import compiled


@compiled
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


@compiled
def solve_lower(lower, b, n):
    """Solve L x = b in place."""
    for i in range(n):
        value = b[i]
        for k in range(i):
            value -= lower[i, k] * b[k]
        b[i] = value / lower[i, i]


@compiled
def solve_upper(lower, b, n):
    """Solve L' x = b in place."""
    for i in range(n - 1, -1, -1):
        value = b[i]
        for k in range(i + 1, n):
            value -= lower[k, i] * b[k]
        b[i] = value / lower[i, i]


@compiled
def forward(h, x, w, out):
    """Out = A x + B w: the dynamics' linear part, gravity's constant left out."""
    for a in range(3):
        out[a] = x[a] + h * x[3 + a] + 0.5 * h * h * w[a]
        out[3 + a] = x[3 + a] + h * w[a]
        out[6 + a] = x[6 + a] + h * w[3 + a]
    out[6] -= h * x[1] + h * h / 2 * x[4] + h**3 / 6 * w[1]
    out[7] += h * x[0] + h * h / 2 * x[3] + h**3 / 6 * w[0]


@compiled
def backward(h, y, x, w):
    """X = A'y (9,) and w = B'y (6,): the adjoint of `forward`."""
    for a in range(3):
        x[a] = y[a]
        x[3 + a] = y[3 + a] + h * y[a]
        x[6 + a] = y[6 + a]
        w[a] = 0.5 * h * h * y[a] + h * y[3 + a]
        w[3 + a] = h * y[6 + a]
    x[0] += h * y[7]
    x[1] -= h * y[6]
    x[3] += h * h / 2 * y[7]
    x[4] -= h * h / 2 * y[6]
    w[0] += h**3 / 6 * y[7]
    w[1] -= h**3 / 6 * y[6]


@compiled
def factor_contacts(data, hessian, spread, total):
    """Factor the contacts' Hessians (C, 6, 6) in place; fill spread (C, 6, 6) = L^-1 B', total (N, 6, 6) = K."""
    for t in range(data.h.shape[0]):
        total[t] = 0.0
        for j in range(data.first[t], data.first[t + 1]):
            cholesky(hessian[j], 6)
            for a in range(6):
                for i in range(6):
                    value = data.wrench[j, a, i]
                    for k in range(i):
                        value -= hessian[j, i, k] * spread[j, k, a]
                    spread[j, i, a] = value / hessian[j, i, i]
            for i in range(6):
                for a in range(6):
                    for b in range(a + 1):
                        total[t, a, b] += spread[j, i, a] * spread[j, i, b]
        if data.first[t + 1] > data.first[t]:
            cholesky(total[t], 6)
        for a in range(6):
            for b in range(a + 1, 6):
                total[t, a, b] = 0.0


@compiled
def factor_steps(data, knot_hessian, step_hessian, total, mixed, theta, gain):
    """Backward sweep of the matrices.

    Args:
        data: the problem.
        knot_hessian: (N + 1, 9, 9).
        step_hessian: (N, 15, 15) in (x, w).
        total: (N, 6, 6) K of `factor_contacts`.
        mixed: (N, 6, 15), filled: Hessian rows of w against (x, w).
        theta: (N, 6, 6), filled: factor of I + K' M_ww K.
        gain: (N, 6, 9), filled: theta^-1 K' M_wx.
    """
    n = data.h.shape[0]
    value = np.empty((9, 9))
    columns = np.empty((15, 9))  # of V [A B], as rows
    for a in range(9):
        for b in range(9):
            value[a, b] = knot_hessian[n, a, b]
    row_x, row_w = np.empty(9), np.empty(6)
    product = np.empty((6, 6))
    for t in range(n - 1, -1, -1):
        h = data.h[t]
        for i in range(9):
            backward(h, value[i], row_x, row_w)
            for a in range(9):
                columns[a, i] = row_x[a]
            for a in range(6):
                columns[9 + a, i] = row_w[a]
        # The adjoint again on the columns: [A B]' V [A B].
        hessian, mix = step_hessian[t], mixed[t]
        for c in range(15):
            backward(h, columns[c], row_x, row_w)
            for a in range(6):
                mix[a, c] = row_w[a] + hessian[9 + a, c]
            if c < 9:
                for a in range(9):
                    value[a, c] = row_x[a] + hessian[a, c] + knot_hessian[t, a, c]
        lower, th, ga = total[t], theta[t], gain[t]
        for a in range(6):
            for b in range(6):
                entry = 0.0
                for k in range(b, 6):
                    entry += mix[a, 9 + k] * lower[k, b]
                product[a, b] = entry
        for a in range(6):
            for b in range(a + 1):
                entry = 1.0 if a == b else 0.0
                for k in range(a, 6):
                    entry += lower[k, a] * product[k, b]
                th[a, b] = entry
        cholesky(th, 6)
        if t == 0:
            continue
        for c in range(9):
            for a in range(6):
                entry = 0.0
                for k in range(a, 6):
                    entry += lower[k, a] * mix[k, c]
                for k in range(a):
                    entry -= th[a, k] * ga[k, c]
                ga[a, c] = entry / th[a, a]
        for a in range(9):
            for b in range(a + 1):
                entry = 0.5 * (value[a, b] + value[b, a])
                for k in range(6):
                    entry -= ga[k, a] * ga[k, b]
                value[a, b] = value[b, a] = entry


@compiled
def solve(data, contact_gradient, knot_gradient, step_gradient, hessian, spread, total, mixed, theta, gain, du, dx):
    """Newton step of given gradients with the factors of `factor_contacts` and `factor_steps`.

    Args:
        data: the problem.
        contact_gradient: (C, 6), destroyed.
        knot_gradient: (N + 1, 9).
        step_gradient: (N, 15) in (x, w).
        hessian: (C, 6, 6) factored, with
        spread: of `factor_contacts`,
        total: of `factor_contacts`, and
        mixed: of `factor_steps`,
        theta: of `factor_steps`,
        gain: of `factor_steps`.
        du: (C, 6), filled.
        dx: (N + 1, 9), filled.
    """
    n = data.h.shape[0]
    shift, control = np.zeros((n, 6)), np.empty((n, 6))
    y, row_x, row_w, beta = np.empty(9), np.empty(9), np.empty(6), np.empty(6)
    for a in range(9):
        y[a] = knot_gradient[n, a]
    for t in range(n - 1, -1, -1):
        for j in range(data.first[t], data.first[t + 1]):
            g = contact_gradient[j]
            solve_lower(hessian[j], g, 6)
            for a in range(6):
                for i in range(6):
                    shift[t, a] += spread[j, i, a] * g[i]
        backward(data.h[t], y, row_x, row_w)
        mix, lower, v = mixed[t], total[t], control[t]
        for a in range(6):
            beta[a] = row_w[a] + step_gradient[t, 9 + a]
            for b in range(6):
                beta[a] -= mix[a, 9 + b] * shift[t, b]
        for a in range(6):
            v[a] = 0.0
            for k in range(a, 6):
                v[a] -= lower[k, a] * beta[k]
        solve_lower(theta[t], v, 6)
        # theta^-T is left for the forward sweep; K theta^-T v is needed here for the states' gradient.
        if t > 0:
            for a in range(6):
                beta[a] = v[a]
            solve_upper(theta[t], beta, 6)
            for a in range(6):
                row_w[a] = -shift[t, a]
                for k in range(a + 1):
                    row_w[a] += lower[a, k] * beta[k]
            for c in range(9):
                y[c] = row_x[c] + step_gradient[t, c] + knot_gradient[t, c]
                for a in range(6):
                    y[c] += mix[a, c] * row_w[a]
    dx[0] = 0.0
    for t in range(n):
        v, lower = control[t], total[t]
        if t > 0:
            for a in range(6):
                for c in range(9):
                    v[a] -= gain[t, a, c] * dx[t, c]
        solve_upper(theta[t], v, 6)
        for a in range(6):
            row_w[a] = -shift[t, a]
            for k in range(a + 1):
                row_w[a] += lower[a, k] * v[k]
        forward(data.h[t], dx[t], row_w, dx[t + 1])
        if data.first[t + 1] > data.first[t]:
            solve_upper(lower, v, 6)
        for j in range(data.first[t], data.first[t + 1]):
            for i in range(6):
                du[j, i] = -contact_gradient[j, i]
                for a in range(6):
                    du[j, i] += spread[j, i, a] * v[a]
            solve_upper(hessian[j], du[j], 6)
