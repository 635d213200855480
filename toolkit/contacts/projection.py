"""Projection of soles and palms on surfaces: where a limb lands, if its whole patch finds room there.

A patch fits if its rectangle lies in the surface's region: the centre is inside by the even-odd rule over all rings,
and no boundary edge meets the rectangle. That is exact for regions that are not convex or have holes.

- A sole falls along the vertical on the HIGHEST surface in reach on which it fits. Where it fits nowhere it may shift
  a little, in a fixed order of offsets along its own axes (this goes beyond the paper: a discrete step set rarely hits
  a 0.30 m tread or a small stone by chance).
- A palm follows a ray to the NEAREST surface on which it fits, and is rejected where anything blocks the ray before.
  Its x axis is the heading, carried by the least rotation that takes the vertical to the normal: forwards on a side
  wall, up on a wall ahead, as the hand of an arm raised from hanging points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numba
import numpy as np

from toolkit.contacts.surface_table import SurfaceTable
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel
from toolkit.world.surface import Surface


@dataclass(frozen=True)
class ProjectionConfig:
    """Settings of the projection.

    Attributes:
        margin: m around a sole that must also be in the surface.
        palm_margin: m around a palm.
        shift: m; how far a sole may move to fit; 0 for the paper's projection.
        shift_step: m; spacing of the offsets tried.
        block_tolerance: m; something nearer than a palm's surface by more than this blocks the ray.
    """

    margin: float = 0.01
    palm_margin: float = 0.005
    shift: float = 0.06
    shift_step: float = 0.02
    block_tolerance: float = 0.01


@dataclass(frozen=True)
class Projected:
    """Patches of n candidates; rows with surface -1 found none.

    Attributes:
        surface: (n,) int.
        position: (n, 3) m; centre of the patch.
        rotation: (n, 3, 3); world_from_contact.
    """

    surface: np.ndarray
    position: np.ndarray
    rotation: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """(n,) bool."""
        return self.surface >= 0


def shifts(reach: float, step: float) -> np.ndarray:
    """(n, 2) offsets along x and y in a disc, nearest first, along x before y, forwards before backwards."""
    count = round(reach / step) if step > 0 else 0
    grid = [(i, j) for i in range(-count, count + 1) for j in range(-count, count + 1) if i * i + j * j <= count**2]
    grid.sort(key=lambda ij: (ij[0] ** 2 + ij[1] ** 2, abs(ij[1]), -ij[0], -ij[1]))
    return np.array(grid, float) * step


class Projector:
    """Projects the soles and palms of one robot on the surfaces of one world.

    Args:
        robot: patch sizes.
        surfaces: of the world.
        model: the world compiled, for blocked rays.
        config: settings.
    """

    def __init__(
        self,
        robot: RobotModel,
        surfaces: Sequence[Surface],
        model: mujoco.MjModel,
        config: ProjectionConfig | None = None,
    ):
        self.config = config or ProjectionConfig()
        self._half = robot.half_sizes + self.config.margin
        self._half[2:] = robot.half_sizes[2:] + self.config.palm_margin
        self.table = SurfaceTable.of(surfaces, reach=float(np.linalg.norm(self._half[:2], axis=1).max()))
        self._shifts = shifts(self.config.shift, self.config.shift_step)
        self._model = model
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._palm_surfaces = np.flatnonzero(self.table.palm)

    def project_soles(
        self, limb: Limb, pose: np.ndarray, low: float, high: float, *, shift: bool = True, outward: float = 0.0
    ) -> Projected:
        """Drop soles on the highest surfaces that hold them.

        Args:
            limb: a foot.
            pose: (n, 3) float; x m, y m, yaw rad of the sole in the world.
            low: m; lowest height of the sole's centre.
            high: m; highest.
            shift: whether soles may shift to fit.
            outward: sign of the shifts across the foot tried first: +1 to the left, -1 to the right.

        Returns:
            Soles, z along the surface's normal, x along yaw.
        """
        offsets = self._shifts if shift else self._shifts[:1]
        if outward < 0:
            offsets = offsets * [1.0, -1.0]
        n = len(pose)
        surface, position, rotation = np.empty(n, np.int64), np.zeros((n, 3)), np.zeros((n, 3, 3))
        table = self.table
        _project_soles(
            np.ascontiguousarray(pose, dtype=float),
            float(low),
            float(high),
            self._half[limb, 0],
            self._half[limb, 1],
            np.ascontiguousarray(offsets),
            table.origin,
            table.rotation,
            table.edges,
            table.corner,
            table.cell,
            table.shape,
            table.entry_start,
            table.entry_surface,
            table.entry_inside,
            table.near_start,
            table.near,
            surface,
            position,
            rotation,
        )
        return Projected(surface, position, rotation)

    def project_palms(self, limb: Limb, shoulder: np.ndarray, rays: np.ndarray, yaw: float, reach: float) -> Projected:
        """Send palms along rays to the nearest surfaces that hold them.

        Args:
            limb: a palm.
            shoulder: (3,) m, world.
            rays: (n, 3) unit, world.
            yaw: rad; heading of the body.
            reach: m; rays end there.

        Returns:
            Palms, z along the surface's normal.
        """
        n, table = len(rays), self.table
        surface, position, rotation = np.empty(n, np.int64), np.zeros((n, 3)), np.zeros((n, 3, 3))
        chosen = self._palm_surfaces
        if len(chosen):
            near = np.linalg.norm(table.centre[chosen] - shoulder, axis=1) < table.radius[chosen] + reach
            chosen = chosen[near]
        if not len(chosen):
            surface[:] = -1
            return Projected(surface, position, rotation)
        distance = np.full(n, np.inf)
        rays = np.ascontiguousarray(rays, dtype=float)
        _project_palms(
            np.asarray(shoulder, float),
            rays,
            float(yaw),
            float(reach),
            self._half[limb, 0],
            self._half[limb, 1],
            chosen,
            table.origin,
            table.rotation,
            table.edges,
            table.edge_start,
            surface,
            distance,
            position,
            rotation,
        )
        if (surface >= 0).any():
            surface[self._blocked(np.asarray(shoulder, float), rays, distance, reach)] = -1
        return Projected(surface, position, rotation)

    def _blocked(self, origin: np.ndarray, rays: np.ndarray, distance: np.ndarray, reach: float) -> np.ndarray:
        """(n,) bool; whether anything that is drawn or collides lies before `distance` (n,) on a ray."""
        n = len(rays)
        geom, hit = np.empty(n, np.int32), np.empty(n)
        mujoco.mj_multiRay(
            self._model, self._data, origin, rays.ravel(), None, True, -1, geom, hit, None, n, reach + 1.0
        )
        return (geom >= 0) & (hit < distance - self.config.block_tolerance)


@numba.njit(cache=True)
def _meets_rectangle(ax, ay, bx, by, hx, hy):
    """Whether the segment a-b meets the rectangle |x| <= hx, |y| <= hy."""
    if min(ax, bx) > hx or max(ax, bx) < -hx or min(ay, by) > hy or max(ay, by) < -hy:
        return False
    dx, dy = bx - ax, by - ay
    # The remaining separating axis: the segment's normal.
    return abs(dx * ay - dy * ax) <= abs(dx) * hy + abs(dy) * hx


@numba.njit(cache=True)
def _fits(u, v, cx, sx, hx, hy, ref_u, ref_v, ref_inside, edges, near, first, last):
    """Whether the rectangle at (u, v) with x axis (cx, sx) lies in a region, from the edges near it."""
    inside = ref_inside
    du, dv = u - ref_u, v - ref_v
    for k in range(first, last):
        e = near[k]
        au, av, bu, bv = edges[e, 0] - u, edges[e, 1] - v, edges[e, 2] - u, edges[e, 3] - v
        if _meets_rectangle(cx * au + sx * av, -sx * au + cx * av, cx * bu + sx * bv, -sx * bu + cx * bv, hx, hy):
            return False
        # Does the edge cross the way from the reference to the centre? Sides of the line through both, half open.
        side_a, side_b = du * av - dv * au, du * bv - dv * bu
        if (side_a > 0.0) != (side_b > 0.0):
            t = side_a / (side_a - side_b)
            along = du * (au + t * (bu - au)) + dv * (av + t * (bv - av))  # 0 at the centre
            if -(du * du + dv * dv) < along < 0.0:
                inside = not inside
    return inside


@numba.njit(cache=True)
def _project_soles(
    pose,
    low,
    high,
    hx,
    hy,
    offsets,
    origin,
    rotation,
    edges,
    corner,
    cell,
    shape,
    entry_start,
    entry_surface,
    entry_inside,
    near_start,
    near,
    surface,
    position,
    orientation,
):
    for row in range(len(pose)):
        c, s = np.cos(pose[row, 2]), np.sin(pose[row, 2])
        surface[row] = -1
        for k in range(len(offsets)):
            x = pose[row, 0] + c * offsets[k, 0] - s * offsets[k, 1]
            y = pose[row, 1] + s * offsets[k, 0] + c * offsets[k, 1]
            i, j = int(np.floor((x - corner[0]) / cell)), int(np.floor((y - corner[1]) / cell))
            if i < 0 or j < 0 or i >= shape[0] or j >= shape[1]:
                continue
            best = low
            for entry in range(entry_start[i * shape[1] + j], entry_start[i * shape[1] + j + 1]):
                q = entry_surface[entry]
                r = rotation[q]
                nx, ny, nz = r[0, 2], r[1, 2], r[2, 2]
                z = origin[q, 2] - (nx * (x - origin[q, 0]) + ny * (y - origin[q, 1])) / nz
                if z > high or z < best:
                    continue
                # x axis of the sole: the heading dropped on the plane.
                ax, ay, az = c * nz, s * nz, -(c * nx + s * ny)
                length = np.sqrt(ax * ax + ay * ay + az * az)
                ax, ay, az = ax / length, ay / length, az / length
                px, py, pz = x - origin[q, 0], y - origin[q, 1], z - origin[q, 2]
                rx = corner[0] + (i + 0.5) * cell - origin[q, 0]
                ry = corner[1] + (j + 0.5) * cell - origin[q, 1]
                rz = -(nx * rx + ny * ry) / nz
                if _fits(
                    r[0, 0] * px + r[1, 0] * py + r[2, 0] * pz,
                    r[0, 1] * px + r[1, 1] * py + r[2, 1] * pz,
                    r[0, 0] * ax + r[1, 0] * ay + r[2, 0] * az,
                    r[0, 1] * ax + r[1, 1] * ay + r[2, 1] * az,
                    hx,
                    hy,
                    r[0, 0] * rx + r[1, 0] * ry + r[2, 0] * rz,
                    r[0, 1] * rx + r[1, 1] * ry + r[2, 1] * rz,
                    entry_inside[entry],
                    edges,
                    near,
                    near_start[entry],
                    near_start[entry + 1],
                ):
                    best = z
                    surface[row] = q
                    position[row, 0], position[row, 1], position[row, 2] = x, y, z
                    o = orientation[row]
                    o[0, 0], o[1, 0], o[2, 0] = ax, ay, az
                    o[0, 1], o[1, 1], o[2, 1] = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
                    o[0, 2], o[1, 2], o[2, 2] = nx, ny, nz
            if surface[row] >= 0:
                break


@numba.njit(cache=True)
def _project_palms(
    shoulder, rays, yaw, reach, hx, hy, chosen, origin, rotation, edges, edge_start, surface, distance, position, orient
):
    c, s = np.cos(yaw), np.sin(yaw)
    for row in range(len(rays)):
        surface[row] = -1
        dx, dy, dz = rays[row, 0], rays[row, 1], rays[row, 2]
        for index in range(len(chosen)):
            q = chosen[index]
            r = rotation[q]
            nx, ny, nz = r[0, 2], r[1, 2], r[2, 2]
            along = nx * dx + ny * dy + nz * dz
            if along > -1e-6:  # the surface faces away
                continue
            ox, oy, oz = shoulder[0] - origin[q, 0], shoulder[1] - origin[q, 1], shoulder[2] - origin[q, 2]
            t = -(nx * ox + ny * oy + nz * oz) / along
            if t <= 0.0 or t > reach or t >= distance[row]:
                continue
            # R(z -> n) applied to the heading: v + w x v + w x (w x v) / (1 + n_z) with w = z x n.
            wx, wy = -ny, nx
            tz = wx * s - wy * c
            ax = c + wy * tz / (1.0 + nz)
            ay = s - wx * tz / (1.0 + nz)
            az = tz
            px, py, pz = ox + t * dx, oy + t * dy, oz + t * dz
            u, v = r[0, 0] * px + r[1, 0] * py + r[2, 0] * pz, r[0, 1] * px + r[1, 1] * py + r[2, 1] * pz
            cx, sx = r[0, 0] * ax + r[1, 0] * ay + r[2, 0] * az, r[0, 1] * ax + r[1, 1] * ay + r[2, 1] * az
            inside = False
            free = True
            for e in range(edge_start[q], edge_start[q + 1]):
                au, av, bu, bv = edges[e, 0] - u, edges[e, 1] - v, edges[e, 2] - u, edges[e, 3] - v
                if _meets_rectangle(
                    cx * au + sx * av, -sx * au + cx * av, cx * bu + sx * bv, -sx * bu + cx * bv, hx, hy
                ):
                    free = False
                    break
                if (av > 0.0) != (bv > 0.0) and 0.0 < au - av / (bv - av) * (bu - au):
                    inside = not inside
            if free and inside:
                surface[row] = q
                distance[row] = t
                for axis in range(3):
                    position[row, axis] = shoulder[axis] + t * rays[row, axis]
                o = orient[row]
                o[0, 0], o[1, 0], o[2, 0] = ax, ay, az
                o[0, 1], o[1, 1], o[2, 1] = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
                o[0, 2], o[1, 2], o[2, 2] = nx, ny, nz
