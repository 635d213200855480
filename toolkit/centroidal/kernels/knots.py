"""Constraints of the knots, balls and planes within which the CoM must be, and a first guess of its path."""

import math

import numpy as np

from toolkit.compiled import compiled


@compiled(reordered=True)
def _ball(p, limb, place, rotation, yaw, center):
    """Fill the centre (3,) of the ball, about the initial CoM, in which the CoM is within reach of a contact."""
    cos, sin, root, tip = math.cos(yaw), math.sin(yaw), p.root_in_com[limb], p.tip_in_contact[limb]
    for a in range(3):
        center[a] = place[a] - p.com[a]
        for b in range(3):
            center[a] += rotation[a, b] * tip[b]
    center[0] -= cos * root[0] - sin * root[1]
    center[1] -= sin * root[0] + cos * root[1]
    center[2] -= root[2]


@compiled(reordered=True)
def balls(p, most):
    """The balls of all knots of a problem (`ProblemArrays`), and the lowest foot in contact before or after each.

    Returns (N + 2,) first ball of each knot, (most, 3) centres, (most,) radii and (N + 1,) heights, inf without a foot.
    """
    n, k = p.active.shape[0], 0
    first, center, radius = np.zeros(n + 2, np.int64), np.empty((most, 3)), np.empty(most)
    lowest = np.full(n + 1, np.inf)
    for knot in range(n + 1):
        first[knot] = k
        for t in range(max(knot - 1, 0), min(knot + 1, n)):
            for i in range(4):
                if not p.active[t, i]:
                    continue
                if i < 2:
                    lowest[knot] = min(lowest[knot], p.position[t, i, 2])
                if t == knot and knot > 0 and p.active[t - 1, i]:
                    change = 0.0
                    for a in range(3):
                        change = max(change, abs(p.position[t, i, a] - p.position[t - 1, i, a]))
                        for b in range(3):
                            change = max(change, abs(p.rotation[t, i, a, b] - p.rotation[t - 1, i, a, b]))
                    if change == 0.0:
                        continue  # the same ball again
                _ball(p, i, p.position[t, i], p.rotation[t, i], p.yaw[knot], center[k])
                radius[k] = p.max_reach[i]
                k += 1
    i = p.landing_limb
    if i >= 0:
        if i < 2:
            lowest[n] = min(lowest[n], p.landing_position[2])
        _ball(p, i, p.landing_position, p.landing_rotation, p.yaw[n], center[k])
        radius[k] = p.max_reach[i]
        k += 1
    first[n + 1] = k
    return first, center, radius, lowest


@compiled(reordered=True)
def planes(p, lowest):
    """The planes: least height of knots 1 .. N, above the lowest feet (N + 1,), and the final box.

    Returns (N + 2,) first plane of each knot, (N + 7, 3) normals and (N + 7,) offsets, of which the last may be unused.
    """
    n, k = lowest.shape[0] - 1, 0
    first, normals, offset = np.zeros(n + 2, np.int64), np.zeros((n + 7, 3)), np.empty(n + 7)
    for knot in range(1, n + 1):
        first[knot] = k
        if lowest[knot] < np.inf:
            normals[k, 2] = 1.0
            offset[k] = p.com[2] - lowest[knot] - p.min_height
            k += 1
    cos, sin = math.cos(p.yaw[n]), math.sin(p.yaw[n])
    for a in range(3):
        for side in range(2):
            normal, sign = normals[k], 2.0 * side - 1.0
            if a == 0:
                normal[0], normal[1] = sign * cos, sign * sin
            elif a == 1:
                normal[0], normal[1] = -sign * sin, sign * cos
            else:
                normal[2] = sign
            offset[k] = p.final_half_size[a]
            for b in range(3):
                offset[k] -= normal[b] * (p.final_center[b] - p.com[b])
            k += 1
    first[n + 1] = k
    return first, normals, offset


@compiled(reordered=True)
def guess(p):
    """Path (N + 1, 3) of the CoM that follows the mean of the feet and ends in the middle of the final box."""
    n = p.active.shape[0]
    path, begin, now, known = np.zeros((n + 1, 3)), np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2)
    for knot in range(n):
        for i in range(2):
            for a in range(3):
                if p.active[knot, i]:
                    now[i, a] = p.position[knot, i, a]
                    if known[i] == 0.0:
                        begin[i, a] = now[i, a]
                path[knot, a] += 0.5 * (now[i, a] - begin[i, a])
            if p.active[knot, i]:
                known[i] = 1.0
    for a in range(3):
        path[n, a] = p.final_center[a] - p.com[a]
    return path
