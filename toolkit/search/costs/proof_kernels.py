"""Compiled parts of the proof that nothing leads to the goal: where the ground is in reach, where the body may be."""

from __future__ import annotations

import numpy as np
import shapely

from toolkit.compiled import compiled
from toolkit.search.costs.grid_kernels import add_level, stack_of

_SECTORS = 96  # directions that are told apart


def disc(radius: float) -> np.ndarray:
    """(k, 2) int; cells within so many cells of one, without it, the nearest first."""
    count = int(radius)
    cells = np.mgrid[-count : count + 1, -count : count + 1].reshape(2, -1).T
    away = (cells**2).sum(1)
    order = np.lexsort((*cells.T[::-1], away))
    return np.ascontiguousarray(cells[order][(away[order] > 0) & (away[order] <= radius * radius)])


@compiled(kept=True)
def enter_heights(levels, i, j, z, merge):
    """Enter heights z (n,) m in cells (i, j) of levels (nx, ny, L), but none that is within `merge` of another one."""
    for k in range(len(z)):
        known = False
        for m in range(levels.shape[2]):
            known |= abs(levels[i[k], j[k], m] - z[k]) < merge
        if not known:
            add_level(levels[i[k], j[k]], z[k], merge)


@compiled(kept=True)
def collect_heights(ground, cells, offsets, merge, levels):
    """Enter in levels (nx, ny, L) of some cells (nx, ny) the heights of the ground (nx, ny, L) at offsets (k, 2)."""
    nx, ny, depth = ground.shape
    for a in range(nx):
        for b in range(ny):
            if not cells[a, b]:
                continue
            for k in range(len(offsets)):
                i, j = a + offsets[k, 0], b + offsets[k, 1]
                if i < 0 or j < 0 or i >= nx or j >= ny:
                    continue
                for m in range(depth):
                    z = ground[i, j, m]
                    if z == -np.inf:
                        break
                    known = False
                    for n in range(depth):
                        if known or levels[a, b, n] == -np.inf:
                            break
                        known = abs(levels[a, b, n] - z) < merge
                    if not known:
                        add_level(levels[a, b], z, merge)


def mark_between(ground: np.ndarray, stride: float, border: np.ndarray) -> np.ndarray:
    """(nx, ny) bool; cells on the way from one foot to the other, both of them on ground (nx, ny).

    The feet are at most `stride` cells apart, and lie in opposite directions, to 7.5 degrees. Beyond the sides that
    `border` (4,) names there is ground everywhere; see `flood`.
    """
    cells = disc(stride)
    sector = np.floor((np.arctan2(cells[:, 1], cells[:, 0]) / np.pi + 1.0) * (_SECTORS / 2)).astype(np.int64) % _SECTORS
    between, asked = ground.copy(), np.ones(ground.shape, np.bool_)
    if ground.any() and not border.any():  # feet stand around the cells between them, and one of them near by
        from scipy.ndimage import distance_transform_edt  # here, since it takes long to import

        hull = shapely.buffer(
            shapely.convex_hull(shapely.multipoints(np.argwhere(ground).astype(float))), 2.0, quad_segs=16
        )
        shapely.prepare(hull)
        asked = shapely.contains_xy(hull, *np.indices(ground.shape))
        asked &= np.asarray(distance_transform_edt(np.logical_not(ground))) <= stride / 2 + 1.0
    _mark_between(ground, asked, cells, sector, np.hypot(*cells.T), stride, border, between)
    return between


@compiled(kept=True, allocates=True)
def _mark_between(ground, asked, offsets, sectors, lengths, stride, border, between):
    """Fill between (nx, ny) where it is asked for, looking at offsets (k, 2) with their sectors and lengths (k,).

    See `mark_between`.
    """
    nx, ny = ground.shape
    nearest = np.empty(_SECTORS)
    for a in range(nx):
        for b in range(ny):
            between[a, b] = ground[a, b] or _leaves(a, b, nx, ny, border)
            if not asked[a, b]:
                continue
            nearest[:] = np.inf
            for k in range(len(offsets)):
                if between[a, b]:
                    break
                i, j = a + offsets[k, 0], b + offsets[k, 1]
                if 0 <= i < nx and 0 <= j < ny:
                    here = ground[i, j]
                else:
                    here = _leaves(min(max(i, 0), nx - 1), min(max(j, 0), ny - 1), nx, ny, border)
                if here:
                    sector, length = sectors[k], lengths[k]
                    nearest[sector] = min(nearest[sector], length)
                    for turn in range(_SECTORS // 2 - 1, _SECTORS // 2 + 2):
                        between[a, b] |= nearest[(sector + turn) % _SECTORS] + length <= stride


@compiled(kept=True)
def mark_stances(levels, ground, offsets, climb, merge, stands):
    """Unmark, in stands (nx, ny, L), the levels of cells that are no height of two feet around the cell's centre.

    Both stand on ground (nx, ny, L) m at opposite offsets (k, 2), to a cell, one of them at the level to `merge` m, and
    their heights differ by `climb` m at most.
    """
    nx, ny, depth = levels.shape
    for a in range(nx):
        for b in range(ny):
            for m in range(depth):
                if not stands[a, b, m]:
                    continue
                stands[a, b, m] = False
                for k in range(len(offsets)):
                    i, j = a + offsets[k, 0], b + offsets[k, 1]
                    if i < 0 or j < 0 or i >= nx or j >= ny:
                        continue
                    for n in range(depth):
                        if abs(ground[i, j, n] - levels[a, b, m]) <= merge:
                            stands[a, b, m] |= _other_foot(ground, 2 * a - i, 2 * b - j, levels[a, b, m], climb)
                    if stands[a, b, m]:
                        break


@compiled
def _other_foot(ground, i, j, z, climb):
    """Whether a foot may stand in a cell or beside it at a height that differs by `climb` at most."""
    for di in range(-1, 2):
        for dj in range(-1, 2):
            if 0 <= i + di < ground.shape[0] and 0 <= j + dj < ground.shape[1]:
                for n in range(ground.shape[2]):
                    if abs(ground[i + di, j + dj, n] - z) <= climb:
                        return True
    return False


@compiled
def _column_free(occupancy, x, y, radius, bottom, top):
    """Whether no cell, of those wholly between two heights, whose centre is within a radius of a place is occupied."""
    corner, cell, below = occupancy.corner, occupancy.cell, occupancy.below
    first = max(int(np.ceil((bottom - corner[2]) / cell)), 0)
    last = min(int(np.floor((top - corner[2]) / cell)), below.shape[2] - 1)
    if last <= first:
        return True
    i0, i1 = int(np.floor((x - radius - corner[0]) / cell)), int(np.floor((x + radius - corner[0]) / cell))
    j0, j1 = int(np.floor((y - radius - corner[1]) / cell)), int(np.floor((y + radius - corner[1]) / cell))
    for i in range(max(i0, 0), min(i1, below.shape[0] - 1) + 1):
        for j in range(max(j0, 0), min(j1, below.shape[1] - 1) + 1):
            if below[i, j, last] > below[i, j, first]:
                dx, dy = corner[0] + (i + 0.5) * cell - x, corner[1] + (j + 0.5) * cell - y
                if dx * dx + dy * dy <= radius * radius:
                    return False
    return True


@compiled(kept=True)
def mark_free(levels, corner, cell, occupancy, trunk, climb, merge, free):
    """Mark, in free (nx, ny, L), the ground at heights levels (nx, ny, L) over which the trunk has room.

    One foot stands at a level; the other may stand at any other level of the cell that is no farther than `climb`.
    `merge` is the difference between levels that are not told apart. See `Trunk`.
    """
    step = 2.0 * trunk.slack
    for a in range(levels.shape[0]):
        for b in range(levels.shape[1]):
            x, y = corner[0] + a * cell, corner[1] + b * cell
            for m in range(levels.shape[2]):
                z = levels[a, b, m]
                if z == -np.inf:
                    break
                low, high = z, z
                for n in range(levels.shape[2]):
                    other = levels[a, b, n]
                    if abs(other - z) <= climb:
                        low, high = min(low, (z + other) / 2), max(high, (z + other) / 2)
                ground = high + merge + trunk.rise
                while ground >= low - merge - trunk.sink - trunk.slack and not free[a, b, m]:
                    bottom, top = ground + trunk.bottom + trunk.slack, ground + trunk.top - trunk.slack
                    free[a, b, m] = _column_free(occupancy, x, y, trunk.radius, bottom, top)
                    ground -= step


@compiled(kept=True, allocates=True)
def flood(levels, free, climb, border, reached):
    """Spread reached (nx, ny, L) over the free ground whose heights differ by `climb` or less from cell to cell.

    Ground goes on beyond the grid at the sides that `border` (4,) names: low x, high x, low y, high y. What reaches one
    of these reaches all of them.
    """
    nx, ny, depth = levels.shape
    stack, count = stack_of(reached)
    outside = False
    while count > 0:
        count -= 1
        a, b, m = stack[count, 0], stack[count, 1], stack[count, 2]
        for i in range(max(a - 1, 0), min(a + 2, nx)):
            for j in range(max(b - 1, 0), min(b + 2, ny)):
                for n in range(depth):
                    if free[i, j, n] and not reached[i, j, n] and abs(levels[i, j, n] - levels[a, b, m]) <= climb:
                        reached[i, j, n] = True
                        stack[count, 0], stack[count, 1], stack[count, 2] = i, j, n
                        count += 1
        if not outside and _leaves(a, b, nx, ny, border):
            outside = True
            for i in range(nx):
                for j in range(ny):
                    if _leaves(i, j, nx, ny, border):
                        for n in range(depth):
                            if free[i, j, n] and not reached[i, j, n]:
                                reached[i, j, n] = True
                                stack[count, 0], stack[count, 1], stack[count, 2] = i, j, n
                                count += 1


@compiled
def _leaves(a, b, nx, ny, border):
    """Whether a cell is at a side of the grid beyond which ground goes on."""
    return (
        (a == 0 and border[0]) or (a == nx - 1 and border[1]) or (b == 0 and border[2]) or (b == ny - 1 and border[3])
    )
