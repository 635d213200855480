"""The objective as weighted least squares: residuals, gradient and Gauss-Newton Hessian.

The contacts' terms depend on one wrench each; the momenta's on a knot's state or on a step's (x, w). With the CoM
averaged over a step, rbar = r + h/2 v + h^2/6 g, the rate of the angular momentum about the CoM is M - rbar x F.
"""

import numpy as np

from toolkit.centroidal.kernels import riccati
from toolkit.compiled import compiled
from toolkit.physics.momentum import advanced, mean_com, spin, spin_rate
from toolkit.physics.wrench import pressure


@compiled(reordered=True)
def advance(h, x, w, out):
    """Fill the knot `out` (9,) after a step of length h from x (9,) under the total wrench w (6,)."""
    state = advanced(h, 1.0, x, (w[0], w[1], w[2] - 1.0), w[3:])
    for a in range(9):
        out[a] = state[a]


@compiled(reordered=True)
def rollout(data, u, x, w):
    """Fill the knots x (N + 1, 9) and the total wrenches w (N, 6) of contact wrenches u (C, 6)."""
    for a in range(9):
        x[0, a] = data.x0[a]
    for t in range(data.h.shape[0]):
        riccati.total_wrench(data.first, data.wrench, t, u, w[t])
        advance(data.h[t], x[t], w[t], x[t + 1])


@compiled(reordered=True)
def contact_terms(omega, weights, cop_weight, u, gradient, hessian):
    """Gradient (6,) and Gauss-Newton Hessian (6, 6) of a contact's terms; returns their value."""
    weight_f, weight_lateral, weight_torque = omega * weights[4], omega * weights[6], omega * weights[5]
    weight_x, weight_y = omega * cop_weight[0], omega * cop_weight[1]
    inverse = 1.0 / u[2]
    cop_x, cop_y, twist = pressure(u, u[2])
    # Row of the twist: d tau_n / d (fx, fy, fz, tx, ty, tz).
    row = np.empty(6)
    row[0], row[1], row[2] = u[3] * inverse, u[4] * inverse, -(twist - u[5]) * inverse
    row[3], row[4], row[5] = u[0] * inverse, u[1] * inverse, 1.0
    for a in range(6):
        gradient[a] = weight_torque * twist * row[a]
        for b in range(6):
            hessian[a, b] = weight_torque * row[a] * row[b]
    lateral = weight_f + weight_lateral
    gradient[0] += lateral * u[0]
    gradient[1] += lateral * u[1]
    gradient[2] += weight_f * u[2] - (weight_x * cop_x * cop_x + weight_y * cop_y * cop_y) * inverse
    gradient[4] -= weight_x * cop_x * inverse
    gradient[3] += weight_y * cop_y * inverse
    hessian[0, 0] += lateral
    hessian[1, 1] += lateral
    square = inverse * inverse
    hessian[2, 2] += weight_f + (weight_x * cop_x * cop_x + weight_y * cop_y * cop_y) * square
    hessian[4, 4] += weight_x * square
    hessian[3, 3] += weight_y * square
    hessian[2, 4] += weight_x * cop_x * square
    hessian[4, 2] += weight_x * cop_x * square
    hessian[2, 3] -= weight_y * cop_y * square
    hessian[3, 2] -= weight_y * cop_y * square
    value = lateral * (u[0] * u[0] + u[1] * u[1]) + weight_f * u[2] * u[2] + weight_torque * twist * twist
    return 0.5 * (value + weight_x * cop_x * cop_x + weight_y * cop_y * cop_y)


@compiled(reordered=True)
def knot_terms(omega, weights, x, gradient, hessian):
    """Add to gradient (9,) and Hessian (9, 9) the terms |l|^2 and |k|^2 of a knot x, k = L - r x v; returns them."""
    wl, wk = omega * weights[0], omega * weights[2]
    k = spin(x)
    jacobian = np.zeros((3, 9))
    # dk = dL + v x dr - r x dv
    for c in range(2):
        base, sign = (0, 1.0) if c == 0 else (3, -1.0)
        other = 3 - base
        jacobian[0, base + 1], jacobian[0, base + 2] = -sign * x[other + 2], sign * x[other + 1]
        jacobian[1, base], jacobian[1, base + 2] = sign * x[other + 2], -sign * x[other]
        jacobian[2, base], jacobian[2, base + 1] = -sign * x[other + 1], sign * x[other]
    value = 0.0
    for c in range(3):
        jacobian[c, 6 + c] = 1.0
        gradient[3 + c] += wl * x[3 + c]
        hessian[3 + c, 3 + c] += wl
        value += wl * x[3 + c] * x[3 + c] + wk * k[c] * k[c]
        for a in range(9):
            scaled = wk * jacobian[c, a]
            gradient[a] += scaled * k[c]
            for b in range(9):
                hessian[a, b] += scaled * jacobian[c, b]
    return 0.5 * value


@compiled(reordered=True)
def step_terms(h, omega, weights, x, w, gradient, hessian):
    """Gradient (15,) and Hessian (15, 15) in (x, w) of the terms |l'|^2 and |k'|^2 of a step; returns their value."""
    wl, wk = omega * weights[1], omega * weights[3]
    mean, rate = mean_com(h, 1.0, x), spin_rate(h, 1.0, x, w, w[3:])
    # d rate = dM - mean x dF + F x (dr + h/2 dv)
    jacobian = np.zeros((3, 15))
    jacobian[0, 1], jacobian[0, 2] = -w[2], w[1]
    jacobian[1, 0], jacobian[1, 2] = w[2], -w[0]
    jacobian[2, 0], jacobian[2, 1] = -w[1], w[0]
    jacobian[0, 10], jacobian[0, 11] = mean[2], -mean[1]
    jacobian[1, 9], jacobian[1, 11] = -mean[2], mean[0]
    jacobian[2, 9], jacobian[2, 10] = mean[1], -mean[0]
    gradient[:] = 0.0
    hessian[:] = 0.0
    value = 0.0
    for c in range(3):
        jacobian[c, 12 + c] = 1.0
        for a in range(3):
            jacobian[c, 3 + a] = 0.5 * h * jacobian[c, a]
        linear = w[c] - (1.0 if c == 2 else 0.0)
        value += wl * linear * linear + wk * rate[c] * rate[c]
        for a in range(15):
            scaled = wk * jacobian[c, a]
            gradient[a] += scaled * rate[c]
            for b in range(15):
                hessian[a, b] += scaled * jacobian[c, b]
        gradient[9 + c] += wl * linear
        hessian[9 + c, 9 + c] += wl
    return 0.5 * value


@compiled(reordered=True)
def value(data, u, x, w):
    """The objective alone."""
    total = 0.0
    weights = data.weights
    for t in range(data.h.shape[0]):
        step = 0.0
        for j in range(data.first[t], data.first[t + 1]):
            fx, fy, fz = u[j, 0], u[j, 1], u[j, 2]
            cop_x, cop_y, twist = pressure(u[j], fz)
            step += weights[4] * (fx * fx + fy * fy + fz * fz) + weights[6] * (fx * fx + fy * fy)
            step += weights[5] * twist * twist
            step += data.cop_weight[j, 0] * cop_x * cop_x + data.cop_weight[j, 1] * cop_y * cop_y
        k, rate = spin(x[t + 1]), spin_rate(data.h[t], 1.0, x[t], w[t], w[t, 3:])
        for a in range(3):
            v, linear = x[t + 1, 3 + a], w[t, a] - (1.0 if a == 2 else 0.0)
            step += weights[0] * v * v + weights[1] * linear * linear
            step += weights[2] * k[a] * k[a] + weights[3] * rate[a] * rate[a]
        total += 0.5 * data.omega[t] * step
    return total
