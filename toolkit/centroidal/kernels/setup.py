"""A centroidal problem as flat arrays in scaled units.

Mass, g, 1 m and the weight are the units, so time is counted in sqrt(1 m / g) = 0.32 s; positions count from the
initial CoM. The state x = (r, v, L) has the angular momentum L about that origin; w = (F, M) is the total force and its
moment about the origin; u = (f, tau) is a contact's wrench at the centre of its patch in the contact frame,
w = sum B u. Then

    r' = r + h v + h^2/2 (F + g),   v' = v + h (F + g),   L' = L + h M + (h r + h^2/2 v + h^3/6 F) x g

is linear and every constraint is convex: slack s = offset + rows u >= 0 (force bound, CoP, yaw moment), the friction
cone (mu f_z, f_x, f_y), balls (radius, r - centre) for reach and planes offset + normal r >= 0 for height and final
box.
"""

import math
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.kernels import knots
from toolkit.centroidal.problem import STANDARD_GRAVITY
from toolkit.compiled import compiled

ROWS = 13
"""Linear constraints of a contact."""
SCALE = 1e-3
"""Factor on the paper's objective."""
UNBOUNDED_FORCE = 1e3
"""Weights; stands for no bound on a normal force."""
SMALLEST = 1e-6
"""Least friction coefficient and half extent in m: cones need an inside. It is the residual check's tolerance."""


class Data(NamedTuple):
    """The arrays, for N steps, C contacts in all steps together, K balls and P planes.

    Attributes:
        h, omega: (N,) step length; weight of the step in the objective.
        first: (N + 1,) contacts of step t are first[t] .. first[t + 1].
        rotation: (C, 3, 3) contact frames.
        wrench: (C, 6, 6) B: wrench about the origin of a unit wrench at the contact.
        mu, force_bound: (C,).
        rows, offset: (C, 13, 6), (C, 13).
        cop_weight: (C, 2).
        ball_first, ball_center, ball_radius: (N + 2,), (K, 3), (K,); of knots 1 .. N.
        plane_first, plane_normal, plane_offset: (N + 2,), (P, 3), (P,).
        x0: (9,) initial state.
        guess: (N + 1, 3) CoM to start from, above the mean of the feet.
        rest: final velocity must vanish.
        weights: (8,) scaled, in the order of `Weights`, times 2.
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
def contact_rows(mu, x, y, bound, yaw, rows):
    """Fill the 13 rows of a contact: force bound, 4 of the CoP, 8 of the yaw moment (Caron et al. 2015)."""
    rows[:] = 0.0
    rows[0, 2] = -1.0 / bound
    for i in range(4):
        rows[1 + i, 2] = 1.0
    rows[1, 3], rows[2, 3] = 1.0 / y, -1.0 / y
    rows[3, 4], rows[4, 4] = 1.0 / x, -1.0 / x
    scale = 1.0 / (mu * (x + y))
    for i in range(8):
        sign = 1.0 if i & 4 else -1.0
        a = 1.0 if i & 1 else -1.0
        b = 1.0 if i & 2 else -1.0
        rows[5 + i, 0], rows[5 + i, 1], rows[5 + i, 2] = -a * y * scale, -b * x * scale, 1.0
        rows[5 + i, 3], rows[5 + i, 4] = -a * sign * mu * scale, -b * sign * mu * scale
        rows[5 + i, 5] = -sign * scale / yaw


@compiled(reordered=True)
def pack(
    mass,
    dt,
    active,
    position,
    rotation,
    friction,
    half_size,
    reduced_half_size,
    max_normal_force,
    yaw,
    com,
    com_velocity,
    angular_momentum,
    root_in_com,
    tip_in_contact,
    max_reach,
    min_height,
    final_center,
    final_half_size,
    rest,
    weights,
    friction_margin,
    yaw_margin,
    landing_limb,
    landing_position,
    landing_rotation,
):
    """The problem's arrays (see `CentroidalProblem`) as `Data`; also the largest violation of the first knot, in m."""
    n, total = dt.shape[0], 0
    for t in range(n):
        for i in range(4):
            total += active[t, i]
    unit = math.sqrt(STANDARD_GRAVITY)
    h, omega, w = np.empty(n), np.empty(n), np.empty(8)
    first, frames, wrench = np.zeros(n + 1, np.int64), np.empty((total, 3, 3)), np.zeros((total, 6, 6))
    mu, bound, lever = np.empty(total), np.empty(total), np.empty(3)
    rows, offset, cop_weight = np.empty((total, ROWS, 6)), np.zeros((total, ROWS)), np.zeros((total, 2))
    for i in range(8):
        w[i] = 2.0 * SCALE * weights[i]
        if i == 0 or i == 2:
            w[i] *= mass * mass * STANDARD_GRAVITY
        elif i == 1 or i == 3 or i == 5:
            w[i] *= (mass * STANDARD_GRAVITY) ** 2
    j = 0
    for t in range(n):
        h[t], omega[t] = dt[t] * unit, dt[t] / 0.2
        first[t] = j
        for i in range(4):
            if not active[t, i]:
                continue
            for a in range(3):
                lever[a] = position[t, i, a] - com[a]
                for b in range(3):
                    frames[j, a, b] = rotation[t, i, a, b]
            for b in range(3):
                for a in range(3):
                    c, e = (a + 1) % 3, (a + 2) % 3
                    wrench[j, a, b] = wrench[j, 3 + a, 3 + b] = frames[j, a, b]
                    wrench[j, 3 + a, b] = lever[c] * frames[j, e, b] - lever[e] * frames[j, c, b]
            mu[j] = max(friction[t, i] * friction_margin, SMALLEST)
            bound[j] = min(max_normal_force[i] / (mass * STANDARD_GRAVITY), UNBOUNDED_FORCE)
            x, y = max(reduced_half_size[i, 0], SMALLEST), max(reduced_half_size[i, 1], SMALLEST)
            contact_rows(mu[j], x, y, bound[j], max(yaw_margin, SMALLEST), rows[j])
            offset[j, 0] = 1.0
            for a in range(2):
                if half_size[i, a] > 0.0:
                    cop_weight[j, a] = w[7] / (2.0 * half_size[i, a]) ** 2
            j += 1
    first[n] = j

    ball_first, ball_center, ball_radius = (
        np.zeros(n + 2, np.int64),
        np.empty((2 * total + 1, 3)),
        np.empty(2 * total + 1),
    )
    plane_first, plane_normal, plane_offset = np.zeros(n + 2, np.int64), np.zeros((n + 7, 3)), np.empty(n + 7)
    lowest = np.full(n + 1, np.inf)
    knots.reach(
        active,
        position,
        rotation,
        yaw,
        com,
        root_in_com,
        tip_in_contact,
        max_reach,
        landing_limb,
        landing_position,
        landing_rotation,
        ball_first,
        ball_center,
        ball_radius,
        lowest,
    )
    # The initial CoM is the origin: what it violates is no constraint of the program.
    violation = max(0.0, lowest[0] + min_height - com[2]) if lowest[0] < np.inf else 0.0
    for k in range(ball_first[1]):
        c = ball_center[k]
        violation = max(violation, math.sqrt(c[0] ** 2 + c[1] ** 2 + c[2] ** 2) - ball_radius[k])
    skipped = ball_first[1]
    for knot in range(n + 2):
        ball_first[knot] = max(ball_first[knot] - skipped, 0)
    knots.planes(
        lowest, min_height, yaw[n], com, final_center, final_half_size, plane_first, plane_normal, plane_offset
    )
    x0 = np.zeros(9)
    for a in range(3):
        x0[3 + a] = com_velocity[a] / unit
        x0[6 + a] = angular_momentum[a] / (mass * unit)
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
        knots.guess(active, position, com, final_center),
        rest,
        w,
    )
    return data, violation


@compiled(reordered=True)
def unpack(data, active, mass, com, u, x):
    """Knots and contact forces in SI units, as in `CentroidalMotion`: com, linear, angular, force, cop, yaw torque."""
    n = data.h.shape[0]
    unit, weight = math.sqrt(STANDARD_GRAVITY), mass * STANDARD_GRAVITY
    place, linear, angular = np.empty((n + 1, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3))
    for t in range(n + 1):
        r, v = x[t, :3], x[t, 3:6]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            place[t, a] = r[a] + com[a]
            linear[t, a] = mass * unit * v[a]
            angular[t, a] = mass * unit * (x[t, 6 + a] - (r[b] * v[c] - r[c] * v[b]))
    force, cop, torque = np.zeros((n, 4, 3)), np.zeros((n, 4, 2)), np.zeros((n, 4))
    j = 0
    for t in range(n):
        for i in range(4):
            if not active[t, i]:
                continue
            r = data.rotation[j]
            for a in range(3):
                force[t, i, a] = weight * (r[a, 0] * u[j, 0] + r[a, 1] * u[j, 1] + r[a, 2] * u[j, 2])
            inverse = 1.0 / u[j, 2] if u[j, 2] > 0.0 else 0.0
            cop[t, i, 0], cop[t, i, 1] = -u[j, 4] * inverse, u[j, 3] * inverse
            torque[t, i] = weight * (u[j, 5] + (u[j, 4] * u[j, 1] + u[j, 3] * u[j, 0]) * inverse)
            j += 1
    return place, linear, angular, force, cop, torque
