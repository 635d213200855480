"""Distance to the goal for a floating box on an SE(2) grid (paper, Sec. V).

Cells are 8-connected in XY with free turning in place. A cell counts where the body fits above it and a sole finds a
surface within half a stride. So gaps up to the longest stride can be crossed, wider ones not. Since ground can
lie above ground, a cell has one node for each height. Dijkstra runs once, from all cells in the goal region.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from toolkit.contacts.footholds import Footholds
from toolkit.contacts.projection import Projector
from toolkit.contacts.surface_table import SurfaceTable
from toolkit.geometry.limb import Limb
from toolkit.search.costs.grid_kernels import (
    LEVELS,
    add_level,
    link_nodes,
    number_nodes,
    query,
    sole_levels,
    spread,
    spread_forward,
)
from toolkit.search.costs.proof_kernels import disc, flood, mark_between, mark_stances
from toolkit.search.moves.occupancy import BodyBox, Occupancy
from toolkit.world.world import Goal

_MAX_NODES = 1_600_000  # cells in XY times layers of yaw; cells are larger where the world would need more
_FORESEEN = 3  # the way's heading is that over two to the power of this edges
_OCTILE = 1.0 / 1.0823923  # largest ratio of 8-connected to straight distance, inverted: keeps the estimate low


class Distance(Protocol):
    """How far the goal region is, and which way leads there."""

    def __call__(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n,) m from the mean of the feet (n, 3) m with heading (n,) rad; inf where no way leads there."""
        ...

    def ahead(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n,) rad; heading of the way from the same places. NaN where there is none, or it is at its end."""
        ...


@dataclass(frozen=True)
class EuclideanDistance:
    """The straight line in XY, which ignores walls and gaps."""

    goal: Goal

    def __call__(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """See `Distance`."""
        return np.maximum(np.hypot(*(position[:, :2] - self.goal.position[:2]).T) - self.goal.radius, 0.0)

    def ahead(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """See `Distance`."""
        x, y = (self.goal.position[:2] - position[:, :2]).T
        return np.arctan2(y, x)


class GridBody(NamedTuple):
    """The body that moves over a grid, and what makes its way longer.

    Attributes:
        box: The body, standing straight.
        core: A part of it; where this does not fit at a node, the places around it are not tried.
        places: (n, 3) m, m, rad; places around each node. One where the body fits is enough.
        drops: (k,) m; rising heights by which the CoM may be lower.
        turn: Cost in m of one layer of yaw.
        sideways: Length that is added to a m of way across the heading.
        bent: Length that is added to a m of way with a lowered CoM.
    """

    box: BodyBox
    core: BodyBox
    places: np.ndarray
    drops: np.ndarray
    turn: float
    sideways: float
    bent: float


@dataclass(frozen=True)
class Mesh:
    """How fine a grid is.

    Attributes:
        cell: Edge of a cell in m.
        yaws: Layers of yaw over half a turn; a box is the same both ways.
        merge: Heights in one cell that differ by less m are one.
        near: A place is on a level that is less than so many m above or below it.
    """

    cell: float
    yaws: int
    merge: float = 0.3
    near: float = 0.5

    def scaled(self, factor: float) -> Mesh:
        """The same with its lengths multiplied by a factor."""
        return Mesh(factor * self.cell, self.yaws, factor * self.merge, factor * self.near)


class GridDistance:
    """Distance to the goal on a grid with bounds (xmin, ymin, xmax, ymax) m, with steps of at most `stride` m.

    Heights of neighbouring cells differ by `climb` m at most. `footholds` are places on the same surfaces.

    Attributes:
        supported: Whether any cell in the goal region has a surface for a sole.
    """

    def __init__(
        self,
        projector: Projector,
        occupancy: Occupancy,
        body: GridBody,
        mesh: Mesh,
        goal: Goal,
        bounds: tuple[float, float, float, float],
        stride: float,
        climb: float,
        footholds: Footholds,
    ):
        self._goal, self._merge, self._near = goal, mesh.merge, mesh.near
        extent = np.array(bounds[2:]) - bounds[:2]
        self._cell = cell = max(mesh.cell, float(np.sqrt(extent.prod() * mesh.yaws / _MAX_NODES)))
        shape = np.ceil(extent / cell).astype(np.int64) + 1
        self._corner = np.array(bounds[:2], float)
        self._soles = self._grounds(projector, footholds, shape)
        levels, around = self._soles.copy(), disc(stride / 2 / cell)
        spread(self._soles, around, self._merge, levels)
        self._height, self._stride, self._climb = levels, stride, climb
        nodes = np.full((*levels.shape, mesh.yaws), -1, np.int32)
        low = np.zeros(nodes.shape, np.bool_)
        count = number_nodes(levels, self._corner, cell, occupancy, body, nodes, low)
        self._distance = np.full(nodes.shape, np.inf, np.float64)
        self._ahead = np.full(nodes.shape, np.nan, np.float32)
        middle = self._corner + cell * np.stack(np.meshgrid(*(np.arange(k) for k in shape), indexing="ij"), axis=-1)
        inside = np.hypot(*(middle - goal.position[:2]).transpose(2, 0, 1)) <= max(goal.radius, 0.75 * cell)
        inside = inside[..., None] & goal.on_floor(levels)
        targets = nodes[inside]
        targets = targets[targets >= 0]
        self.supported = bool((levels[inside] > -np.inf).any())
        if len(targets):
            start, none = np.zeros(count + 1, np.int32), np.zeros(0)
            grid = (nodes, low, levels, cell, climb, body, start)
            edges = link_nodes(*grid, none.astype(np.int32), none)
            end, weight = np.empty(edges, np.int32), np.empty(edges)
            link_nodes(*grid, end, weight)
            from scipy.sparse import csr_matrix  # here, since they take long to import
            from scipy.sparse.csgraph import dijkstra

            graph = csr_matrix((weight, end, start), shape=(count, count))
            distance, before, _ = dijkstra(
                graph, directed=True, indices=targets, min_only=True, return_predecessors=True
            )
            used = nodes >= 0  # in the order of their numbers
            self._distance[used] = distance
            self._ahead[used] = _directions(before, np.argwhere(used)[:, :2])

    def _grounds(self, projector: Projector, footholds: Footholds, shape: np.ndarray) -> np.ndarray:
        """(nx, ny, 4) float heights of ground in each cell, -inf where there is none."""
        low = np.full((*shape, LEVELS), -np.inf)
        sole_levels(
            self._corner,
            self._cell,
            projector.half_sizes[Limb.LEFT_FOOT],
            np.ascontiguousarray(projector.offsets),
            self._merge,
            projector.table,
            low,
        )
        self._add_footholds(projector.table, footholds, low)
        return low

    def sound(self, place: np.ndarray) -> bool:
        """Whether a way leads to the goal from a place (3,) m with the body always between the feet.

        The grid itself only knows that there is ground near the body, such as beside the end of a wall.
        """
        ground, none = self._soles.max(2) > -np.inf, np.zeros(4, np.bool_)
        reach = self._stride / self._cell
        between = mark_between(ground, reach + 1.0, none)
        free = np.isfinite(self._distance).any(3) & between[..., None]
        reached = self._at_goal() & free
        mark_stances(
            self._height, self._soles, np.insert(disc(reach / 2), 0, 0, axis=0), self._climb, self._merge, reached
        )
        flood(self._height, free, self._climb, none, reached)
        return self._near_one(place, reached)

    def forward(self, place: np.ndarray) -> bool:
        """Whether a way leads to the goal from a place (3,) m on which the body faces where it goes."""
        reached = self._at_goal()
        spread_forward(self._height, np.isfinite(self._distance), self._climb, reached)
        return self._near_one(place, reached)

    def _at_goal(self) -> np.ndarray:
        """(nx, ny, 4) bool; the cells in the goal region in which the body fits."""
        return self._distance.min(3) == 0.0

    def _near_one(self, place: np.ndarray, cells: np.ndarray) -> bool:
        """Whether a place (3,) m is near one of the cells (nx, ny, 4) bool."""
        most = np.array(cells.shape[:2]) - 2
        i, j = np.clip(np.round((place[:2] - self._corner) / self._cell).astype(int), 1, most)
        return bool(cells[i - 1 : i + 2, j - 1 : j + 2].any())

    def _add_footholds(self, table: SurfaceTable, footholds: Footholds, levels: np.ndarray) -> None:
        """Add the heights of surfaces that no sole of the grid met, but others fit on: stones, beams."""
        shape = np.array(levels.shape[:2])
        upright = np.clip(table.rotation[:, 2, 2], 0.0, 1.0)
        half = table.radius[:, None] * np.column_stack([np.ones((len(upright), 2)), np.sqrt(1.0 - upright**2)])
        lower, upper = table.centre - half, table.centre + half
        first = np.clip(np.floor((lower[:, :2] - self._corner) / self._cell).astype(int), 0, shape)
        last = np.clip(np.ceil((upper[:, :2] - self._corner) / self._cell).astype(int) + 1, 0, shape)
        for index in np.flatnonzero(table.foot & (first < last).all(1)).tolist():
            near = levels[first[index, 0] : last[index, 0], first[index, 1] : last[index, 1]]
            if ((near > lower[index, 2] - self._merge) & (near < upper[index, 2] + self._merge)).any():
                continue
            for point in footholds.samples(index, self._cell):
                i, j = np.floor((point[:2] - self._corner) / self._cell + 0.5).astype(int)
                if 0 <= i < shape[0] and 0 <= j < shape[1]:
                    add_level(levels[i, j], point[2], self._merge)

    def __call__(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """See `Distance`; at least the straight line."""
        position, yaw = np.ascontiguousarray(position, dtype=float), np.ascontiguousarray(yaw, dtype=float)
        grid = np.empty(len(position))
        query(position, yaw, self._corner, self._cell, self._height, self._distance, self._near, grid)
        straight = np.hypot(*(position[:, :2] - self._goal.position[:2]).T) - self._goal.radius
        return np.maximum(np.maximum(grid * _OCTILE - 0.5 * self._cell, straight), 0.0)

    def ahead(self, position: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """See `Distance`; the mean over the next half metre or so of a body of the usual size."""
        cells, yaws = np.array(self._height.shape[:2]), self._ahead.shape[-1]
        i, j = np.clip(np.rint((position[:, :2] - self._corner) / self._cell).astype(int), 0, cells - 1).T
        level = np.abs(self._height[i, j] - position[:, 2:]).argmin(1)
        layer = np.rint(yaw / np.pi * yaws).astype(int) % yaws
        return self._ahead[i, j, level, layer].astype(float)


def _directions(before: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(n,) rad; headings of the ways from nodes of a grid to the goal over the next few edges, NaN at their ends.

    The next node on the way from each one is given by (n,), negative at the goal, and the cells by (n, 2).
    """
    later = np.where(before < 0, np.arange(len(before)), before)
    for _ in range(_FORESEEN):
        later = later[later]
    x, y = (cells[later] - cells).T
    return np.where((x == 0) & (y == 0), np.nan, np.arctan2(y, x))
