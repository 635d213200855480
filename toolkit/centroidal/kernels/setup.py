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

from toolkit.centroidal.kernels import compiled

ROWS = 13
"""Linear constraints of a contact."""
SCALE = 1e-3
"""Factor on the paper's objective."""
UNBOUNDED_FORCE = 1e3
"""Weights; stands for no bound on a normal force."""


class Data(NamedTuple):
    """The arrays, for N steps, C contacts in all steps together, K balls and P planes.

    Attributes:
        h, omega: (N,) step length; weight of the step in the objective.
        first: (N + 1,) contacts of step t are first[t] .. first[t + 1].
        place, rotation: (C, 3), (C, 3, 3) contact frames.
        wrench: (C, 6, 6) B: wrench about the origin of a unit wrench at the contact.
        mu, force_bound: (C,).
        rows, offset: (C, 13, 6), (C, 13).
        cop_weight: (C, 2).
        ball_first, ball_center, ball_radius: (N + 2,), (K, 3), (K,); knots 1 .. N.
        plane_first, plane_normal, plane_offset: (N + 2,), (P, 3), (P,).
        x0: (9,) initial state.
        guess: (N + 1, 3) CoM to start from, above the mean of the feet.
        rest: final velocity must vanish.
        weights: (8,) scaled, in the order of `Weights`, times 2.
    """

    h: np.ndarray
    omega: np.ndarray
    first: np.ndarray
    place: np.ndarray
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


@compiled
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


@compiled
def _rotate(rotation, vector, out):
    for i in range(3):
        out[i] = rotation[i, 0] * vector[0] + rotation[i, 1] * vector[1] + rotation[i, 2] * vector[2]


@compiled
def _ball(data_center, data_radius, k, place, rotation, tip, root, cos, sin, com, reach):
    """Enter the ball of a contact's reach for the CoM; k counts on."""
    _rotate(rotation, tip, data_center[k])
    c = data_center[k]
    c[0] += place[0] - (cos * root[0] - sin * root[1]) - com[0]
    c[1] += place[1] - (sin * root[0] + cos * root[1]) - com[1]
    c[2] += place[2] - root[2] - com[2]
    data_radius[k] = reach
    return k + 1


@compiled
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
    gravity = 9.81
    n = dt.shape[0]
    total = 0
    for t in range(n):
        for i in range(4):
            total += active[t, i]
    unit = math.sqrt(gravity)
    h, omega = np.empty(n), np.empty(n)
    first = np.zeros(n + 1, np.int64)
    c_place, c_rotation, c_wrench = np.empty((total, 3)), np.empty((total, 3, 3)), np.zeros((total, 6, 6))
    mu, bound = np.empty(total), np.empty(total)
    rows, offset, cop_weight = np.empty((total, ROWS, 6)), np.zeros((total, ROWS)), np.zeros((total, 2))
    w = np.empty(8)
    squares = (mass * mass * gravity, (mass * gravity) ** 2)
    for i in range(8):
        w[i] = 2.0 * SCALE * weights[i]
    w[0] *= squares[0]
    w[1] *= squares[1]
    w[2] *= squares[0]
    w[3] *= squares[1]
    w[5] *= squares[1]

    j = 0
    for t in range(n):
        h[t], omega[t] = dt[t] * unit, dt[t] / 0.2
        first[t] = j
        for i in range(4):
            if not active[t, i]:
                continue
            for a in range(3):
                c_place[j, a] = position[t, i, a] - com[a]
                for b in range(3):
                    c_rotation[j, a, b] = rotation[t, i, a, b]
            p, r, wrench = c_place[j], c_rotation[j], c_wrench[j]
            for b in range(3):
                for a in range(3):
                    wrench[a, b] = wrench[3 + a, 3 + b] = r[a, b]
                wrench[3, b] = p[1] * r[2, b] - p[2] * r[1, b]
                wrench[4, b] = p[2] * r[0, b] - p[0] * r[2, b]
                wrench[5, b] = p[0] * r[1, b] - p[1] * r[0, b]
            mu[j] = max(friction[t, i] * friction_margin, 1e-6)
            bound[j] = min(max_normal_force[i] / (mass * gravity), UNBOUNDED_FORCE)
            x, y = max(reduced_half_size[i, 0], 1e-6), max(reduced_half_size[i, 1], 1e-6)
            contact_rows(mu[j], x, y, bound[j], max(yaw_margin, 1e-6), rows[j])
            offset[j, 0] = 1.0
            for a in range(2):
                if half_size[i, a] > 0.0:
                    cop_weight[j, a] = w[7] / (2.0 * half_size[i, a]) ** 2
            j += 1
    first[n] = j

    ball_center, ball_radius = np.empty((2 * total + 1, 3)), np.empty(2 * total + 1)
    plane_normal, plane_offset = np.zeros((n + 7, 3)), np.empty(n + 7)
    ball_first, plane_first = np.zeros(n + 2, np.int64), np.zeros(n + 2, np.int64)
    k = p = 0
    violation = 0.0
    for knot in range(n + 1):
        ball_first[knot], plane_first[knot] = k, p
        cos, sin = math.cos(yaw[knot]), math.sin(yaw[knot])
        low = np.inf
        begin = k
        for t in (knot - 1, knot):
            if t < 0 or t >= n:
                continue
            for i in range(4):
                if not active[t, i]:
                    continue
                if i < 2:
                    low = min(low, position[t, i, 2])
                if t == knot and knot > 0 and active[t - 1, i]:
                    change = 0.0
                    for a in range(3):
                        change = max(change, abs(position[t, i, a] - position[t - 1, i, a]))
                        for b in range(3):
                            change = max(change, abs(rotation[t, i, a, b] - rotation[t - 1, i, a, b]))
                    if change == 0.0:
                        continue  # the same ball again
                args = (tip_in_contact[i], root_in_com[i], cos, sin, com, max_reach[i])
                k = _ball(ball_center, ball_radius, k, position[t, i], rotation[t, i], *args)
        if knot == n and landing_limb >= 0:
            i = landing_limb
            if i < 2:
                low = min(low, landing_position[2])
            args = (tip_in_contact[i], root_in_com[i], cos, sin, com, max_reach[i])
            k = _ball(ball_center, ball_radius, k, landing_position, landing_rotation, *args)
        floor = low + min_height - com[2] if low < np.inf else -np.inf
        if knot == 0:  # the initial CoM is the origin: judged here, no constraint of the program
            violation = max(violation, floor)
            for b in range(begin, k):
                c = ball_center[b]
                violation = max(violation, math.sqrt(c[0] ** 2 + c[1] ** 2 + c[2] ** 2) - ball_radius[b])
            k = 0
        elif low < np.inf:
            plane_normal[p, 2] = 1.0
            plane_offset[p] = -floor
            p += 1
    cos, sin = math.cos(yaw[n]), math.sin(yaw[n])
    axes = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    for a in range(3):
        for sign in (-1.0, 1.0):
            value = final_half_size[a]
            for b in range(3):
                plane_normal[p, b] = sign * axes[a, b]
                value -= sign * axes[a, b] * (final_center[b] - com[b])
            plane_offset[p] = value
            p += 1
    ball_first[n + 1], plane_first[n + 1] = k, p
    x0 = np.zeros(9)
    for a in range(3):
        x0[3 + a] = com_velocity[a] / unit
        x0[6 + a] = angular_momentum[a] / (mass * unit)
    guess = np.zeros((n + 1, 3))
    for knot in range(n):
        for a in range(3):
            for i in range(2):
                guess[knot, a] += 0.5 * (position[knot, i, a] - position[0, i, a])
    for a in range(3):
        guess[n, a] = final_center[a] - com[a]
    data = Data(
        h,
        omega,
        first,
        c_place,
        c_rotation,
        c_wrench,
        mu,
        bound,
        rows,
        offset,
        cop_weight,
        ball_first,
        ball_center[:k],
        ball_radius[:k],
        plane_first,
        plane_normal[:p],
        plane_offset[:p],
        x0,
        guess,
        rest,
        w,
    )
    return data, violation


@compiled
def unpack(data, active, mass, com, u, x):
    """Knots and contact forces in SI units, as in `CentroidalMotion`: com, linear, angular, force, cop, yaw torque."""
    n = data.h.shape[0]
    unit, weight = math.sqrt(9.81), mass * 9.81
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
            _rotate(data.rotation[j], u[j], force[t, i])
            for a in range(3):
                force[t, i, a] *= weight
            inverse = 1.0 / u[j, 2] if u[j, 2] > 0.0 else 0.0
            cop[t, i, 0], cop[t, i, 1] = -u[j, 4] * inverse, u[j, 3] * inverse
            torque[t, i] = weight * (u[j, 5] + (u[j, 4] * u[j, 1] + u[j, 3] * u[j, 0]) * inverse)
            j += 1
    return place, linear, angular, force, cop, torque
