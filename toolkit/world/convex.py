"""Convex polygons out of a planar region: a partition, and a cover whose pieces are as large as they can be."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

_FLAT = 1e-9  # cross products below this count as straight


def ring_points(polygon: Polygon) -> np.ndarray:
    """(k, 2) float outer ring of a polygon, counterclockwise, the closing point left out."""
    return np.asarray(orient(polygon).exterior.coords)[:-1, :2]


def is_convex(points: np.ndarray, tolerance: float = _FLAT) -> bool:
    """Whether a counterclockwise ring (k, 2) turns left or goes straight everywhere."""
    edges = np.roll(points, -1, axis=0) - points
    following = np.roll(edges, -1, axis=0)
    return bool((edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > -tolerance).all())


def convex_partition(region: Polygon) -> list[np.ndarray]:
    """Disjoint convex polygons whose union is the region.

    A constrained Delaunay triangulation whose inner edges are removed, longest first, while both sides stay convex
    (Hertel and Mehlhorn 1983): at most four times the least number of pieces.

    Args:
        region: polygon, holes allowed.

    Returns:
        (k, 2) float rings, counterclockwise.
    """
    if not region.interiors and is_convex(ring_points(region)):
        return [ring_points(region)]
    triangles = [
        ring_points(part)
        for part in shapely.get_parts(shapely.constrained_delaunay_triangles(region))
        if part.area > 1e-12
    ]
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


def convex_cover(region: Polygon, *, limit: int = 64) -> list[np.ndarray]:
    """Convex polygons inside the region that cover it; they overlap where that makes them larger.

    Each piece of the partition pushes its inner edges outwards, one after the other, as far as it stays in the region.

    Args:
        region: polygon, holes allowed.
        limit: with more pieces than this the partition is returned as it is.

    Returns:
        (k, 2) float rings, counterclockwise; none inside another.
    """
    partition = convex_partition(region)
    if len(partition) == 1 or len(partition) > limit:
        return partition
    shell = region.buffer(1e-7)  # a piece that touches the outline must count as inside
    shapely.prepare(shell)
    grown = [_grown(Polygon(piece), shell) for piece in partition]
    grown.sort(key=lambda piece: -piece.area)
    kept: list[Polygon] = []
    for piece in grown:
        if not any(other.buffer(1e-6).covers(piece) for other in kept):
            kept.append(piece)
    return [ring_points(piece) for piece in kept]


def _joined(first: list[int], second: list[int], a: int, b: int) -> list[int] | None:
    """The ring of two rings without their common edge a-b; None if they share more than that edge."""
    i, j = first.index(b), second.index(a)
    left = first[i:] + first[:i]  # b ... a
    right = second[j:] + second[:j]  # a ... b
    ring = left + right[1:-1]
    return ring if len(set(ring)) == len(ring) else None


def _without_straight_corners(points: np.ndarray) -> np.ndarray:
    """The ring (k, 2) without the corners that do not turn."""
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turns = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) > _FLAT
    return points[turns] if turns.sum() >= 3 else points


def _grown(piece: Polygon, shell: Polygon) -> Polygon:
    """A convex piece with its inner edges, longest first, pushed outwards as far as it stays inside `shell`."""
    for _ in range(2 * len(piece.exterior.coords)):
        ring = ring_points(piece)
        length = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
        for index in sorted(_inner_edges(ring, shell), key=lambda edge, by=length: -by[edge]):
            larger = _pushed(ring, index, shell)
            if larger.area > piece.area + 1e-6:
                piece = larger
                break
        else:
            return piece
    return piece


def _inner_edges(ring: np.ndarray, shell: Polygon) -> list[int]:
    """Edges (index of their first corner) with room beyond them at both ends and in the middle."""
    along = np.roll(ring, -1, axis=0) - ring
    length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-12)
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    room = np.ones(len(ring), bool)
    for share in (0.05, 0.5, 0.95):
        probe = ring + share * along + 1e-5 * outward
        room &= shapely.contains_xy(shell, probe[:, 0], probe[:, 1])
    return np.flatnonzero(room).tolist()


def _pushed(ring: np.ndarray, index: int, shell: Polygon) -> Polygon:
    """A convex ring with edge `index` moved outwards, parallel to itself, as far as the ring stays inside `shell`."""
    start, end = ring[index], ring[(index + 1) % len(ring)]
    along = (end - start) / np.linalg.norm(end - start)
    outward = np.array([along[1], -along[0]])
    low, high = np.array(shell.bounds[:2]), np.array(shell.bounds[2:])
    reach = float(np.hypot(*(high - low)))
    band = np.concatenate([[start - reach * along, start + reach * along]] * 2)
    band[2:] = band[3:1:-1] + reach * outward  # what lies beyond the edge
    for other in range(len(ring)):
        if other != index:
            band = _left_of(band, ring[other], ring[(other + 1) % len(ring)])
    if len(band) < 3:
        return Polygon(ring)
    outside = shapely.get_coordinates(shapely.difference(Polygon(band), shell))
    if len(outside):
        limit = start + float(((outside - start) @ outward).min()) * outward
        band = _left_of(band, limit, limit + along)
    return _hull(ring, band)


def _hull(first: np.ndarray, second: np.ndarray) -> Polygon:
    """Convex hull of two point sets."""
    hull = shapely.MultiPoint(np.concatenate([first, second])).convex_hull
    return hull if isinstance(hull, Polygon) else Polygon(first)


def _left_of(ring: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The part of a convex ring (k, 2) on the left of the line from `start` to `end` (Sutherland and Hodgman)."""
    if len(ring) == 0:
        return ring
    along = end - start
    side = along[0] * (ring[:, 1] - start[1]) - along[1] * (ring[:, 0] - start[0])
    kept = []
    for i in range(len(ring)):
        j = (i + 1) % len(ring)
        if side[i] >= 0:
            kept.append(ring[i])
        if (side[i] > 0 > side[j]) or (side[i] < 0 < side[j]):
            kept.append(ring[i] + (ring[j] - ring[i]) * (side[i] / (side[i] - side[j])))
    return np.array(kept).reshape(-1, 2)
