"""Derivatives of the least objective of one transition with respect to its contacts, initial state and timing.

By the envelope theorem these are derivatives of the Lagrangian at fixed multipliers and wrenches. The wrenches are
fixed in the contacts' frames and the states follow from them. Central differences take two rollouts each.
"""

import math

import numpy as np

from toolkit.centroidal.kernels import constraints, objective, setup
from toolkit.compiled import compiled

STEP = 1e-5
"""Step of the central differences in m, m/s, rad, s or friction; they err by 1e-9 relatively."""
NEW = 4
"""Row of the new contact, after those of the limbs."""
PLACE, ROTATION, COM, VELOCITY, DURATION, FRICTION = 0, 1, 2, 3, 4, 5
"""Kinds of variations."""


@compiled(reordered=True)
def lagrangian(data, u, z, x, w, slack, constant):
    """Objective less multipliers z times slacks of wrenches u (C, 6), no final rest; the other arrays are room."""
    objective.rollout(data, u, x, w)
    constraints.constants(data, constant)
    constraints.apply(data, u, x, slack)
    constraints.add(slack, 1.0, constant)
    return objective.value(data, u, x, w) - constraints.dot(z, slack)


@compiled(reordered=True)
def turn(rotation, axis, angle):
    """Turn a frame (3, 3) in place about an axis of the world."""
    cos, sin = math.cos(angle), math.sin(angle)
    b, c = (axis + 1) % 3, (axis + 2) % 3
    for k in range(3):
        first, second = rotation[b, k], rotation[c, k]
        rotation[b, k], rotation[c, k] = cos * first - sin * second, sin * first + cos * second


@compiled(reordered=True)
def heading(left, right):
    """Mean heading in rad of two feet with frames (3, 3), as in `build`."""
    x = y = 0.0
    for frame in (left, right):
        dx, dy = frame[0, 0], frame[1, 0]
        length = math.hypot(dx, dy)
        if length > 0.0:
            dx, dy = dx / length, dy / length
        x, y = x + dx, y + dy
    return math.atan2(y, x)


@compiled(reordered=True)
def restore(problem, varied):
    """Undo what `vary` changed."""
    varied.dt[:], varied.yaw[:], varied.com[:] = problem.dt, problem.yaw, problem.com
    varied.position[:], varied.rotation[:], varied.friction[:] = problem.position, problem.rotation, problem.friction
    varied.com_velocity[:], varied.final_center[:] = problem.com_velocity, problem.final_center
    varied.landing_position[:], varied.landing_rotation[:] = problem.landing_position, problem.landing_rotation


@compiled(reordered=True)
def vary(kind, row, axis, step, p):
    """Change one thing of a problem (`ProblemArrays`) by a step, and all that depends on it.

    The kind is PLACE or ROTATION of the contact `row` (a limb or NEW) along a world axis, COM or VELOCITY along an
    axis, DURATION of the phase `axis`, or FRICTION.
    """
    n, limb = p.dt.shape[0], p.landing_limb
    half = n // 2
    if kind == PLACE:
        if row == NEW:
            p.landing_position[axis] += step
        else:
            for t in range(n):
                p.position[t, row, axis] += step
        # The final box stands over the mean of the feet after the transition.
        if (row == NEW and limb < 2) or (row < 2 and row != limb):
            p.final_center[axis] += 0.5 * step
    elif kind == ROTATION:
        if row == NEW:
            turn(p.landing_rotation, axis, step)
        else:
            for t in range(n):
                turn(p.rotation[t, row], axis, step)
        left, right = p.rotation[0, 0], p.rotation[0, 1]
        begin = heading(left, right)
        change = heading(p.landing_rotation if limb == 0 else left, p.landing_rotation if limb == 1 else right) - begin
        change -= 2.0 * math.pi * round(change / (2.0 * math.pi))
        for t in range(n + 1):
            p.yaw[t] = begin + change * max(t - half, 0) / half
    elif kind == COM:
        p.com[axis] += step
    elif kind == VELOCITY:
        p.com_velocity[axis] += step
    elif kind == DURATION:
        for t in range(half):
            p.dt[t + half * axis] += step / half
    else:
        p.friction[:] += step


@compiled(reordered=True)
def derivatives(u, z, problem, varied):
    """Derivatives (5, 6) and (9,) of the least objective of a transition, as in `fast.Sensitivity`.

    Of the wrenches u (C, 6) and multipliers z of its solution; `varied` is a copy of the problem, which is changed.
    """
    n = problem.dt.shape[0]
    contacts, others = np.zeros((5, 6)), np.zeros(9)
    x, w = np.zeros((n + 1, 9)), np.zeros((n, 6))
    slack = constraints.room(z.line.shape[0], z.round.shape[0])
    constant = constraints.room(z.line.shape[0], z.round.shape[0])
    for k in range(39):
        row, axis, kind = k // 6, k % 3, (k // 3) % 2
        if k >= 30:
            kind = COM + (k - 30) // 3
        if k == 38:
            kind = FRICTION
        if (row < NEW and not problem.active[0, row]) or (row == NEW and problem.landing_limb < 0):
            continue
        change = 0.0
        for sign in (-1.0, 1.0):
            restore(problem, varied)
            vary(kind, row, axis, sign * STEP, varied)
            data, _ = setup.pack(varied)
            change += sign * lagrangian(data, u, z, x, w, slack, constant)
        change /= 2.0 * STEP * setup.SCALE
        if k < 30:
            contacts[row, k % 6] = change
        else:
            others[k - 30] = change
    return contacts, others
