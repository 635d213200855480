"""The dynamics and the momentum objective of the steps, with their derivatives.

The state is x = (r, v, kappa, a): CoM in m, its velocity, the angular momentum about the CoM per mass in m^2/s, and the
CoM's acceleration in the step before; then, where contacts may move, the displacements of contacts. Wrenches are in
weights, about the middle of the patch, in the contact frame. The laws are those of `toolkit.physics.momentum`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.centroidal.problem import STANDARD_GRAVITY as G
from toolkit.compiled import compiled
from toolkit.physics.leg import turned
from toolkit.physics.momentum import cross, mean_com

R, V, SPIN, ACCELERATION = 0, 3, 6, 9
STATE = 12
WRENCH = 6
MOMENTUM, MOMENTUM_RATE, ANGULAR, ANGULAR_RATE, JERK, HEIGHT = range(6)
"""Columns of `Steps.weights`."""


class Steps(NamedTuple):
    """What N steps with C contacts are made of.

    Attributes:
        dt: (N,) s.
        first: (N + 1,) the first contact of each step.
        wrench: (C,) first variable of a contact's wrench within its stage.
        pair: (C,) first of the two variables of the contact's displacement along its own axes; -1 where it stays.
        rotation: (C, 3, 3) world_from_contact.
        position: (C, 3) m; centre of the patch.
        weights: (N, 6) weights of the squares of velocity, acceleration, angular momentum and its rate, change of the
            acceleration, and height.
        height: (N,) m; wanted height of the CoM after the step.
        source: (N, 2 P) the variables of the stage that become the P displacements of the next one.
        turning: (N, 3) m^2/s^2; wanted rate of the angular momentum per mass.
    """

    dt: np.ndarray
    first: np.ndarray
    wrench: np.ndarray
    pair: np.ndarray
    rotation: np.ndarray
    position: np.ndarray
    weights: np.ndarray
    height: np.ndarray
    source: np.ndarray
    turning: np.ndarray


@compiled(reordered=True)
def rates(steps, t, y, acceleration, spin_rate):
    """Fill acceleration (3,) of the CoM and rate (3,) of kappa in step t; returns the contacts' force in N/kg."""
    middle = mean_com(steps.dt[t], G, y)
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(steps.first[t], steps.first[t + 1]):
        turn, p, w = steps.rotation[j], steps.position[j], y[steps.wrench[j] :]
        force, moment = turned(turn, w), turned(turn, w[3:])
        ax, ay, az = p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]
        if steps.pair[j] >= 0:
            d = y[steps.pair[j] :]
            ax += turn[0, 0] * d[0] + turn[0, 1] * d[1]
            ay += turn[1, 0] * d[0] + turn[1, 1] * d[1]
            az += turn[2, 0] * d[0] + turn[2, 1] * d[1]
        about = cross((ax, ay, az), force)
        fx, fy, fz = fx + force[0], fy + force[1], fz + force[2]
        mx, my, mz = mx + about[0] + moment[0], my + about[1] + moment[1], mz + about[2] + moment[2]
    acceleration[0], acceleration[1], acceleration[2] = G * fx, G * fy, G * (fz - 1.0)
    spin_rate[0], spin_rate[1], spin_rate[2] = G * mx, G * my, G * mz
    return G * fx, G * fy, G * fz


@compiled(reordered=True)
def successor(steps, t, y, acceleration, spin_rate, out):
    """Fill the state (n,) after step t."""
    h = steps.dt[t]
    for a in range(3):
        out[R + a] = y[R + a] + h * y[V + a] + h * h / 2 * acceleration[a]
        out[V + a] = y[V + a] + h * acceleration[a]
        out[SPIN + a] = y[SPIN + a] + h * spin_rate[a]
        out[ACCELERATION + a] = acceleration[a]
    for a in range(steps.source.shape[1]):
        out[STATE + a] = y[steps.source[t, a]]


@compiled(reordered=True)
def terms(steps, t, before, acceleration, spin_rate, after):
    """Objective of step t, given the states (n,) before and after it."""
    weights, total = steps.weights[t], 0.0
    for a in range(3):
        change = acceleration[a] - before[ACCELERATION + a]
        total += weights[MOMENTUM] * after[V + a] ** 2 + weights[MOMENTUM_RATE] * after[ACCELERATION + a] ** 2
        turning = spin_rate[a] - steps.turning[t, a]
        total += weights[ANGULAR] * after[SPIN + a] ** 2 + weights[ANGULAR_RATE] * turning**2
        total += weights[JERK] * change**2
    return total + weights[HEIGHT] * (after[R + 2] - steps.height[t]) ** 2


@compiled(reordered=True, allocates=True)
def linearise(steps, begin, end, size, y, hessian, gradient, following, defect):
    """Enter the steps into the model of the stages from `begin` to before `end`.

    That are gradients (N + 1, m), dynamics (N, n, m), defects (N, n) and Hessians (k, m, m), which are Gauss and
    Newton's; stage t has number t modulo k. Returns the objective of the steps that begin in these stages.
    """
    total = 0.0
    acceleration, spin_rate = np.empty(3), np.empty(3)
    row = np.empty(hessian.shape[1])
    for t in range(begin, end):
        now, full, slope = y[t], hessian[t % len(hessian)], gradient[t]
        if t > 0:
            enter_state(steps, t - 1, now, full, slope)
        if t == steps.dt.shape[0]:
            continue
        h, weights, after = steps.dt[t], steps.weights[t], y[t + 1]
        force = rates(steps, t, now, acceleration, spin_rate)
        successor(steps, t, now, acceleration, spin_rate, defect[t])
        for a in range(defect.shape[1]):
            defect[t, a] -= after[a]
        total += terms(steps, t, now, acceleration, spin_rate, after)
        fill_dynamics(steps, t, now, force, following[t])

        # The rate of kappa and the change of the acceleration, whose derivatives are rows of the dynamics.
        for a in range(3):
            weight = weights[ANGULAR_RATE] / (h * h)
            for c in range(size[t]):
                row[c] = following[t, SPIN + a, c]
            row[SPIN + a] = 0.0
            add_square(weight, h * (spin_rate[a] - steps.turning[t, a]), row, size[t], full, slope)
            if weights[JERK] != 0.0:
                for c in range(size[t]):
                    row[c] = following[t, ACCELERATION + a, c]
                row[ACCELERATION + a] = -1.0
                change = acceleration[a] - now[ACCELERATION + a]
                add_square(weights[JERK], change, row, size[t], full, slope)
    return total


@compiled(reordered=True)
def enter_state(steps, t, after, hessian, gradient):
    """Add the prices of the state (m,) after step t to a Hessian and a gradient."""
    weights = steps.weights[t]
    for part, weight in ((V, weights[MOMENTUM]), (ACCELERATION, weights[MOMENTUM_RATE]), (SPIN, weights[ANGULAR])):
        for a in range(3):
            gradient[part + a] += 2 * weight * after[part + a]
            hessian[part + a, part + a] += 2 * weight
    gradient[R + 2] += 2 * weights[HEIGHT] * (after[R + 2] - steps.height[t])
    hessian[R + 2, R + 2] += 2 * weights[HEIGHT]


@compiled(reordered=True)
def add_square(weight, value, row, size, hessian, gradient):
    """Add weight * value^2, whose derivative is `row`, to the lower triangle of a Hessian and to a gradient."""
    for b in range(size):
        if row[b] != 0.0:
            factor = 2 * weight * row[b]
            gradient[b] += factor * value
            for c in range(b + 1):
                hessian[b, c] += factor * row[c]


@compiled(reordered=True)
def fill_dynamics(steps, t, y, force, out):
    """Fill the derivative (n, m) of the state after step t; `force` is the sum of the contacts' in N/kg."""
    h = steps.dt[t]
    out[:] = 0.0
    for a in range(3):
        out[R + a, R + a] = out[V + a, V + a] = out[SPIN + a, SPIN + a] = 1.0
        out[R + a, V + a] = h
        b, c = (a + 1) % 3, (a + 2) % 3
        # d(-rbar x F) with rbar = r + h/2 v + const
        out[SPIN + a, R + b], out[SPIN + a, R + c] = -h * force[c], h * force[b]
        out[SPIN + a, V + b], out[SPIN + a, V + c] = -h * h / 2 * force[c], h * h / 2 * force[b]
    middle = mean_com(h, G, y)
    for j in range(steps.first[t], steps.first[t + 1]):
        turn, p, first, pair = steps.rotation[j], steps.position[j], steps.wrench[j], steps.pair[j]
        ax, ay, az = p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]
        if pair >= 0:
            d, w = y[pair:], y[first:]
            ax += turn[0, 0] * d[0] + turn[0, 1] * d[1]
            ay += turn[1, 0] * d[0] + turn[1, 1] * d[1]
            az += turn[2, 0] * d[0] + turn[2, 1] * d[1]
            world = turned(turn, w)
            for k in range(2):
                about = cross((turn[0, k], turn[1, k], turn[2, k]), world)
                for a in range(3):
                    out[SPIN + a, pair + k] += h * G * about[a]
        for k in range(3):
            axis = turn[0, k], turn[1, k], turn[2, k]
            about = cross((ax, ay, az), axis)
            for a in range(3):
                out[R + a, first + k] = h * h / 2 * G * axis[a]
                out[V + a, first + k] = h * G * axis[a]
                out[ACCELERATION + a, first + k] = G * axis[a]
                out[SPIN + a, first + k] = h * G * about[a]
                out[SPIN + a, first + 3 + k] = h * G * axis[a]
    for a in range(steps.source.shape[1]):
        out[STATE + a, steps.source[t, a]] = 1.0
