"""A planar region as convex polygons."""

from __future__ import annotations

from typing import Any

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
    triangles = _triangles(found)
    points, corner = np.unique(triangles.reshape(-1, 2), axis=0, return_inverse=True)
    places: list[list[float]] = points.tolist()
    rings: dict[int, list[int]] = dict(enumerate(corner.reshape(-1, 3).tolist()))
    owner = {(a, b): i for i, ring in rings.items() for a, b in zip(ring, ring[1:] + ring[:1], strict=True)}
    inner = [(a, b) for a, b in owner if a < b and (b, a) in owner]
    inner.sort(key=lambda edge: -_square_of(places[edge[0]], places[edge[1]]))
    for a, b in inner:
        first, second = owner[a, b], owner[b, a]
        merged = _joined(rings[first], rings[second], a, b)
        if merged is None or min(_turn_at(places, merged, index) for index in (0, len(rings[first]) - 1)) <= -_FLAT:
            continue  # the corners between those of the common edge turn as they did
        rings[first] = merged
        for edge in zip(rings[second], rings[second][1:] + rings[second][:1], strict=True):
            owner[edge] = first
        del rings[second], owner[a, b], owner[b, a]
    return [points[_without_straight_corners(places, ring)] for ring in rings.values()]


def simplified(ring: np.ndarray, tolerance: float = STRAIGHT) -> np.ndarray:
    """A convex ring (k, 2) without the corners that lie within a tolerance in m of the edges without them.

    Corners that hardly turn split the faces of a solid into slivers, in which collision detection finds too few points.
    """
    kept = np.asarray(shapely.simplify(Polygon(ring), tolerance).exterior.coords)[:-1, :2]
    # Its first corner was kept whatever it does.
    height = abs(_turns(kept)[0]) / np.hypot(*(kept[1] - kept[-1]))
    return kept[1:] if height <= tolerance and len(kept) > 3 else kept


def _triangles(found: shapely.Geometry) -> np.ndarray:
    """(n, 3, 2) corners of the triangles of a collection that have an area, counterclockwise."""
    parts = shapely.get_parts(found)
    corners = shapely.get_coordinates(parts[shapely.area(parts) > 1e-12]).reshape(-1, 4, 2)[:, :3]
    clockwise = _turn(*np.moveaxis(corners, 0, -1)) < 0.0
    corners[clockwise] = corners[clockwise][:, [0, 2, 1]]
    return corners


def _square_of(first: list[float], second: list[float]) -> float:
    """Squared distance of two points, m^2."""
    x, y = first[0] - second[0], first[1] - second[1]
    return x * x + y * y


def _turn(before: Any, here: Any, after: Any) -> Any:
    """m^2; cross product of the edges before and after a corner, positive to the left. Points (2,) or many (2, k)."""
    return (here[0] - before[0]) * (after[1] - here[1]) - (here[1] - before[1]) * (after[0] - here[0])


def _turn_at(points: list[list[float]], ring: list[int], index: int) -> float:
    """The turn of one corner of a ring."""
    return _turn(*(points[ring[place % len(ring)]] for place in (index - 1, index, index + 1)))


def _joined(first: list[int], second: list[int], a: int, b: int) -> list[int] | None:
    """The ring of two rings without their common edge a-b; None if they share more than that edge."""
    i, j = first.index(b), second.index(a)
    left = first[i:] + first[:i]  # b ... a
    ring = left + (second[j:] + second[:j])[1:-1]  # the second ring runs from a to b
    return ring if len(set(ring)) == len(ring) else None


def _without_straight_corners(points: list[list[float]], ring: list[int]) -> list[int]:
    """The ring without the corners that do not turn."""
    kept = [corner for index, corner in enumerate(ring) if abs(_turn_at(points, ring, index)) > _FLAT]
    return kept if len(kept) >= 3 else ring


def _turns(ring: np.ndarray) -> np.ndarray:
    """(k,) m^2; cross products of the edges before and after each corner of a ring (k, 2), positive to the left."""
    closed = np.concatenate([ring[-1:], ring, ring[:1]]).T
    return _turn(closed[:, :-2], closed[:, 1:-1], closed[:, 2:])
