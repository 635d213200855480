"""Second-order cones { s in R^4 : s_0 >= |s_1..3| } with the Nesterov-Todd scaling.

W is the symmetric scaling with W z = W^-1 s = lambda; it is kept as a unit hyperbolic vector w and a factor eta:
W = eta [w_0, w_1'; w_1, I + w_1 w_1' / (1 + w_0)]. A friction cone is one with a zero as its last entry.

Reference: L. Vandenberghe, The CVXOPT linear and quadratic cone program solvers (2010), Sec. 4.
"""

import math

from toolkit.compiled import compiled


@compiled(reordered=True)
def norm_squared(x):
    """x_0^2 - |x_1..3|^2 as a product, which keeps its digits near the boundary."""
    tail = math.sqrt(x[1] * x[1] + x[2] * x[2] + x[3] * x[3])
    return (x[0] - tail) * (x[0] + tail)


@compiled(reordered=True)
def scale(s, z, w, lam):
    """Scaling of an interior pair (s, z): fills w (4,) and lam (4,), returns eta."""
    ss, zz = math.sqrt(max(norm_squared(s), 1e-300)), math.sqrt(max(norm_squared(z), 1e-300))
    dot = (s[0] * z[0] + s[1] * z[1] + s[2] * z[2] + s[3] * z[3]) / (ss * zz)
    gamma = 2.0 * math.sqrt(0.5 * (1.0 + dot))
    w[0] = (s[0] / ss + z[0] / zz) / gamma
    for i in range(1, 4):
        w[i] = (s[i] / ss - z[i] / zz) / gamma
    eta = math.sqrt(ss / zz)
    multiply(w, eta, z, lam)
    return eta


@compiled(reordered=True)
def multiply(w, eta, x, out):
    """Out = W x."""
    dot = w[1] * x[1] + w[2] * x[2] + w[3] * x[3]
    factor = x[0] + dot / (1.0 + w[0])
    first = eta * (w[0] * x[0] + dot)
    for i in range(1, 4):
        out[i] = eta * (x[i] + factor * w[i])
    out[0] = first


@compiled(reordered=True)
def divide(w, eta, x, out):
    """Out = W^-1 x."""
    dot = w[1] * x[1] + w[2] * x[2] + w[3] * x[3]
    factor = -x[0] + dot / (1.0 + w[0])
    first = (w[0] * x[0] - dot) / eta
    for i in range(1, 4):
        out[i] = (x[i] + factor * w[i]) / eta
    out[0] = first


@compiled(reordered=True)
def divide_twice(w, eta, x, out):
    """Out = W^-2 x = (2 J w (J w)' - J) x / eta^2."""
    dot = 2.0 * (w[0] * x[0] - w[1] * x[1] - w[2] * x[2] - w[3] * x[3])
    inverse = 1.0 / (eta * eta)
    out[0] = (dot * w[0] - x[0]) * inverse
    for i in range(1, 4):
        out[i] = (x[i] - dot * w[i]) * inverse


@compiled(reordered=True)
def jordan_multiply(x, y, out):
    """Out = x o y, the Jordan product (x'y, x_0 y_1 + y_0 x_1)."""
    first = x[0] * y[0]
    for i in range(1, 4):
        first += x[i] * y[i]
        out[i] = x[0] * y[i] + y[0] * x[i]
    out[0] = first


@compiled(reordered=True)
def jordan_divide(lam, d, out):
    """Out with lam o out = d."""
    dot = lam[1] * d[1] + lam[2] * d[2] + lam[3] * d[3]
    first = (lam[0] * d[0] - dot) / max(norm_squared(lam), 1e-300)
    for i in range(1, 4):
        out[i] = (d[i] - first * lam[i]) / lam[0]
    out[0] = first


@compiled(reordered=True)
def longest_step(s, ds):
    """Largest step t <= 1e10 with s + t ds in the cone, for s inside."""
    a = ds[0] * ds[0] - ds[1] * ds[1] - ds[2] * ds[2] - ds[3] * ds[3]
    b = s[0] * ds[0] - s[1] * ds[1] - s[2] * ds[2] - s[3] * ds[3]
    c = norm_squared(s)
    if c <= 0.0:
        return 0.0
    step = 1e10
    if ds[0] < 0.0:
        step = -s[0] / ds[0]
    # The first positive root of a t^2 + 2 b t + c.
    discriminant = b * b - a * c
    if discriminant >= 0.0:
        root = -b + math.sqrt(discriminant) if b <= 0.0 else -b - math.sqrt(discriminant)
        # Roots: root / a and c / root.
        if root != 0.0:
            t = c / root
            if t > 0.0:
                step = min(step, t)
        if a != 0.0:
            t = root / a
            if t > 0.0:
                step = min(step, t)
    return step
