"""Where the robot's body would hit the world: a grid of occupied columns, and the box that stands for the body."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.compiled import compiled
from toolkit.errors import RobotError
from toolkit.geometry.limb import Limb
from toolkit.robot.mend import geom_spheres
from toolkit.robot.model import RobotModel
from toolkit.search.moves.obstacles import world_triangles

_MAX_CELLS = 20_000_000
MARGIN = 0.02
"""m around a body of the usual size (`toolkit.robot.scale`)."""
_ABOVE_KNEES = 0.05  # m for the same; shapes that do not rise so far above the knees belong to the shins


class BodyBox(NamedTuple):
    """The body from the knees up as an upright box over the mean of the feet.

    Attributes:
        half_depth, half_width: Half extents in m along and across the heading.
        bottom, top: Heights in m above the soles.
    """

    half_depth: float
    half_width: float
    bottom: float
    top: float

    @classmethod
    def of(cls, robot: RobotModel) -> BodyBox:
        """The box around torso, head, thighs and shoulders in the home posture; arms with palms may fold in.

        What the first two joints of an arm carry does not; it may be as near to walls as an arm.

        Raises:
            RobotError: there is no shape to put a box around.
        """
        model = robot.mujoco_model
        data = mujoco.MjData(model)
        data.qpos[:] = robot.home
        mujoco.mj_kinematics(model, data)
        leg, margin = robot.legs[Limb.LEFT_FOOT], robot.scale.length * MARGIN
        bottom = -leg.ankle_in_sole[2] if leg.ankle_in_sole[2] < 0 else leg.ankle_in_sole[2]
        bottom += leg.shin
        in_arm = np.isin(robot.in_arms(model), list(robot.arms))
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for geom in range(model.ngeom):
            if in_arm[model.geom_bodyid[geom]]:
                continue
            centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            rotation = data.geom_xmat[geom].reshape(3, 3)
            middle, extent = data.geom_xpos[geom] + rotation @ centre, np.abs(rotation) @ half
            if middle[2] + extent[2] < bottom + robot.scale.length * _ABOVE_KNEES:
                continue
            low, high = np.minimum(low, middle - extent), np.maximum(high, middle + extent)
        if not np.isfinite(high).all():
            raise RobotError(
                f"{robot.folder}: no shape above the knees; add geoms to the torso, the head or the thighs"
            )
        width = max(-low[1], high[1])
        for limb, arm in robot.arms.items():
            width = max(width, abs(arm.shoulder_in_com[1]) + 1.5 * float(robot.half_sizes[limb].min()))
        width = max(width + margin, _shoulders(robot, data))
        return cls(max(-low[0], high[0]) + margin, width, bottom, float(high[2]) + margin)


def _shoulders(robot: RobotModel, data: mujoco.MjData) -> float:
    """How far in m what the first two joints of the arms with palms carry reaches to the side, in a posture as set."""
    model, width = robot.mujoco_model, 0.0
    carried = [int(model.jnt_bodyid[joint + 1]) for limb in robot.arms for joint in robot.arm_sides[limb][:2]]
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    for geom in np.flatnonzero(collides & np.isin(model.geom_bodyid, carried)).tolist():
        body = int(model.geom_bodyid[geom])
        points, radius = geom_spheres(model, geom)
        sideways = points @ data.xmat[body].reshape(3, 3)[1] + data.xpos[body, 1]
        width = max(width, float(np.abs(sideways).max()) + radius)
    return width


def edge_of(lower: np.ndarray, upper: np.ndarray, cell: float) -> float:
    """Edge of the cells in m between two corners (3,) m: `cell`, or more where these would be too many."""
    return max(cell, float((np.maximum(upper - lower, 0.0).prod() / _MAX_CELLS) ** (1 / 3)))


class Occupancy(NamedTuple):
    """Occupied cells of a box of the world.

    Attributes:
        corner: (3,) m; lower corner.
        cell: Edge of a cell in m, in all three directions.
        below: (nx, ny, nz + 1) int16; number of occupied cells of a column below each height.
    """

    corner: np.ndarray
    cell: float
    below: np.ndarray

    @classmethod
    def of(cls, model: mujoco.MjModel, lower: np.ndarray, upper: np.ndarray, cell: float = 0.05) -> Occupancy:
        """Occupancy of the box between two corners (3,) m of a world."""
        return cls.by(world_triangles(model, lower, upper), lower, upper, cell)

    @classmethod
    def by(cls, triangles: np.ndarray, lower: np.ndarray, upper: np.ndarray, cell: float) -> Occupancy:
        """Occupancy of the box between two corners (3,) m; every cell that a triangle (t, 3, 3) touches counts."""
        extent, cell = np.maximum(upper - lower, 0.0), edge_of(lower, upper, cell)
        shape = np.ceil(extent / cell).astype(np.int64) + 1
        occupied = np.zeros(tuple(shape), np.bool_)
        scratch = np.empty((3, 12, 3))
        _rasterise(np.ascontiguousarray((triangles - lower) / cell), occupied, *scratch)
        below = np.zeros((*shape[:2], shape[2] + 1), np.int16)
        np.cumsum(occupied, axis=2, out=below[:, :, 1:])
        return cls(np.asarray(lower, float), cell, below)


@compiled
def body_free(occupancy, box, x, y, z, yaw, drop=0.0):
    """Whether a `BodyBox` over a place between the soles meets no occupied cell; outside the grid all is free.

    The top of the box may be lower by a drop of the CoM in m.
    """
    corner, cell, below = occupancy.corner, occupancy.cell, occupancy.below
    depth, width = box.half_depth, box.half_width
    first = min(max(int(np.floor((z + box.bottom - corner[2]) / cell)), 0), below.shape[2] - 1)
    last = min(max(int(np.ceil((z + box.top - drop - corner[2]) / cell)), 0), below.shape[2] - 1)
    if last <= first:
        return True
    c, s = np.cos(yaw), np.sin(yaw)
    ex, ey = abs(c) * depth + abs(s) * width, abs(s) * depth + abs(c) * width
    i0, i1 = int(np.floor((x - ex - corner[0]) / cell)), int(np.floor((x + ex - corner[0]) / cell))
    j0, j1 = int(np.floor((y - ey - corner[1]) / cell)), int(np.floor((y + ey - corner[1]) / cell))
    for i in range(max(i0, 0), min(i1, below.shape[0] - 1) + 1):
        for j in range(max(j0, 0), min(j1, below.shape[1] - 1) + 1):
            if below[i, j, last] == below[i, j, first]:
                continue
            dx, dy = corner[0] + (i + 0.5) * cell - x, corner[1] + (j + 0.5) * cell - y
            if abs(c * dx + s * dy) <= depth and abs(-s * dx + c * dy) <= width:
                return False
    return True


@compiled
def lowest_drop(occupancy, box, drops, x, y, z, yaw):
    """Number of the first of the rising drops (k,) m of the CoM with which the body is free; -1 where there is none."""
    for k in range(len(drops)):
        if body_free(occupancy, box, x, y, z, yaw, drops[k]):
            return k
    return -1


@compiled
def _clip(points, count, out, axis, bound, sign):
    """Cut a polygon by sign * point[axis] <= sign * bound (Sutherland and Hodgman); returns the number of corners."""
    kept = 0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        da, db = sign * (points[k, axis] - bound), sign * (points[m, axis] - bound)
        if da <= 0.0:
            for c in range(3):
                out[kept, c] = points[k, c]
            kept += 1
        if (da < 0.0 and db > 0.0) or (db < 0.0 and da > 0.0):
            t = da / (da - db)
            for c in range(3):
                out[kept, c] = points[k, c] + t * (points[m, c] - points[k, c])
            kept += 1
    return kept


@compiled
def _cells(points, count, axis, most):
    """First and last cell, within 0 and `most`, that a polygon meets along an axis."""
    low, high = points[0, axis], points[0, axis]
    for k in range(1, count):
        low, high = min(low, points[k, axis]), max(high, points[k, axis])
    return max(int(np.floor(low)), 0), min(int(np.floor(high)), most)


@compiled(kept=True)
def _rasterise(triangles, occupied, work, strip, column):
    """Mark the cells that triangles, in cell units, touch: clip each to a strip, to a column, then by height.

    `work`, `strip` and `column` are scratch (12, 3).
    """
    for t in range(len(triangles)):
        i0, i1 = _cells(triangles[t], 3, 0, occupied.shape[0] - 1)
        for i in range(i0, i1 + 1):
            count = _clip(triangles[t], 3, work, 0, 1.0 * i, -1.0)
            count = _clip(work, count, strip, 0, i + 1.0, 1.0)
            if count == 0:
                continue
            j0, j1 = _cells(strip, count, 1, occupied.shape[1] - 1)
            for j in range(j0, j1 + 1):
                inner = _clip(strip, count, work, 1, 1.0 * j, -1.0)
                inner = _clip(work, inner, column, 1, j + 1.0, 1.0)
                if inner == 0:
                    continue
                k0, k1 = _cells(column, inner, 2, occupied.shape[2] - 1)
                for k in range(k0, k1 + 1):
                    occupied[i, j, k] = True
