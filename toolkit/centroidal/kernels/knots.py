"""What a problem asks of its knots: balls that the CoM must keep to, planes, and a first guess of its path."""

import math

import numpy as np

from toolkit.compiled import compiled


@compiled(reordered=True)
def _ball(place, rotation, tip, root, yaw, com, center):
    """Fill the centre (3,) of the ball, about `com`, in which the CoM is within reach of a contact."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    for a in range(3):
        center[a] = place[a] - com[a]
        for b in range(3):
            center[a] += rotation[a, b] * tip[b]
    center[0] -= cos * root[0] - sin * root[1]
    center[1] -= sin * root[0] + cos * root[1]
    center[2] -= root[2]


@compiled(reordered=True)
def reach(
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
):
    """Fill the balls of all knots and the height (N + 1,) of the lowest foot in contact before or after each.

    The arguments are those of `CentroidalProblem` and `setup.Data`.
    """
    n, k = active.shape[0], 0
    for knot in range(n + 1):
        ball_first[knot] = k
        for t in range(max(knot - 1, 0), min(knot + 1, n)):
            for i in range(4):
                if not active[t, i]:
                    continue
                if i < 2:
                    lowest[knot] = min(lowest[knot], position[t, i, 2])
                if t == knot and knot > 0 and active[t - 1, i]:
                    change = 0.0
                    for a in range(3):
                        change = max(change, abs(position[t, i, a] - position[t - 1, i, a]))
                        for b in range(3):
                            change = max(change, abs(rotation[t, i, a, b] - rotation[t - 1, i, a, b]))
                    if change == 0.0:
                        continue  # the same ball again
                tip, root = tip_in_contact[i], root_in_com[i]
                _ball(position[t, i], rotation[t, i], tip, root, yaw[knot], com, ball_center[k])
                ball_radius[k] = max_reach[i]
                k += 1
    if landing_limb >= 0:
        if landing_limb < 2:
            lowest[n] = min(lowest[n], landing_position[2])
        tip, root = tip_in_contact[landing_limb], root_in_com[landing_limb]
        _ball(landing_position, landing_rotation, tip, root, yaw[n], com, ball_center[k])
        ball_radius[k] = max_reach[landing_limb]
        k += 1
    ball_first[n + 1] = k


@compiled(reordered=True)
def planes(lowest, min_height, yaw, com, final_center, final_half_size, plane_first, plane_normal, plane_offset):
    """Fill the planes: least height of knots 1 .. N, final box."""
    n, p = lowest.shape[0] - 1, 0
    for knot in range(1, n + 1):
        plane_first[knot] = p
        if lowest[knot] < np.inf:
            plane_normal[p, 2] = 1.0
            plane_offset[p] = com[2] - lowest[knot] - min_height
            p += 1
    cos, sin = math.cos(yaw), math.sin(yaw)
    for a in range(3):
        for side in range(2):
            normal, sign = plane_normal[p], 2.0 * side - 1.0
            if a == 0:
                normal[0], normal[1] = sign * cos, sign * sin
            elif a == 1:
                normal[0], normal[1] = -sign * sin, sign * cos
            else:
                normal[2] = sign
            plane_offset[p] = final_half_size[a]
            for b in range(3):
                plane_offset[p] -= normal[b] * (final_center[b] - com[b])
            p += 1
    plane_first[n + 1] = p


@compiled(reordered=True)
def guess(active, position, com, final_center):
    """Path (N + 1, 3) of the CoM that follows the mean of the feet and ends in the middle of the final box."""
    n = active.shape[0]
    path, begin, now, known = np.zeros((n + 1, 3)), np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2)
    for knot in range(n):
        for i in range(2):
            for a in range(3):
                if active[knot, i]:
                    now[i, a] = position[knot, i, a]
                    if known[i] == 0.0:
                        begin[i, a] = now[i, a]
                path[knot, a] += 0.5 * (now[i, a] - begin[i, a])
            if active[knot, i]:
                known[i] = 1.0
    for a in range(3):
        path[n, a] = final_center[a] - com[a]
    return path
