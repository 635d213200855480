"""A planar region as convex polygons."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

_FLAT = 1e-9  # a corner with a smaller cross product is straight
STRAIGHT = 1e-4  # m; corners of solids that lie so near to the edges without them are left out


def ring_points(polygon: Polygon) -> np.ndarray:
    """(k, 2) float outer ring of a polygon, counterclockwise, the closing point left out."""
    return np.asarray(orient(polygon).exterior.coords)[:-1, :2]


def is_convex(points: np.ndarray, tolerance: float = _FLAT) -> bool:
    """Whether a counterclockwise ring (k, 2) turns left or goes straight everywhere."""
    return bool((_turns(points) > -tolerance).all())


def convex_partition(region: Polygon) -> list[np.ndarray]:
    """Disjoint convex polygons, as counterclockwise rings (k, 2) float, whose union is a region with or without holes.

    Inner edges of a constrained Delaunay triangulation are removed, longest first, as long as the merged piece is
    convex (Hertel and Mehlhorn 1983). This gives at most four times the least number of pieces.
    """
    if not region.interiors and is_convex(ring_points(region)):
        return [ring_points(region)]
    try:
        found = shapely.constrained_delaunay_triangles(region)
    except shapely.errors.GEOSException:  # the region has a spike thinner than rounding, which is cut off
        opened = region.buffer(-1e-7, join_style="mitre").buffer(1e-7, join_style="mitre")
        found = shapely.constrained_delaunay_triangles(opened)
    triangles = [ring_points(part) for part in shapely.get_parts(found) if part.area > 1e-12]
    points, corner = np.unique(np.concatenate(triangles), axis=0, return_inverse=True)
    rings: dict[int, list[int]] = {i: list(corner.reshape(-1)[3 * i : 3 * i + 3]) for i in range(len(triangles))}
    owner = {(a, b): i for i, ring in rings.items() for a, b in zip(ring, ring[1:] + ring[:1], strict=True)}
    inner = [(a, b) for a, b in owner if a < b and (b, a) in owner]
    inner.sort(key=lambda edge: -float(np.sum((points[edge[0]] - points[edge[1]]) ** 2)))
    for a, b in inner:
        first, second = owner[a, b], owner[b, a]
        merged = _joined(rings[first], rings[second], a, b)
        if merged is None or not is_convex(points[merged]):
            continue
        rings[first] = merged
        for edge in zip(rings[second], rings[second][1:] + rings[second][:1], strict=True):
            owner[edge] = first
        del rings[second], owner[a, b], owner[b, a]
    return [_without_straight_corners(points[ring]) for ring in rings.values()]


def simplified(ring: np.ndarray, tolerance: float = STRAIGHT) -> np.ndarray:
    """A convex ring (k, 2) without the corners that lie within a tolerance in m of the edges without them.

    Corners that hardly turn split the faces of a solid into slivers, in which collision detection finds too few points.
    """
    kept = np.asarray(shapely.simplify(Polygon(ring), tolerance).exterior.coords)[:-1, :2]
    # Its first corner was kept whatever it does.
    height = abs(_turns(kept)[0]) / np.hypot(*(kept[1] - kept[-1]))
    return kept[1:] if height <= tolerance and len(kept) > 3 else kept


def _joined(first: list[int], second: list[int], a: int, b: int) -> list[int] | None:
    """The ring of two rings without their common edge a-b; None if they share more than that edge."""
    i, j = first.index(b), second.index(a)
    left = first[i:] + first[:i]  # b ... a
    ring = left + (second[j:] + second[:j])[1:-1]  # the second ring runs from a to b
    return ring if len(set(ring)) == len(ring) else None


def _without_straight_corners(points: np.ndarray) -> np.ndarray:
    """The ring (k, 2) without the corners that do not turn."""
    turns = np.abs(_turns(points)) > _FLAT
    return points[turns] if turns.sum() >= 3 else points


def _turns(ring: np.ndarray) -> np.ndarray:
    """(k,) m^2; cross products of the edges before and after each corner of a ring (k, 2), positive to the left."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
