"""Newton step of the whole motion by a backward and a forward sweep, linear in the number of steps.

Each contact's wrench enters the dynamics only through the sum w = sum B u, so its quadratic cost 1/2 u'H u + g'u is
eliminated first: the cost of w is 1/2 (w + w0)' S^-1 (w + w0) with S = sum B H^-1 B' and w0 = sum B H^-1 g, and
u = H^-1 (B' nu - g) with S nu = w + w0. With S = K K' and w = K y - w0 the control y has the unit Hessian, so the
sweep is over 9 states and 6 well scaled controls, however many contacts there are.
"""

from typing import NamedTuple

import numpy as np

from toolkit.centroidal.kernels.elimination import cholesky, solve_lower, solve_upper
from toolkit.compiled import compiled
from toolkit.physics.momentum import advanced


class Sweep(NamedTuple):
    """Factors of one iteration, for N steps and C contacts.

    Attributes:
        hessian: (C, 6, 6) Hessians of the contacts; `elimination.factor` turns them into their lower factors.
        spread: (C, 6, 6) hessian^-1/2 B'.
        total: (N, 6, 6) K, lower.
        mixed: (N, 6, 15) Hessian rows of w against (x, w).
        theta: (N, 6, 6) lower factor of I + K' M_ww K.
        gain: (N, 6, 9) theta^-1/2 K' M_wx.
        control: (N, 6) controls of the last right-hand side, before feedback.
    """

    hessian: np.ndarray
    spread: np.ndarray
    total: np.ndarray
    mixed: np.ndarray
    theta: np.ndarray
    gain: np.ndarray
    control: np.ndarray


@compiled(reordered=True)
def allocate(n, contacts):
    """Room for the factors of n steps."""
    return Sweep(
        np.empty((contacts, 6, 6)),
        np.empty((contacts, 6, 6)),
        np.empty((n, 6, 6)),
        np.empty((n, 6, 15)),
        np.empty((n, 6, 6)),
        np.empty((n, 6, 9)),
        np.empty((n, 6)),
    )


@compiled(reordered=True)
def forward(h, x, w, out):
    """Out = A x + B w: the dynamics' linear part, gravity's constant left out."""
    state = advanced(h, 1.0, x, w[:3], w[3:])
    for a in range(9):
        out[a] = state[a]


@compiled(reordered=True)
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


@compiled(reordered=True)
def factor_steps(data, knot_hessian, step_hessian, sweep):
    """Backward sweep of the matrices, with Hessians (N + 1, 9, 9) of knots and (N, 15, 15) of steps in (x, w)."""
    n = data.h.shape[0]
    value = np.empty((9, 9))
    for a in range(9):
        for b in range(9):
            value[a, b] = knot_hessian[n, a, b]
    columns = np.empty((15, 9))  # of V [A B], as rows
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
        hessian, mixed = step_hessian[t], sweep.mixed[t]
        for c in range(15):
            backward(h, columns[c], row_x, row_w)
            for a in range(6):
                mixed[a, c] = row_w[a] + hessian[9 + a, c]
            if c < 9:
                for a in range(9):
                    value[a, c] = row_x[a] + hessian[a, c] + knot_hessian[t, a, c]
        lower, theta, gain = sweep.total[t], sweep.theta[t], sweep.gain[t]
        for a in range(6):
            for b in range(6):
                entry = 0.0
                for k in range(b, 6):
                    entry += mixed[a, 9 + k] * lower[k, b]
                product[a, b] = entry
        for a in range(6):
            for b in range(a + 1):
                entry = 1.0 if a == b else 0.0
                for k in range(a, 6):
                    entry += lower[k, a] * product[k, b]
                theta[a, b] = entry
        cholesky(theta, 6)
        if t == 0:
            continue
        for c in range(9):
            for a in range(6):
                entry = 0.0
                for k in range(a, 6):
                    entry += lower[k, a] * mixed[k, c]
                for k in range(a):
                    entry -= theta[a, k] * gain[k, c]
                gain[a, c] = entry / theta[a, a]
        for a in range(9):
            for b in range(a + 1):
                entry = 0.5 * (value[a, b] + value[b, a])
                for k in range(6):
                    entry -= gain[k, a] * gain[k, b]
                value[a, b] = value[b, a] = entry


@compiled(reordered=True)
def sweep_back(data, contact_gradient, knot_gradient, step_gradient, sweep):
    """Backward sweep of gradients (C, 6), (N + 1, 9) and (N, 15); the contacts' are overwritten for `step_forward`."""
    n = data.h.shape[0]
    shift = np.empty(6)
    y, row_x, row_w, beta = np.empty(9), np.empty(9), np.empty(6), np.empty(6)
    for a in range(9):
        y[a] = knot_gradient[n, a]
    for t in range(n - 1, -1, -1):
        shift[:] = 0.0
        for j in range(data.first[t], data.first[t + 1]):
            g = contact_gradient[j]
            solve_lower(sweep.hessian[j], g, 6)
            for a in range(6):
                for i in range(6):
                    shift[a] += sweep.spread[j, i, a] * g[i]
        backward(data.h[t], y, row_x, row_w)
        mixed, lower, v = sweep.mixed[t], sweep.total[t], sweep.control[t]
        for a in range(6):
            beta[a] = row_w[a] + step_gradient[t, 9 + a]
            for b in range(6):
                beta[a] -= mixed[a, 9 + b] * shift[b]
        for a in range(6):
            v[a] = 0.0
            for k in range(a, 6):
                v[a] -= lower[k, a] * beta[k]
        solve_lower(sweep.theta[t], v, 6)
        # The rest of theta^-1 is left for `step_forward`; the state's gradient needs w at x = 0 now.
        if t > 0:
            for a in range(6):
                beta[a] = v[a]
            solve_upper(sweep.theta[t], beta, 6)
            for a in range(6):
                row_w[a] = -shift[a]
                for k in range(a + 1):
                    row_w[a] += lower[a, k] * beta[k]
            for c in range(9):
                y[c] = row_x[c] + step_gradient[t, c] + knot_gradient[t, c]
                for a in range(6):
                    y[c] += mixed[a, c] * row_w[a]


@compiled(reordered=True)
def step_forward(data, t, contact_gradient, sweep, dx, du):
    """Change of the wrenches of step t for a change dx (9,) of its first knot: fills du (C, 6) of its contacts."""
    v, lower = np.empty(6), sweep.total[t]
    for a in range(6):
        v[a] = sweep.control[t, a]
        if t > 0:
            for c in range(9):
                v[a] -= sweep.gain[t, a, c] * dx[c]
    solve_upper(sweep.theta[t], v, 6)
    if data.first[t + 1] > data.first[t]:
        solve_upper(lower, v, 6)
    for j in range(data.first[t], data.first[t + 1]):
        for i in range(6):
            du[j, i] = -contact_gradient[j, i]
            for a in range(6):
                du[j, i] += sweep.spread[j, i, a] * v[a]
        solve_upper(sweep.hessian[j], du[j], 6)


@compiled(reordered=True)
def total_wrench(first, wrench, t, u, w):
    """Fill w (6,) with the sum of the wrenches u (C, 6) of step t about the origin."""
    for a in range(6):
        w[a] = 0.0
    for j in range(first[t], first[t + 1]):
        for a in range(6):
            for b in range(6):
                w[a] += wrench[j, a, b] * u[j, b]


@compiled(reordered=True)
def solve(data, contact_gradient, knot_gradient, step_gradient, sweep, du, dx):
    """Newton step of given gradients, as in `sweep_back`: fills du (C, 6) and dx (N + 1, 9)."""
    sweep_back(data, contact_gradient, knot_gradient, step_gradient, sweep)
    dw = np.empty(6)
    dx[0] = 0.0
    for t in range(data.h.shape[0]):
        step_forward(data, t, contact_gradient, sweep, dx[t], du)
        total_wrench(data.first, data.wrench, t, du, dw)
        forward(data.h[t], dx[t], dw, dx[t + 1])
