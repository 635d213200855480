"""Compiled twin of `toolkit.centroidal.residual`, for labelling transitions in bulk.

The same quantities from the same formulas in one pass over the steps: about 10 microseconds a motion instead of 500.
`residual` stays the reference; tests hold this module against it, motions that violate something included.
"""

from __future__ import annotations

import math
from dataclasses import astuple

import numpy as np

from toolkit.centroidal.fast import Arrays
from toolkit.centroidal.problem import STANDARD_GRAVITY, CentroidalProblem
from toolkit.compiled import compiled


def residual_and_objective(problem: CentroidalProblem, motion: Arrays) -> tuple[float, float]:
    """Largest residual and objective of a motion.

    Args:
        problem: what it is a motion of.
        motion: CoM (N + 1, 3), linear (N + 1, 3) and angular momentum (N + 1, 3), force (N, 4, 3), CoP (N, 4, 2) and
            yaw torque (N, 4), contiguous float, as in `CentroidalMotion`.

    Returns:
        `residual.check(motion).largest`, inf where something is undefined, and `residual.objective(motion)`.
    """
    p = problem
    landing = p.landing_limb >= 0
    return _evaluate(
        *motion,
        p.mass,
        p.dt,
        p.active,
        p.position,
        p.rotation,
        p.margins.friction * p.friction,
        p.half_size,
        p.reduced_half_size,
        p.max_normal_force,
        p.yaw,
        p.com,
        p.com_velocity,
        p.angular_momentum,
        p.root_in_com,
        p.tip_in_contact,
        p.max_reach,
        p.min_height,
        p.final_center,
        p.final_half_size,
        p.final_at_rest,
        p.margins.yaw,
        p.landing_limb,
        p.landing_position if landing else _NOWHERE,
        p.landing_rotation if landing else _UPRIGHT,
        astuple(p.weights),
    )


_NOWHERE, _UPRIGHT = np.zeros(3), np.eye(3)


@compiled(kept=True)
def _reach(worst, com, place, rotation, tip, root, yaw, bound):
    """`worst`, or how much further than `bound` the tip is from the root where that is more."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    square = 0.0
    for a in range(3):
        end = place[a] + rotation[a, 0] * tip[0] + rotation[a, 1] * tip[1] + rotation[a, 2] * tip[2]
        if a == 0:
            begin = com[0] + cos * root[0] - sin * root[1]
        elif a == 1:
            begin = com[1] + sin * root[0] + cos * root[1]
        else:
            begin = com[2] + root[2]
        square += (end - begin) ** 2
    return max(worst, math.sqrt(square) - bound)


@compiled(kept=True)
def _evaluate(
    com,
    linear,
    angular,
    force,
    cop,
    torque,
    mass,
    dt,
    active,
    position,
    rotation,
    friction,
    half_size,
    reduced,
    max_force,
    yaw,
    com0,
    velocity0,
    angular0,
    root,
    tip,
    reach,
    min_height,
    centre,
    box,
    at_rest,
    yaw_margin,
    landing_limb,
    landing_position,
    landing_rotation,
    weights,
):
    n, weight = dt.shape[0], mass * STANDARD_GRAVITY
    for array in (com, linear, angular, force.reshape(-1, 3), cop.reshape(-1, 2), torque):
        for value in array.flat:
            if not math.isfinite(value):
                return np.inf, np.inf
    worst, objective = 0.0, 0.0
    for a in range(3):
        worst = max(worst, abs(com[0, a] - com0[a]), abs(linear[0, a] / mass - velocity0[a]))
        worst = max(worst, abs(angular[0, a] - angular0[a]) / mass)
        if at_rest:
            worst = max(worst, abs(linear[n, a]) / mass)
    total, moment, acceleration = np.empty(3), np.empty(3), np.empty(3)
    mean, arm, local = np.empty(3), np.empty(3), np.empty(3)
    floor = np.full(n + 1, np.inf)  # height of the lowest foot at each knot
    for t in range(n):
        h = dt[t]
        total[:], moment[:] = 0.0, 0.0
        cost = 0.0
        for i in range(4):
            f, z, tau = force[t, i], cop[t, i], torque[t, i]
            if not active[t, i]:
                for a in range(3):
                    worst = max(worst, abs(f[a]) / weight)
                    total[a] += f[a]
                worst = max(worst, abs(z[0]), abs(z[1]), abs(tau) / weight)
            r = rotation[t, i]
            for a in range(3):
                arm[a] = position[t, i, a] + r[a, 0] * z[0] + r[a, 1] * z[1]
                local[a] = (r[0, a] * f[0] + r[1, a] * f[1] + r[2, a] * f[2]) / weight
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                moment[a] += arm[b] * f[c] - arm[c] * f[b] + tau * r[a, 2]
            if not active[t, i]:
                continue
            for a in range(3):
                total[a] += f[a]
            mu, x, y = friction[t, i], reduced[i, 0], reduced[i, 1]
            fx, fy, fz = local[0], local[1], local[2]
            tau_x, tau_y = z[1] * fz, -z[0] * fz
            tau_z = tau / weight + z[0] * fy - z[1] * fx
            room = mu * (x + y) * fz
            low = abs(y * fx - mu * tau_x) + abs(x * fy - mu * tau_y) - room
            high = room - abs(y * fx + mu * tau_x) - abs(x * fy + mu * tau_y)
            worst = max(worst, math.hypot(fx, fy) - mu * fz, -fz, fz - max_force[i] / weight)
            worst = max(worst, abs(tau_y) - x * fz, abs(tau_x) - y * fz)
            worst = max(worst, yaw_margin * low - tau_z, tau_z - yaw_margin * high)
            for knot in (t, t + 1):
                worst = _reach(worst, com[knot], position[t, i], r, tip[i], root[i], yaw[knot], reach[i])
                if i < 2:
                    floor[knot] = min(floor[knot], position[t, i, 2])
            cost += weights[4] * (fx**2 + fy**2 + fz**2) + weights[6] * (fx**2 + fy**2) + weights[5] * tau**2
            for a in range(2):
                if half_size[i, a] > 0.0:
                    cost += weights[7] * (z[a] / (2.0 * half_size[i, a])) ** 2
        for a in range(3):
            acceleration[a] = total[a] / mass - (STANDARD_GRAVITY if a == 2 else 0.0)
        for a in range(3):
            v = linear[t, a] / mass
            middle = com[t, a] + h / 2 * v + h * h / 8 * acceleration[a]
            end = com[t, a] + h * v + h * h / 2 * acceleration[a]
            mean[a] = (com[t, a] + 4 * middle + end) / 6
            worst = max(worst, abs(com[t + 1, a] - end))
            worst = max(worst, abs(linear[t + 1, a] - linear[t, a] - mass * h * acceleration[a]) / mass)
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            rate = moment[a] - (mean[b] * total[c] - mean[c] * total[b])
            worst = max(worst, abs(angular[t + 1, a] - angular[t, a] - h * rate) / mass)
            cost += weights[0] * linear[t + 1, a] ** 2 + weights[1] * (mass * acceleration[a]) ** 2
            cost += weights[2] * angular[t + 1, a] ** 2
            cost += weights[3] * ((angular[t + 1, a] - angular[t, a]) / h) ** 2
        objective += h / 0.2 * cost
    if landing_limb >= 0:
        i = landing_limb
        worst = _reach(worst, com[n], landing_position, landing_rotation, tip[i], root[i], yaw[n], reach[i])
        if i < 2:
            floor[n] = min(floor[n], landing_position[2])
    for knot in range(n + 1):
        if floor[knot] < np.inf:
            worst = max(worst, floor[knot] + min_height - com[knot, 2])
    cos, sin = math.cos(yaw[n]), math.sin(yaw[n])
    x, y, z = com[n, 0] - centre[0], com[n, 1] - centre[1], com[n, 2] - centre[2]
    worst = max(worst, abs(cos * x + sin * y) - box[0], abs(cos * y - sin * x) - box[1], abs(z) - box[2])
    if not (math.isfinite(worst) and math.isfinite(objective)):
        return np.inf, np.inf
    return worst, objective
