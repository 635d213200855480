"""How far it is to the goal for a floating box on an SE(2) grid (paper, Sec. V), and the search's heuristic from it.

Cells are 8-connected in XY with free turning in place. A cell counts where a sole finds a surface within half a stride
(so that gaps up to the longest stride can be crossed, wider ones not) and the body fits above it. Since ground can
lie above ground, a cell has one node for each height. Dijkstra runs once, from all cells in the goal region.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from toolkit.contacts.projection import Projector, cell_of, plane_height, sole_fits
from toolkit.geometry.limb import Limb
from toolkit.search.occupancy import BodyBox, Occupancy, body_free
from toolkit.world.world import Goal

_LEVELS = 4  # heights kept per cell
_OCTILE = 1.0 / 1.0823923  # largest ratio of 8-connected to straight distance, inverted: keeps the estimate low


class Distance(Protocol):
    """Estimates the way to the goal."""

    def __call__(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n,) m to the goal region from the mean of the feet (n, 3) m with heading (n,) rad; inf: no way."""
        ...


@dataclass(frozen=True)
class EuclideanDistance:
    """The straight line in XY, which knows nothing of walls and gaps."""

    goal: Goal

    def __call__(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """See `Distance`."""
        return np.maximum(np.hypot(*(position[:, :2] - self.goal.position[:2]).T) - self.goal.radius, 0.0)


@dataclass(frozen=True)
class GridConfig:
    """Settings of the grid.

    Attributes:
        cell: m; enlarged where the world would need more than `max_cells`.
        yaws: layers over half a turn (the box is the same both ways).
        climb: m; largest change of height between neighbouring cells.
        merge: m; heights in one cell that differ by less are one.
        turn: m; cost of one yaw layer, only there to prefer straight ways.
        max_cells: of the XY grid.
    """

    cell: float = 0.1
    yaws: int = 8
    climb: float = 0.35
    merge: float = 0.3
    turn: float = 1e-4
    max_cells: int = 200_000


class GridDistance:
    """Distance to the goal on the grid.

    Args:
        projector: finds where soles have room.
        occupancy: of the world.
        box: the body.
        goal: where to.
        bounds: (xmin, ymin, xmax, ymax) m of the grid.
        stride: m; longest step.
        config: settings.

    Attributes:
        supported: whether any cell in the goal region has a surface for a sole.
    """

    def __init__(
        self,
        projector: Projector,
        occupancy: Occupancy,
        box: BodyBox,
        goal: Goal,
        bounds: tuple[float, float, float, float],
        stride: float,
        config: GridConfig | None = None,
    ):
        self.config = config = config or GridConfig()
        self._goal = goal
        extent = np.array(bounds[2:]) - bounds[:2]
        self._cell = cell = max(config.cell, float(np.sqrt(extent.prod() / config.max_cells)))
        shape = np.ceil(extent / cell).astype(np.int64) + 1
        self._corner = np.array(bounds[:2], float)
        levels = self._levels(projector, shape, stride)
        self._height = levels
        nodes = np.full((*levels.shape, config.yaws), -1, np.int32)
        count = _nodes(
            levels,
            self._corner,
            cell,
            occupancy.corner,
            occupancy.cell,
            occupancy.below,
            np.array([box.half_depth, box.half_width, box.bottom, box.top]),
            nodes,
        )
        self._distance = np.full(nodes.shape, np.inf, np.float64)
        middle = self._corner + cell * np.stack(np.meshgrid(*(np.arange(k) for k in shape), indexing="ij"), axis=-1)
        inside = np.hypot(*(middle - goal.position[:2]).transpose(2, 0, 1)) <= max(goal.radius, 0.75 * cell)
        targets = nodes[inside]
        targets = targets[targets >= 0]
        self.supported = bool((levels[inside] > -np.inf).any())
        if len(targets):
            start, none = np.zeros(count + 1, np.int32), np.zeros(0)
            grid = (nodes, levels, cell, config.climb, config.turn, start)
            edges = _edges(*grid, none.astype(np.int32), none)
            end, weight = np.empty(edges, np.int32), np.empty(edges)
            _edges(*grid, end, weight)
            graph = csr_matrix((weight, end, start), shape=(count, count))
            distance = dijkstra(graph, directed=True, indices=targets, min_only=True)
            self._distance[nodes >= 0] = distance[nodes[nodes >= 0]]

    def _levels(self, projector: Projector, shape: np.ndarray, stride: float) -> np.ndarray:
        """(nx, ny, 4) float heights of ground in reach of each cell, -inf where there is none."""
        cell = self._cell
        low = np.full((*shape, _LEVELS), -np.inf)
        _sole_levels(
            self._corner,
            cell,
            projector.half_sizes[Limb.LEFT_FOOT],
            np.ascontiguousarray(projector.offsets),
            self.config.merge,
            projector.table,
            low,
        )
        reach = stride / 2 / cell
        k = int(np.floor(reach))
        disc = [(i, j) for i in range(-k, k + 1) for j in range(-k, k + 1) if 0 < i * i + j * j <= reach**2]
        disc.sort(key=lambda ij: (ij[0] ** 2 + ij[1] ** 2, ij))
        levels = low.copy()
        _spread(low, np.array(disc, np.int64).reshape(-1, 2), self.config.merge, levels)
        return levels

    def __call__(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """See `Distance`; at least the straight line."""
        position, yaw = np.ascontiguousarray(position, dtype=float), np.ascontiguousarray(yaw, dtype=float)
        grid = np.empty(len(position))
        _query(position, yaw, self._corner, self._cell, self._height, self._distance, grid)
        straight = np.hypot(*(position[:, :2] - self._goal.position[:2]).T) - self._goal.radius
        return np.maximum(np.maximum(grid * _OCTILE - 0.5 * self._cell, straight), 0.0)


@numba.njit(cache=True, error_model="numpy")
def _add_level(levels, z, merge):
    """Note a height in a list that falls, -inf where free; of close heights the highest stays."""
    for k in range(len(levels)):
        if abs(levels[k] - z) < merge:
            levels[k] = max(levels[k], z)
            return
        if levels[k] < z:
            for m in range(len(levels) - 1, k, -1):
                levels[m] = levels[m - 1]
            levels[k] = z
            return


@numba.njit(cache=True, error_model="numpy")
def _sole_levels(corner, cell, half, offsets, merge, table, result):
    """Fill heights (nx, ny, 4) at which a sole has room in each cell, in any of four headings, with a small shift."""
    for a in range(result.shape[0]):
        for b in range(result.shape[1]):
            for k in range(len(offsets)):
                x, y = corner[0] + a * cell + offsets[k, 0], corner[1] + b * cell + offsets[k, 1]
                place = cell_of(table, x, y)
                if place < 0:
                    continue
                for entry in range(table.entry_start[place], table.entry_start[place + 1]):
                    z = plane_height(table, table.entry_surface[entry], x, y)
                    known = False
                    for m in range(_LEVELS):
                        known |= abs(result[a, b, m] - z) < 0.5 * merge
                    if known:
                        continue
                    for turn in range(4):
                        angle = turn * np.pi / 4
                        if sole_fits(table, place, entry, x, y, np.cos(angle), np.sin(angle), half):
                            _add_level(result[a, b], z, merge)
                            break


@numba.njit(cache=True, error_model="numpy")
def _spread(levels, disc, merge, result):
    """Add to a copy of the heights of each cell those of the cells around it, the nearer before the farther."""
    for a in range(levels.shape[0]):
        for b in range(levels.shape[1]):
            for k in range(len(disc)):
                i, j = a + disc[k, 0], b + disc[k, 1]
                if i < 0 or j < 0 or i >= levels.shape[0] or j >= levels.shape[1]:
                    continue
                for m in range(_LEVELS):
                    z = levels[i, j, m]
                    if z == -np.inf:
                        break
                    new = True
                    for n in range(_LEVELS):
                        new &= not abs(result[a, b, n] - z) < merge
                    if new:
                        _add_level(result[a, b], z, merge)
    return result


@numba.njit(cache=True, error_model="numpy")
def _nodes(levels, corner, cell, body_corner, body_cell, below, box, nodes):
    """Number in (nx, ny, 4, yaws) nodes the cells in which the body fits; returns how many there are."""
    count = 0
    yaws = nodes.shape[3]
    for a in range(levels.shape[0]):
        for b in range(levels.shape[1]):
            for m in range(_LEVELS):
                z = levels[a, b, m]
                if z == -np.inf:
                    break
                x, y = corner[0] + a * cell, corner[1] + b * cell
                for k in range(yaws):
                    if body_free(body_corner, body_cell, below, box, x, y, z, k * np.pi / yaws):
                        nodes[a, b, m, k] = count
                        count += 1
    return count


@numba.njit(cache=True, error_model="numpy")
def _edges(nodes, levels, cell, climb, turn, start, end, weight):
    """Compressed rows of the grid graph; every edge goes both ways.

    Fills start (count + 1,) and returns the number of edges; with room for them also their ends and lengths.
    """
    used = 0
    yaws = nodes.shape[3]
    write = len(end) > 0
    for a in range(nodes.shape[0]):
        for b in range(nodes.shape[1]):
            for m in range(_LEVELS):
                for k in range(yaws):
                    node = nodes[a, b, m, k]
                    if node < 0:
                        continue
                    for step in range(-1, 2, 2):
                        other = nodes[a, b, m, (k + step) % yaws]
                        if other >= 0 and other != node:
                            if write:
                                end[used], weight[used] = other, turn
                            used += 1
                    for i in range(max(a - 1, 0), min(a + 2, nodes.shape[0])):
                        for j in range(max(b - 1, 0), min(b + 2, nodes.shape[1])):
                            if i == a and j == b:
                                continue
                            for n in range(_LEVELS):
                                other = nodes[i, j, n, k]
                                if other >= 0 and abs(levels[i, j, n] - levels[a, b, m]) <= climb:
                                    if write:
                                        end[used] = other
                                        weight[used] = cell * np.sqrt(float((i - a) ** 2 + (j - b) ** 2))
                                    used += 1
                    start[node + 1] = used
    return used


@numba.njit(cache=True, error_model="numpy")
def _cell_value(height, distance, i, j, z, layer, span):
    """Least distance of a cell over the yaw layers around one, at the level nearest to a height."""
    if i < 0 or j < 0 or i >= height.shape[0] or j >= height.shape[1]:
        return np.inf
    level = 0
    for m in range(1, height.shape[2]):
        if abs(height[i, j, m] - z) < abs(height[i, j, level] - z):
            level = m
    if not abs(height[i, j, level] - z) < 0.5:
        return np.inf
    best = np.inf
    for k in range(-span, span + 1):
        best = min(best, distance[i, j, level, (layer + k) % distance.shape[3]])
    return best


@numba.njit(cache=True, error_model="numpy")
def _query(position, yaw, corner, cell, height, distance, result):
    """Fill distances (n,), interpolated between cells; others near stand in where the four around are blocked."""
    yaws = distance.shape[3]
    for row in range(len(position)):
        x, y = (position[row, 0] - corner[0]) / cell, (position[row, 1] - corner[1]) / cell
        z = position[row, 2]
        layer = int(np.floor(yaw[row] / np.pi * yaws + 0.5)) % yaws
        i, j = int(np.floor(x)), int(np.floor(y))
        fx, fy = x - i, y - j
        total, weights = 0.0, 0.0
        for di in range(2):
            for dj in range(2):
                value = _cell_value(height, distance, i + di, j + dj, z, layer, 1)
                weight = (fx if di else 1.0 - fx) * (fy if dj else 1.0 - fy)
                if value < np.inf and weight > 0.0:
                    total += weight * value
                    weights += weight
        if weights > 0.0:
            result[row] = total / weights
            continue
        result[row] = np.inf
        for di in range(-2, 4):
            for dj in range(-2, 4):
                value = _cell_value(height, distance, i + di, j + dj, z, layer, 2)
                if value < np.inf:
                    away = cell * np.sqrt((di - fx) ** 2 + (dj - fy) ** 2)
                    result[row] = min(result[row], value + away)
