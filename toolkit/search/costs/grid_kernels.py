"""Compiled parts of the grid heuristic: heights of the ground, nodes, edges, look-up."""

from __future__ import annotations

import numpy as np

from toolkit.compiled import compiled
from toolkit.contacts.projection_kernels import cell_of, sole_fits
from toolkit.geometry.plane import plane_height
from toolkit.search.moves.occupancy import lowest_drop

LEVELS = 4  # heights kept per cell


@compiled(kept=True)
def add_level(levels, z, merge):
    """Enter a height in a falling list whose free places are -inf; of heights closer than `merge` the highest stays."""
    for k in range(len(levels)):
        if abs(levels[k] - z) < merge:
            levels[k] = max(levels[k], z)
            return
        if levels[k] < z:
            for m in range(len(levels) - 1, k, -1):
                levels[m] = levels[m - 1]
            levels[k] = z
            return


@compiled(kept=True)
def sole_levels(corner, cell, half, offsets, merge, table, result):
    """Fill heights (nx, ny, 4) in m at which a slightly shifted sole has room in each cell, in any of four headings."""
    for a in range(result.shape[0]):
        for b in range(result.shape[1]):
            for k in range(len(offsets)):
                x, y = corner[0] + a * cell + offsets[k, 0], corner[1] + b * cell + offsets[k, 1]
                place = cell_of(table, x, y)
                if place < 0:
                    continue
                for entry in range(table.entry_start[place], table.entry_start[place + 1]):
                    q = table.entry_surface[entry]
                    z = plane_height(table.origin[q], table.rotation[q, :, 2], x, y)
                    known = False
                    for m in range(LEVELS):
                        known |= abs(result[a, b, m] - z) < 0.5 * merge
                    if known:
                        continue
                    for turn in range(4):
                        angle = turn * np.pi / 4
                        if sole_fits(table, place, entry, x, y, np.cos(angle), np.sin(angle), half):
                            add_level(result[a, b], z, merge)
                            break


@compiled(kept=True)
def spread(levels, disc, merge, result):
    """Add to `result`, a copy of the heights (nx, ny, L) of each cell, those of the cells around, the nearest first."""
    for a in range(levels.shape[0]):
        for b in range(levels.shape[1]):
            for k in range(len(disc)):
                i, j = a + disc[k, 0], b + disc[k, 1]
                if i < 0 or j < 0 or i >= levels.shape[0] or j >= levels.shape[1]:
                    continue
                for m in range(levels.shape[2]):
                    z = levels[i, j, m]
                    if z == -np.inf:
                        break
                    new = True
                    for n in range(levels.shape[2]):
                        new &= not abs(result[a, b, n] - z) < merge
                    if new:
                        add_level(result[a, b], z, merge)


@compiled
def _least_drop_near(occupancy, body, x, y, z, yaw):
    """Number of the least of the drops with which the body fits at a node or at one of the places around; -1: none."""
    least = lowest_drop(occupancy, body.box, body.drops, x, y, z, yaw)
    if least == 0 or not len(body.places) or lowest_drop(occupancy, body.core, body.drops, x, y, z, yaw) < 0:
        return least
    for k in range(len(body.places)):
        dx, dy, turn = body.places[k]
        drop = lowest_drop(occupancy, body.box, body.drops, x + dx, y + dy, z, yaw + turn)
        if drop == 0:
            return 0
        if drop > 0 and (least < 0 or drop < least):
            least = drop
    return least


@compiled(kept=True)
def number_nodes(levels, corner, cell, occupancy, body, nodes, low):
    """Number the cells in which the body fits, in nodes (nx, ny, 4, yaws), and return their number.

    Fills low, of the same shape: whether the body fits there only with a lowered CoM. See `GridBody`.
    """
    count = 0
    yaws = nodes.shape[3]
    for a in range(levels.shape[0]):
        for b in range(levels.shape[1]):
            for m in range(LEVELS):
                z = levels[a, b, m]
                if z == -np.inf:
                    break
                x, y = corner[0] + a * cell, corner[1] + b * cell
                for k in range(yaws):
                    drop = _least_drop_near(occupancy, body, x, y, z, k * np.pi / yaws)
                    if drop >= 0:
                        nodes[a, b, m, k] = count
                        low[a, b, m, k] = drop > 0
                        count += 1
    return count


@compiled(allocates=True)
def stack_of(reached):
    """A stack for all cells of reached (nx, ny, L) bool, with those that are on it, and their number."""
    nx, ny, depth = reached.shape
    stack, count = np.empty((nx * ny * depth, 3), np.int32), 0
    for a in range(nx):
        for b in range(ny):
            for m in range(depth):
                if reached[a, b, m]:
                    stack[count, 0], stack[count, 1], stack[count, 2] = a, b, m
                    count += 1
    return stack, count


@compiled(kept=True, allocates=True)
def spread_forward(levels, free, climb, reached):
    """Spread reached (nx, ny, 4) to cells from which a body gets there that always faces the way it goes, or backwards.

    free (nx, ny, 4, yaws) says where it fits with which layer of yaw; heights of neighbours differ by `climb` at most.
    """
    nx, ny, yaws = free.shape[0], free.shape[1], free.shape[3]
    stack, count = stack_of(reached)
    while count > 0:
        count -= 1
        a, b, m = stack[count, 0], stack[count, 1], stack[count, 2]
        for i in range(max(a - 1, 0), min(a + 2, nx)):
            for j in range(max(b - 1, 0), min(b + 2, ny)):
                if i == a and j == b:
                    continue
                if i == a:
                    layer = yaws // 2
                else:
                    layer = ((i - a) * (j - b) * yaws // 4) % yaws
                if not free[a, b, m, layer]:
                    continue
                for n in range(LEVELS):
                    if not free[i, j, n, layer] or reached[i, j, n]:
                        continue
                    if abs(levels[i, j, n] - levels[a, b, m]) <= climb:
                        reached[i, j, n] = True
                        stack[count, 0], stack[count, 1], stack[count, 2] = i, j, n
                        count += 1


@compiled(kept=True)
def link_nodes(nodes, low, levels, cell, climb, body, start, end, weight):
    """Compressed rows of the grid graph, whose edges all go both ways.

    Fills start (count + 1,) and returns the number of edges; fills their ends and lengths where there is room for them.
    """
    used = 0
    yaws = nodes.shape[3]
    write = len(end) > 0
    for a in range(nodes.shape[0]):
        for b in range(nodes.shape[1]):
            for m in range(LEVELS):
                for k in range(yaws):
                    node = nodes[a, b, m, k]
                    if node < 0:
                        continue
                    for step in range(-1, 2, 2):
                        other = nodes[a, b, m, (k + step) % yaws]
                        if other >= 0 and other != node:
                            if write:
                                end[used], weight[used] = other, body.turn
                            used += 1
                    c, s = np.cos(k * np.pi / yaws), np.sin(k * np.pi / yaws)
                    for i in range(max(a - 1, 0), min(a + 2, nodes.shape[0])):
                        for j in range(max(b - 1, 0), min(b + 2, nodes.shape[1])):
                            if i == a and j == b:
                                continue
                            for n in range(LEVELS):
                                other = nodes[i, j, n, k]
                                if other >= 0 and abs(levels[i, j, n] - levels[a, b, m]) <= climb:
                                    if write:
                                        length = cell * np.sqrt(float((i - a) ** 2 + (j - b) ** 2))
                                        across = abs(c * (j - b) - s * (i - a)) * cell
                                        bent = low[a, b, m, k] or low[i, j, n, k]
                                        end[used] = other
                                        weight[used] = length + body.sideways * across + body.bent * length * bent
                                    used += 1
                    start[node + 1] = used
    return used


@compiled
def _cell_value(height, distance, i, j, z, layer, span, near):
    """Least distance of a cell over the `span` yaw layers on either side of one, at the level nearest to a height.

    The level is within `near` m of the height.
    """
    if i < 0 or j < 0 or i >= height.shape[0] or j >= height.shape[1]:
        return np.inf
    level = 0
    for m in range(1, height.shape[2]):
        if abs(height[i, j, m] - z) < abs(height[i, j, level] - z):
            level = m
    if not abs(height[i, j, level] - z) < near:
        return np.inf
    best = np.inf
    for k in range(-span, span + 1):
        best = min(best, distance[i, j, level, (layer + k) % distance.shape[3]])
    return best


@compiled(kept=True)
def query(position, yaw, corner, cell, height, distance, near, result):
    """Fill distances (n,) in m, interpolated between the four cells around; where these are blocked, others near by.

    Places are on levels within `near` m of their heights.
    """
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
                value = _cell_value(height, distance, i + di, j + dj, z, layer, 1, near)
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
                value = _cell_value(height, distance, i + di, j + dj, z, layer, 2, near)
                if value < np.inf:
                    away = cell * np.sqrt((di - fx) ** 2 + (dj - fy) ** 2)
                    result[row] = min(result[row], value + away)
