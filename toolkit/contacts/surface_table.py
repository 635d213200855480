"""Surfaces as flat arrays with an index by place, for the compiled projection of soles and palms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np

from toolkit.world.surface import Surface

_MAX_CELLS = 400_000
# No cell's centre should lie on an authored edge: edges like round numbers, this offset does not.
_OFFSET = np.array([0.0417319, 0.0283727])


class SurfaceTable(NamedTuple):
    """Arrays over S surfaces with E boundary edges, and a grid over XY whose cells list what matters in them.

    Attributes:
        origin: (S, 3) m, rotation: (S, 3, 3); world_from_surface.
        friction: (S,).
        foot, palm: (S,) bool.
        edges: (E, 4) m; u, v of both ends in the surface frame, rings closed.
        edge_start: (S + 1,) int; edges of surface s are edge_start[s] : edge_start[s + 1].
        centre: (S, 3) m and radius: (S,) m; a sphere around each.
        corner: (2,) m; lower corner of the grid.
        cell: m; its cell size.
        shape: (2,) int; cells along x and y.
        entry_start: (cells + 1,) int; entries of cell (i, j) at i * shape[1] + j.
        entry_surface: (n,) int; a foot surface that may hold a patch centred in the cell.
        entry_inside: (n,) bool; whether the cell's centre, dropped on the plane, lies in the region.
        near_start: (n + 1,) int and near: (m,) int; edges that a patch centred in the cell may meet.
    """

    origin: np.ndarray
    rotation: np.ndarray
    friction: np.ndarray
    foot: np.ndarray
    palm: np.ndarray
    edges: np.ndarray
    edge_start: np.ndarray
    centre: np.ndarray
    radius: np.ndarray
    corner: np.ndarray
    cell: float
    shape: np.ndarray
    entry_start: np.ndarray
    entry_surface: np.ndarray
    entry_inside: np.ndarray
    near_start: np.ndarray
    near: np.ndarray


def surface_table(surfaces: Sequence[Surface], reach: float, cell: float = 0.1) -> SurfaceTable:
    """Table of surfaces.

    Args:
        surfaces: of a world; at least one.
        reach: m; distance from a patch's centre to its corners.
        cell: m; wanted cell size; larger where the world would need too many cells.
    """
    origin = np.array([surface.pose.position for surface in surfaces]).reshape(-1, 3)
    rotation = np.array([surface.pose.rotation for surface in surfaces]).reshape(-1, 3, 3)
    edges, start = [], [0]
    for surface in surfaces:
        for ring in surface.boundary:
            edges.append(np.concatenate([ring, np.roll(ring, -1, axis=0)], axis=1))
        start.append(start[-1] + sum(len(ring) for ring in surface.boundary))
    edges, start = np.concatenate(edges), np.array(start)
    owner = np.repeat(np.arange(len(surfaces)), np.diff(start))
    points = origin[owner] + np.einsum("nij,nj->ni", rotation[owner][:, :, :2], edges[:, :2])
    lower, upper = np.minimum.reduceat(points, start[:-1]), np.maximum.reduceat(points, start[:-1])
    foot = np.array([surface.serves_foot for surface in surfaces])

    low, high = points[:, :2].min(0), points[:, :2].max(0)
    cell = max(cell, float(np.sqrt((high - low + cell).prod() / _MAX_CELLS)))
    corner = low - cell * (1.0 + _OFFSET)
    shape = (np.ceil((high - corner) / cell) + 1).astype(np.int64)
    index = _index(
        origin, rotation, edges, start, np.flatnonzero(foot), lower[:, :2], upper[:, :2], corner, cell, shape, reach
    )
    return SurfaceTable(
        origin=origin,
        rotation=rotation,
        friction=np.array([surface.friction for surface in surfaces]),
        foot=foot,
        palm=np.array([surface.serves_palm for surface in surfaces]),
        edges=edges,
        edge_start=start,
        centre=(lower + upper) / 2,
        radius=np.linalg.norm(upper - lower, axis=1) / 2,
        corner=corner,
        cell=cell,
        shape=shape,
        **dict(zip(("entry_start", "entry_surface", "entry_inside", "near_start", "near"), index, strict=True)),
    )


@numba.njit(cache=True)
def _distance_to_segment(x, y, ax, ay, bx, by):
    """Distance from a point to a segment."""
    dx, dy = bx - ax, by - ay
    length = dx * dx + dy * dy
    t = 0.0 if length == 0.0 else min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / length))
    return np.hypot(ax + t * dx - x, ay + t * dy - y)


@numba.njit(cache=True)
def _index(origin, rotation, edges, edge_start, surfaces, lower, upper, corner, cell, shape, reach):
    """Entries by cell; see `SurfaceTable`."""
    cells = shape[0] * shape[1]
    count = np.zeros(cells + 1, np.int64)
    ranges = np.empty((len(surfaces), 4), np.int64)
    for k in range(len(surfaces)):
        s = surfaces[k]
        for axis in range(2):
            ranges[k, 2 * axis] = int((lower[s, axis] - corner[axis]) / cell)
            ranges[k, 2 * axis + 1] = int((upper[s, axis] - corner[axis]) / cell) + 1
        for i in range(ranges[k, 0], ranges[k, 1]):
            for j in range(ranges[k, 2], ranges[k, 3]):
                count[i * shape[1] + j + 1] += 1
    entry_start = np.cumsum(count)
    total = entry_start[-1]
    entry_surface = np.empty(total, np.int64)
    entry_edges = np.zeros(total + 1, np.int64)  # becomes near_start
    entry_inside = np.zeros(total, np.bool_)
    fill = entry_start[:-1].copy()
    near_distance = reach + cell * np.sqrt(0.5)
    near = np.empty(0, np.int64)
    for step in range(2):  # count the near edges, then write them
        fill[:] = entry_start[:-1]
        if step == 1:
            entry_edges = np.cumsum(entry_edges)
            near = np.empty(entry_edges[-1], np.int64)
        for k in range(len(surfaces)):
            s = surfaces[k]
            first, last = edge_start[s], edge_start[s + 1]
            xy = np.empty((last - first, 4))
            for e in range(first, last):
                for end in range(2):
                    u, v = edges[e, 2 * end], edges[e, 2 * end + 1]
                    for axis in range(2):
                        xy[e - first, 2 * end + axis] = (
                            origin[s, axis] + rotation[s, axis, 0] * u + rotation[s, axis, 1] * v
                        )
            for i in range(ranges[k, 0], ranges[k, 1]):
                for j in range(ranges[k, 2], ranges[k, 3]):
                    x, y = corner[0] + (i + 0.5) * cell, corner[1] + (j + 0.5) * cell
                    entry = fill[i * shape[1] + j]
                    fill[i * shape[1] + j] += 1
                    written = 0
                    inside = False
                    for e in range(last - first):
                        ax, ay, bx, by = xy[e, 0], xy[e, 1], xy[e, 2], xy[e, 3]
                        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
                            inside = not inside
                        if min(ax, bx) - x > near_distance or x - max(ax, bx) > near_distance:
                            continue
                        if min(ay, by) - y > near_distance or y - max(ay, by) > near_distance:
                            continue
                        if _distance_to_segment(x, y, ax, ay, bx, by) <= near_distance:
                            if step == 1:
                                near[entry_edges[entry] + written] = first + e
                            written += 1
                    if step == 0:
                        entry_surface[entry] = s
                        entry_inside[entry] = inside
                        entry_edges[entry + 1] = written
    return entry_start, entry_surface, entry_inside, entry_edges, near
