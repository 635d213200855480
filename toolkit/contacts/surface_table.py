"""Surfaces as flat arrays, with a grid that finds them by place, for the compiled projection of soles and palms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.world.surface import Surface

_CELL = 0.1  # m; cell size, larger where the world would need more than the following number of cells
_MAX_CELLS = 400_000
# No cell's centre should lie on an authored edge. Those edges often lie at round numbers, so this offset is not round.
_OFFSET = np.array([0.0417319, 0.0283727])


class SurfaceTable(NamedTuple):
    """Arrays over S surfaces with E boundary edges, and a grid over XY whose cells list what matters in them.

    Attributes:
        origin, rotation: (S, 3) m and (S, 3, 3) world_from_surface.
        friction: (S,) Coulomb coefficients.
        foot, palm: (S,) bool Whether each serves feet, and palms.
        edges: (E, 4) Both ends (u, v) of the edges of closed rings in the surface frame, in m.
        edge_start: (S + 1,) int Surface s has the edges edge_start[s] : edge_start[s + 1].
        centre, radius: (S, 3) m and (S,) m A sphere around each surface.
        corner: (2,) Lower corner of the grid, in m.
        cell: Cell size of the grid, in m.
        shape: (2,) int Number of cells along x and y.
        entry_start: (cells + 1,) int First entry of each cell; cell (i, j) has the number i * shape[1] + j.
        entry_surface: (n,) int A foot surface that may hold a patch centred in the cell.
        entry_inside: (n,) bool Whether the cell's centre, projected on the plane, lies in the region.
        near_start, near: (n + 1,) int and (m,) int Edges that a patch centred in the cell may meet.
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


def surface_table(surfaces: Sequence[Surface], reach: float) -> SurfaceTable:
    """Table of the surfaces of a world, at least one; a patch's corners are `reach` m from its centre."""
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
    cell = max(_CELL, float(np.sqrt((high - low + _CELL).prod() / _MAX_CELLS)))
    corner = low - cell * (1.0 + _OFFSET)
    shape = (np.ceil((high - corner) / cell) + 1).astype(np.int64)
    used = np.flatnonzero(foot)
    first = ((lower[used, :2] - corner) / cell).astype(np.int64)
    last = ((upper[used, :2] - corner) / cell).astype(np.int64) + 1
    ranges = np.stack([first[:, 0], last[:, 0], first[:, 1], last[:, 1]], axis=1)
    ends = origin[owner][:, None] + np.einsum("nij,nkj->nki", rotation[owner][:, :, :2], edges.reshape(-1, 2, 2))
    edges_xy = np.ascontiguousarray(ends[..., :2]).reshape(-1, 4)
    near_distance = reach + cell * np.sqrt(0.5)
    table = SurfaceTable(
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
        **_entries(ranges, shape),
    )
    _fill(table, edges_xy, used, ranges, near_distance, table.entry_start[:-1].copy())
    near_start = np.cumsum(table.near_start)
    table = table._replace(near_start=near_start, near=np.zeros(int(near_start[-1]), np.int64))
    if len(table.near):
        _fill(table, edges_xy, used, ranges, near_distance, table.entry_start[:-1].copy())
    return table


def _entries(ranges: np.ndarray, shape: np.ndarray) -> dict[str, np.ndarray]:
    """The last five fields of `SurfaceTable`, with room for all entries; see `_fill` for `ranges`."""
    count = np.zeros((shape[0] + 1, shape[1] + 1), np.int64)  # of differences: every range adds a rectangle
    for low, high, sign in ((0, 2, 1), (1, 3, 1), (0, 3, -1), (1, 2, -1)):
        np.add.at(count, (ranges[:, low], ranges[:, high]), sign)
    per_cell = count.cumsum(0).cumsum(1)[: shape[0], : shape[1]].ravel()
    total = int(per_cell.sum())
    return {
        "entry_start": np.concatenate([[0], np.cumsum(per_cell)]),
        "entry_surface": np.zeros(total, np.int64),
        "entry_inside": np.zeros(total, bool),
        "near_start": np.zeros(total + 1, np.int64),
        "near": np.zeros(0, np.int64),
    }


@compiled
def _distance_to_segment(x, y, ax, ay, bx, by):
    """Distance from a point to a segment."""
    dx, dy = bx - ax, by - ay
    length = dx * dx + dy * dy
    t = 0.0 if length == 0.0 else min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / length))
    return np.hypot(ax + t * dx - x, ay + t * dy - y)


@compiled(kept=True)
def _fill(table, xy, surfaces, ranges, near_distance, fill):
    """Fill the entries of a table; count the near edges of entry k in near_start[k + 1] while `near` has no room.

    `xy` (E, 4) m holds both ends of the edges in the world's XY, and `surfaces` (k,) those that serve feet. `ranges`
    (k, 4) are the cells that each of these covers: i from, i to, j from, j to. An edge is near within `near_distance` m
    of a cell's centre. `fill` (cells,) is the next entry of each cell, counted up.
    """
    near_start, near, corner, cell, columns = table.near_start, table.near, table.corner, table.cell, table.shape[1]
    write = len(near) > 0
    for k in range(len(surfaces)):
        first, last = table.edge_start[surfaces[k]], table.edge_start[surfaces[k] + 1]
        for i in range(ranges[k, 0], ranges[k, 1]):
            for j in range(ranges[k, 2], ranges[k, 3]):
                x, y = corner[0] + (i + 0.5) * cell, corner[1] + (j + 0.5) * cell
                entry = fill[i * columns + j]
                fill[i * columns + j] += 1
                written = 0
                inside = False
                for e in range(first, last):
                    ax, ay, bx, by = xy[e, 0], xy[e, 1], xy[e, 2], xy[e, 3]
                    if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
                        inside = not inside
                    if min(ax, bx) - x > near_distance or x - max(ax, bx) > near_distance:
                        continue
                    if min(ay, by) - y > near_distance or y - max(ay, by) > near_distance:
                        continue
                    if _distance_to_segment(x, y, ax, ay, bx, by) <= near_distance:
                        if write:
                            near[near_start[entry] + written] = e
                        written += 1
                table.entry_surface[entry] = surfaces[k]
                table.entry_inside[entry] = inside
                if not write:
                    near_start[entry + 1] = written
