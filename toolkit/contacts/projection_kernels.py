"""Compiled projection: whether a patch fits on a surface, and which surface it meets first."""

from __future__ import annotations

import numpy as np

from toolkit.compiled import compiled
from toolkit.geometry.plane import along_plane, plane_height


@compiled
def _meets_rectangle(ax, ay, bx, by, hx, hy):
    """Whether the segment a-b meets the rectangle |x| <= hx, |y| <= hy."""
    if min(ax, bx) > hx or max(ax, bx) < -hx or min(ay, by) > hy or max(ay, by) < -hy:
        return False
    dx, dy = bx - ax, by - ay
    # The remaining separating axis: the segment's normal.
    return abs(dx * ay - dy * ax) <= abs(dx) * hy + abs(dy) * hx


@compiled
def in_plane(r, x, y, z):
    """The two coordinates of a vector (x, y, z) along a surface whose axes are the columns of r."""
    return r[0, 0] * x + r[1, 0] * y + r[2, 0] * z, r[0, 1] * x + r[1, 1] * y + r[2, 1] * z


@compiled
def cell_of(table, x, y):
    """Index of the cell of the table's grid at (x, y), or -1 outside."""
    i, j = int(np.floor((x - table.corner[0]) / table.cell)), int(np.floor((y - table.corner[1]) / table.cell))
    return i * table.shape[1] + j if 0 <= i < table.shape[0] and 0 <= j < table.shape[1] else -1


@compiled
def sole_fits(table, cell, entry, x, y, c, s, half):
    """Whether a sole with centre above (x, y) and heading (c, s) has room on the surface of an entry of that cell."""
    q = table.entry_surface[entry]
    r, origin, edges = table.rotation[q], table.origin[q], table.edges
    ax, ay, az = along_plane(table.rotation[q, :, 2], c, s)
    cx, sx = in_plane(r, ax, ay, az)
    # p and d are taken to the surface frame: the centre, and the way to it from the cell's reference point.
    px, py, pz = x - origin[0], y - origin[1], plane_height(table.origin[q], table.rotation[q, :, 2], x, y) - origin[2]
    i, j = cell // table.shape[1], cell % table.shape[1]
    rx, ry = table.corner[0] + (i + 0.5) * table.cell, table.corner[1] + (j + 0.5) * table.cell
    dx, dy, dz = (
        px - rx + origin[0],
        py - ry + origin[1],
        pz - plane_height(table.origin[q], table.rotation[q, :, 2], rx, ry) + origin[2],
    )
    u, v = in_plane(r, px, py, pz)
    du, dv = in_plane(r, dx, dy, dz)
    inside = table.entry_inside[entry]
    for k in range(table.near_start[entry], table.near_start[entry + 1]):
        e = table.near[k]
        au, av, bu, bv = edges[e, 0] - u, edges[e, 1] - v, edges[e, 2] - u, edges[e, 3] - v
        if _meets_rectangle(
            cx * au + sx * av, -sx * au + cx * av, cx * bu + sx * bv, -sx * bu + cx * bv, half[0], half[1]
        ):
            return False
        # The edge crosses the way from the reference point to the centre if its ends lie on different sides of it.
        side_a, side_b = du * av - dv * au, du * bv - dv * bu
        if (side_a > 0.0) != (side_b > 0.0):
            t = side_a / (side_a - side_b)
            along = du * (au + t * (bu - au)) + dv * (av + t * (bv - av))  # 0 at the centre
            if -(du * du + dv * dv) < along < 0.0:
                inside = not inside
    return inside


@compiled
def _set_frame(frame, ax, ay, az, nx, ny, nz):
    """Write the axes of a contact frame from its x and z."""
    frame[0, 0], frame[1, 0], frame[2, 0] = ax, ay, az
    frame[0, 1], frame[1, 1], frame[2, 1] = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
    frame[0, 2], frame[1, 2], frame[2, 2] = nx, ny, nz


@compiled(kept=True)
def project_soles(pose, low, high, half, offsets, table, surface, position, orientation):
    """Fill surface, position and orientation; see `Projector.project_soles`."""
    for row in range(len(pose)):
        c, s = np.cos(pose[row, 2]), np.sin(pose[row, 2])
        surface[row] = -1
        for k in range(len(offsets)):
            x = pose[row, 0] + c * offsets[k, 0] - s * offsets[k, 1]
            y = pose[row, 1] + s * offsets[k, 0] + c * offsets[k, 1]
            cell = cell_of(table, x, y)
            if cell < 0:
                continue
            best = low
            for entry in range(table.entry_start[cell], table.entry_start[cell + 1]):
                q = table.entry_surface[entry]
                z = plane_height(table.origin[q], table.rotation[q, :, 2], x, y)
                if best <= z <= high and sole_fits(table, cell, entry, x, y, c, s, half):
                    best = z
                    surface[row] = q
                    position[row, 0], position[row, 1], position[row, 2] = x, y, z
            q = surface[row]
            if q >= 0:
                ax, ay, az = along_plane(table.rotation[q, :, 2], c, s)
                nx, ny, nz = table.rotation[q, 0, 2], table.rotation[q, 1, 2], table.rotation[q, 2, 2]
                _set_frame(orientation[row], ax, ay, az, nx, ny, nz)
                break


@compiled(kept=True)
def project_palms(shoulder, rays, yaw, reach, half, chosen, table, surface, distance, position, orientation):
    """Fill surface, distance, position and orientation; see `Projector.project_palms`."""
    c, s = np.cos(yaw), np.sin(yaw)
    for row in range(len(rays)):
        surface[row] = -1
        dx, dy, dz = rays[row, 0], rays[row, 1], rays[row, 2]
        for index in range(len(chosen)):
            q = chosen[index]
            r, origin, edges = table.rotation[q], table.origin[q], table.edges
            nx, ny, nz = r[0, 2], r[1, 2], r[2, 2]
            along = nx * dx + ny * dy + nz * dz
            if along > -1e-6:  # the surface faces away
                continue
            ox, oy, oz = shoulder[0] - origin[0], shoulder[1] - origin[1], shoulder[2] - origin[2]
            t = -(nx * ox + ny * oy + nz * oz) / along
            if t <= 0.0 or t > reach or t >= distance[row]:
                continue
            # The least rotation from z to n applied to the heading: v + w x v + w x (w x v) / (1 + n_z), w = z x n.
            az = -ny * s - nx * c
            ax, ay = c + nx * az / (1.0 + nz), s + ny * az / (1.0 + nz)
            px, py, pz = ox + t * dx, oy + t * dy, oz + t * dz
            u, v = in_plane(r, px, py, pz)
            cx, sx = in_plane(r, ax, ay, az)
            inside = False
            free = True
            for e in range(table.edge_start[q], table.edge_start[q + 1]):
                au, av, bu, bv = edges[e, 0] - u, edges[e, 1] - v, edges[e, 2] - u, edges[e, 3] - v
                if _meets_rectangle(
                    cx * au + sx * av, -sx * au + cx * av, cx * bu + sx * bv, -sx * bu + cx * bv, half[0], half[1]
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
                _set_frame(orientation[row], ax, ay, az, nx, ny, nz)
