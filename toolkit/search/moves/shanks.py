"""Compiled checks of thighs and shins as capsules: against the world and against each other.

Capsules lie between the hip, the knee and the ankle of a leg that reaches (`toolkit.search.moves.legs.reach`).
Against the world a capsule is a row of balls on the occupancy grid. Half a cell is taken off their radius, since a cell
counts as occupied that is only touched; inverse kinematics checks it exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.physics.leg import distance
from toolkit.robot.model import RobotModel

_FREE = (0.6, 0.75)  # part of thigh and shin, from the knee on, that is checked
_SLACK = 0.01  # m for a body of the usual size (`toolkit.robot.scale`); see `Shanks`


class Shanks(NamedTuple):
    """Capsules inside the legs.

    Attributes:
        radius: (2,) m; of thighs and shins; see `RobotModel.leg_radii`.
        slack: m by which the legs may overlap, since the base may turn to help.
    """

    radius: np.ndarray
    slack: float


def shanks_of(robot: RobotModel) -> Shanks:
    """The capsules inside a robot's legs."""
    return Shanks(robot.leg_radii, robot.scale.length * _SLACK)


@compiled
def ball_free(occupancy, x, y, z, radius):
    """Whether a ball meets no occupied cell, half a cell taken off its radius."""
    corner, cell, below = occupancy.corner, occupancy.cell, occupancy.below
    high = radius - cell / 2 if radius > cell / 2 else 0.0
    first = min(max(int(np.floor((z - high - corner[2]) / cell)), 0), below.shape[2] - 1)
    last = min(max(int(np.floor((z + high - corner[2]) / cell)) + 1, 0), below.shape[2] - 1)
    if last <= first:
        return True
    i0, i1 = int(np.floor((x - high - corner[0]) / cell)), int(np.floor((x + high - corner[0]) / cell))
    j0, j1 = int(np.floor((y - high - corner[1]) / cell)), int(np.floor((y + high - corner[1]) / cell))
    for i in range(max(i0, 0), min(i1, below.shape[0] - 1) + 1):
        for j in range(max(j0, 0), min(j1, below.shape[1] - 1) + 1):
            if below[i, j, last] != below[i, j, first]:
                return False
    return True


@compiled
def _between(a, b, t):
    """The point at the part t of the way from a to b."""
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


@compiled
def leg_free(occupancy, shanks, points):
    """Whether the checked parts of both links of a leg (hip, knee and ankle in m) meet no occupied cell."""
    knee = points[1]
    for link in range(2):
        end = points[2 * link]
        balls = int(np.ceil(distance(end, knee) * _FREE[link] / occupancy.cell)) + 1
        for b in range(balls):
            x, y, z = _between(knee, end, _FREE[link] * b / (balls - 1))
            if not ball_free(occupancy, x, y, z, shanks.radius[link]):
                return False
    return True


@compiled
def segment_distance(a, b, p, q):
    """Distance between the segments a-b and p-q, points of three numbers."""
    aa = ap = pp = ar = pr = 0.0
    for k in range(3):
        u, v, r = b[k] - a[k], q[k] - p[k], a[k] - p[k]
        aa, ap, pp = aa + u * u, ap + u * v, pp + v * v
        ar, pr = ar + u * r, pr + v * r
    bend = aa * pp - ap * ap
    s = min(max((ap * pr - ar * pp) / bend, 0.0), 1.0) if bend > 1e-12 else 0.0
    t = (ap * s + pr) / pp if pp > 0.0 else 0.0
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((ap * t - ar) / aa, 0.0), 1.0) if aa > 0.0 else 0.0
    square = 0.0
    for k in range(3):
        square += (a[k] + s * (b[k] - a[k]) - p[k] - t * (q[k] - p[k])) ** 2
    return np.sqrt(square)


@compiled
def legs_apart(shanks, left, right):
    """Whether two legs (hip, knee and ankle in m) keep their links apart: knees, shins and the lower thighs."""
    ends_left = (_between(left[1], left[0], _FREE[0]), left[2])
    ends_right = (_between(right[1], right[0], _FREE[0]), right[2])
    for i in range(2):
        for j in range(2):
            least = shanks.radius[i] + shanks.radius[j] - shanks.slack
            if segment_distance(left[1], ends_left[i], right[1], ends_right[j]) < least:
                return False
    return True
