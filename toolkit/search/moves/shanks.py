"""Compiled checks of thighs and shins as capsules: against the world and against each other.

The closed form of `toolkit.contacts.reach` gives hip, knee and ankle of a leg that reaches; capsules lie between them.
Against the world a capsule is a row of balls on the occupancy grid. Half a cell is taken off their radius, since cells
count as occupied that are only touched; inverse kinematics has the last word.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.compiled import compiled
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel


class Shanks(NamedTuple):
    """Capsules inside both legs.

    Attributes:
        radius: (2,) m; of thigh and shin.
        free: (2,) part of each link, thigh and shin from the knee on, that is checked.
        slack: m; legs may overlap by this much, since the base may turn to help.
    """

    radius: np.ndarray
    free: np.ndarray
    slack: float


def shanks_of(robot: RobotModel, slack: float = 0.01) -> Shanks:
    """Capsules of a robot's legs: as thick as the thinner side of the thickest long geom that collides."""
    radius = np.min([_radii(robot, limb) for limb in FEET], axis=0)
    return Shanks(radius, np.array([0.6, 0.75]), slack)


def _radii(robot: RobotModel, limb: Limb) -> np.ndarray:
    """(2,) m; of a leg's thigh and shin, 0 where nothing there collides."""
    model, leg = robot.mujoco_model, robot.legs[limb]
    body = model.body(robot.limbs[limb].body).id
    joints: list[int] = []
    while body > 0:
        first = int(model.body_jntadr[body])
        own = range(first, first + int(model.body_jntnum[body]))
        joints = [joint for joint in own if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE] + joints
        body = int(model.body_parentid[body])
    radius = np.zeros(2)
    for link, (joint, length) in enumerate(((joints[2], leg.thigh), (joints[3], leg.shin))):  # see `leg_geometry`
        for geom in np.flatnonzero(model.geom_bodyid == model.jnt_bodyid[joint]).tolist():
            half = np.sort(model.geom_aabb[geom, 3:])
            if (model.geom_contype[geom] or model.geom_conaffinity[geom]) and half[2] > 0.25 * length:
                radius[link] = max(radius[link], float(half[0]))
    return radius


@compiled(kept=True)
def leg_points(legs, side, cx, cy, cz, yaw, position, rotation, points):
    """Fill points (3, 3) with hip, knee and ankle in m of a leg that reaches; arguments as in `legs.violated`."""
    c, s = np.cos(yaw), np.sin(yaw)
    hip, tip, r = legs.hip[side], legs.ankle[side], rotation
    points[0, 0], points[0, 1] = cx + c * hip[0] - s * hip[1], cy + s * hip[0] + c * hip[1]
    points[0, 2] = cz + hip[2]
    square = 0.0
    for k in range(3):
        points[2, k] = position[k] + r[k, 0] * tip[0] + r[k, 1] * tip[1] + r[k, 2] * tip[2]
        square += (points[0, k] - points[2, k]) ** 2
    dx, dy, dz = points[0, 0] - points[2, 0], points[0, 1] - points[2, 1], points[0, 2] - points[2, 2]
    u = r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz
    v = r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz
    w = r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz
    thigh, shin = legs.links[side, 0], legs.links[side, 1]
    span = min(max(np.sqrt(square), abs(thigh - shin) + 1e-9), thigh + shin - 1e-9)
    cosine = (span * span + shin * shin - thigh * thigh) / (2.0 * shin * span)
    lean = np.arctan2(u, np.sqrt(v * v + w * w)) + np.arccos(min(max(cosine, -1.0), 1.0))
    roll = np.arctan2(v, w)
    x, y, z = np.sin(lean), np.sin(roll) * np.cos(lean), np.cos(roll) * np.cos(lean)
    for k in range(3):
        points[1, k] = points[2, k] + shin * (r[k, 0] * x + r[k, 1] * y + r[k, 2] * z)


@compiled(kept=True)
def ball_free(corner, cell, below, x, y, z, radius):
    """Whether a ball meets no occupied cell, half a cell taken off its radius."""
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


@compiled(kept=True)
def leg_free(corner, cell, below, shanks, points):
    """Whether the checked parts of both links, from the knee on, meet no occupied cell."""
    for link in range(2):
        end = 0 if link == 0 else 2
        length = 0.0
        for k in range(3):
            length += (points[end, k] - points[1, k]) ** 2
        balls = int(np.ceil(np.sqrt(length) * shanks.free[link] / cell)) + 1
        for b in range(balls):
            t = shanks.free[link] * b / (balls - 1)
            x = points[1, 0] + t * (points[end, 0] - points[1, 0])
            y = points[1, 1] + t * (points[end, 1] - points[1, 1])
            z = points[1, 2] + t * (points[end, 2] - points[1, 2])
            if not ball_free(corner, cell, below, x, y, z, shanks.radius[link]):
                return False
    return True


@compiled(kept=True)
def segment_distance(a, b, p, q):
    """Distance between the segments a-b and p-q, points (3,)."""
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


@compiled(kept=True)
def legs_apart(shanks, left, right):
    """Whether two legs, (3, 3) points each, keep their links apart: knees, shins and the lower thighs."""
    parts = np.empty((2, 2, 3))
    for k in range(3):
        parts[0, 0, k] = left[1, k] + shanks.free[0] * (left[0, k] - left[1, k])
        parts[0, 1, k] = left[2, k]
        parts[1, 0, k] = right[1, k] + shanks.free[0] * (right[0, k] - right[1, k])
        parts[1, 1, k] = right[2, k]
    for i in range(2):
        for j in range(2):
            least = shanks.radius[i] + shanks.radius[j] - shanks.slack
            if segment_distance(left[1], parts[0, i], right[1], parts[1, j]) < least:
                return False
    return True
