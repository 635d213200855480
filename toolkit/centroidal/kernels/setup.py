"""A centroidal problem as flat arrays in scaled units.

Mass, g, 1 m and the weight are the units, so time is counted in sqrt(1 m / g) = 0.32 s; positions count from the
initial CoM. The state x = (r, v, L) has the angular momentum L about that origin; w = (F, M) is the total force and its
moment about the origin; u = (f, tau) is a contact's wrench at the centre of its patch in the contact frame,
w = sum B u. The dynamics (`toolkit.physics.momentum`) are linear in them and every constraint is convex: slack
s = offset + rows u >= 0 (force bound, CoP, yaw moment), the friction cone (mu f_z, f_x, f_y), balls (radius,
r - centre) for reach and planes offset + normal r >= 0 for height and final box.
"""

import math
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.arrays import MotionArrays
from toolkit.centroidal.kernels import knots
from toolkit.centroidal.problem import STANDARD_GRAVITY
from toolkit.compiled import compiled
from toolkit.physics.momentum import fill_wrench_map, spin
from toolkit.physics.wrench import pressure, pressure_rows, yaw_row

ROWS = 13
"""Number of linear constraints of a contact."""
SCALE = 1e-3
"""Factor on the paper's objective."""
UNBOUNDED_FORCE = 1e3
"""Bound on a normal force in weights that stands for none."""
SMALLEST = 1e-6
"""Least friction coefficient and half extent in m: cones need an inside. It is the residual check's tolerance."""


class Data(NamedTuple):
    """The arrays, for N steps, C contacts in all steps together, K balls and P planes.

    Attributes:
        h, omega: (N,) length of the step, and its weight in the objective.
        first: (N + 1,) contacts of step t are first[t] .. first[t + 1] - 1.
        rotation: (C, 3, 3) contact frames.
        wrench: (C, 6, 6) B: wrench about the origin of a unit wrench at the contact.
        mu, force_bound: (C,).
        rows, offset: (C, 13, 6), (C, 13).
        cop_weight: (C, 2).
        ball_first, ball_center, ball_radius: (N + 2,), (K, 3), (K,); balls of knots 1 .. N.
        plane_first, plane_normal, plane_offset: (N + 2,), (P, 3), (P,).
        x0: (9,) initial state.
        guess: (N + 1, 3) initial guess of the CoM, above the mean of the feet.
        rest: Whether the final velocity must vanish.
        weights: (8,) twice the scaled weights, in the order of `Weights`.
    """

    h: np.ndarray
    omega: np.ndarray
    first: np.ndarray
    rotation: np.ndarray
    wrench: np.ndarray
    mu: np.ndarray
    force_bound: np.ndarray
    rows: np.ndarray
    offset: np.ndarray
    cop_weight: np.ndarray
    ball_first: np.ndarray
    ball_center: np.ndarray
    ball_radius: np.ndarray
    plane_first: np.ndarray
    plane_normal: np.ndarray
    plane_offset: np.ndarray
    x0: np.ndarray
    guess: np.ndarray
    rest: bool
    weights: np.ndarray


@compiled(reordered=True)
def fill_row(row, out):
    """Fill a row (6,) of the constraints, in parts of what fz allows."""
    part = 1.0 / row[2]
    out[0], out[1], out[2] = part * row[0], part * row[1], 1.0
    out[3], out[4], out[5] = part * row[3], part * row[4], part * row[5]


@compiled(reordered=True)
def contact_rows(turning, x, y, bound, rows):
    """Fill the 13 rows of a contact: force bound, 4 of the CoP, 8 of the yaw moment, of friction `turning`."""
    rows[0] = 0.0
    rows[0, 2] = -1.0 / bound
    pressing = pressure_rows(x, y)
    fill_row(pressing[0], rows[1])
    fill_row(pressing[1], rows[2])
    fill_row(pressing[2], rows[3])
    fill_row(pressing[3], rows[4])
    for i in range(8):
        row = yaw_row(turning, x, y, 1.0 if i & 1 else -1.0, 1.0 if i & 2 else -1.0, 1.0 if i & 4 else -1.0)
        fill_row(row, rows[5 + i])


@compiled(reordered=True)
def pack(p):
    """A problem (`ProblemArrays`) as `Data`; also the largest violation of the first knot, in m."""
    n, total = p.dt.shape[0], p.active.sum()
    unit, weight = math.sqrt(STANDARD_GRAVITY), p.mass * STANDARD_GRAVITY
    h, omega, w = np.empty(n), np.empty(n), np.empty(8)
    first, frames, wrench = np.zeros(n + 1, np.int64), np.empty((total, 3, 3)), np.zeros((total, 6, 6))
    mu, bound, lever = np.empty(total), np.empty(total), np.empty(3)
    rows, offset, cop_weight = np.empty((total, ROWS, 6)), np.zeros((total, ROWS)), np.zeros((total, 2))
    for i in range(8):
        w[i] = 2.0 * SCALE * p.weights[i]
        if i == 0 or i == 2:
            w[i] *= p.mass * p.mass * STANDARD_GRAVITY
        elif i == 1 or i == 3 or i == 5:
            w[i] *= weight**2
    j = 0
    for t in range(n):
        h[t], omega[t] = p.dt[t] * unit, p.dt[t] / 0.2
        first[t] = j
        for i in range(4):
            if not p.active[t, i]:
                continue
            for a in range(3):
                lever[a] = p.position[t, i, a] - p.com[a]
            frames[j] = p.rotation[t, i]
            fill_wrench_map(frames[j], lever, wrench[j])
            mu[j] = max(p.friction[t, i] * p.friction_margin, SMALLEST)
            bound[j] = min(p.max_normal_force[i] / weight, UNBOUNDED_FORCE)
            x, y = max(p.reduced_half_size[i, 0], SMALLEST), max(p.reduced_half_size[i, 1], SMALLEST)
            contact_rows(max(p.yaw_margin * mu[j], SMALLEST), x, y, bound[j], rows[j])
            offset[j, 0] = 1.0
            for a in range(2):
                if p.half_size[i, a] > 0.0:
                    cop_weight[j, a] = w[7] / (2.0 * p.half_size[i, a]) ** 2
            j += 1
    first[n] = j

    ball_first, ball_center, ball_radius, lowest = knots.balls(p, 2 * total + 1)
    # The first knot is given, so its violation is reported instead of constrained.
    violation = max(0.0, lowest[0] + p.min_height - p.com[2]) if lowest[0] < np.inf else 0.0
    for k in range(ball_first[1]):
        c = ball_center[k]
        violation = max(violation, math.sqrt(c[0] ** 2 + c[1] ** 2 + c[2] ** 2) - ball_radius[k])
    skipped = ball_first[1]
    for knot in range(n + 2):
        ball_first[knot] = max(ball_first[knot] - skipped, 0)
    plane_first, plane_normal, plane_offset = knots.planes(p, lowest)
    x0 = np.zeros(9)
    for a in range(3):
        x0[3 + a] = p.com_velocity[a] / unit
        x0[6 + a] = p.angular_momentum[a] / (p.mass * unit)
    data = Data(
        h,
        omega,
        first,
        frames,
        wrench,
        mu,
        bound,
        rows,
        offset,
        cop_weight,
        ball_first,
        ball_center[skipped : skipped + ball_first[n + 1]],
        ball_radius[skipped : skipped + ball_first[n + 1]],
        plane_first,
        plane_normal[: plane_first[n + 1]],
        plane_offset[: plane_first[n + 1]],
        x0,
        knots.guess(p),
        p.final_at_rest,
        w,
    )
    return data, violation


@compiled(reordered=True)
def unpack(p, data, u, x):
    """Knots (N + 1, 9) and contact wrenches (C, 6) of a problem in SI units, as `MotionArrays`."""
    n = data.h.shape[0]
    unit, weight = math.sqrt(STANDARD_GRAVITY), p.mass * STANDARD_GRAVITY
    com, linear, angular = np.empty((n + 1, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3))
    for t in range(n + 1):
        k = spin(x[t])
        for a in range(3):
            com[t, a] = x[t, a] + p.com[a]
            linear[t, a] = p.mass * unit * x[t, 3 + a]
            angular[t, a] = p.mass * unit * k[a]
    force, cop, torque = np.zeros((n, 4, 3)), np.zeros((n, 4, 2)), np.zeros((n, 4))
    j = 0
    for t in range(n):
        for i in range(4):
            if not p.active[t, i]:
                continue
            r = data.rotation[j]
            for a in range(3):
                force[t, i, a] = weight * (r[a, 0] * u[j, 0] + r[a, 1] * u[j, 1] + r[a, 2] * u[j, 2])
            cop_x, cop_y, twist = pressure(u[j], u[j, 2] if u[j, 2] > 0.0 else np.inf)
            cop[t, i, 0], cop[t, i, 1], torque[t, i] = cop_x, cop_y, weight * twist
            j += 1
    return MotionArrays(com, linear, angular, force, cop, torque)
