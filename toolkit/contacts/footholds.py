"""Footholds: the places on a surface at which a whole sole has room, found from the surface itself.

A table of steps meets a small stone, a narrow beam or the far edge of a gap by chance. Here the region in which the
centre of a sole may lie is computed exactly, for regions that are not convex or have holes too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from toolkit.contacts.projected import Projected
from toolkit.contacts.seats import Seats
from toolkit.geometry.heading import wrapped
from toolkit.geometry.plane import along_plane, plane_height
from toolkit.world.convex import is_convex
from toolkit.world.surface import Surface

_SHARES = (1.0, 0.5, 0.05)  # of the margin around a sole, tried in turn: a stone may be hardly larger than a sole
_NEAR = 3.0  # margins from a place within which another with less margin is of no use
_MANY = 12  # sides from which on a convex surface is shrunk by its moved copies, and not side by side
_KEPT = 20_000  # regions that are remembered
_TURN = np.radians(50.0)  # largest angle between a heading along a surface's edges and the wanted one
_SAME = np.radians(3.0)  # headings that differ by less are one


class Footholds:
    """Footholds on the surfaces of a world.

    Args:
        surfaces: The surfaces.
        half_size: (2,) m; half extents of the sole.
        margin: Margin around it, or (2,) margins along and across, that should also lie in the surface, in m; less
            where there is no room for it: on a narrow surface, and on the narrow parts of one that is not convex.
    """

    def __init__(self, surfaces: Sequence[Surface], half_size: np.ndarray, margin: float | np.ndarray):
        self._surfaces, self._half, self._margin = surfaces, half_size, margin
        self._turns = np.array([surface.pose.rotation for surface in surfaces]).reshape(-1, 3, 3)
        self._origins = np.array([surface.pose.position for surface in surfaces]).reshape(-1, 3)
        self._regions: dict[tuple[int, int], BaseGeometry] = {}
        self._edges: dict[int, float] = {}
        self._seats = Seats(surfaces)

    def headings(self, index: int, yaw: float) -> list[float]:
        """Headings in rad to try on a surface: the wanted one, and those along and across its longest edge."""
        turns = wrapped(self._longest_edge(index) - yaw + np.pi / 2 * np.arange(4))
        return [yaw, *(yaw + float(turn) for turn in turns if _SAME < abs(turn) < _TURN)]

    def samples(self, index: int, spacing: float) -> np.ndarray:
        """(n, 3) m; footholds along the longest edge of a surface and across, no farther apart than `spacing` m."""
        surface, found = self._surfaces[index], []
        for heading in self._longest_edge(index) + np.array([0.0, np.pi / 2]):
            region = self._region(index, _sole_axis(surface.normal, heading))
            if not region.is_empty:
                low_u, low_v, high_u, high_v = region.bounds
                across = np.linspace(low_u, high_u, 2 + int((high_u - low_u) / spacing))
                upwards = np.linspace(low_v, high_v, 2 + int((high_v - low_v) / spacing))
                found.append(_nearest(region, np.array([(u, v) for u in across for v in upwards])))
        flat = np.concatenate(found) if found else np.zeros((0, 2))
        return surface.pose @ np.column_stack([flat, np.zeros(len(flat))])

    def nearest(self, places: Sequence[tuple[int, float]], wishes: np.ndarray) -> Projected:
        """The footholds nearest to wanted places, each on several surfaces.

        Args:
            places: k surfaces, each with the heading of the sole in rad.
            wishes: (n, 2) m; places in the world's XY.

        Returns:
            k n contacts, those of a surface together; surface -1 where it has no room for the sole in its heading.
        """
        count, found = len(wishes), Projected.none(len(places) * len(wishes))
        axes = [_sole_axis(self._surfaces[index].normal, yaw) for index, yaw in places]
        regions = [self._region(index, axis) for (index, _), axis in zip(places, axes, strict=True)]
        roomy = [row for row, region in enumerate(regions) if not region.is_empty]
        if not roomy:
            return found
        chosen = np.array([places[row][0] for row in roomy])
        turn, origin, axis = self._turns[chosen], self._origins[chosen], np.array(axes)[roomy]
        x, y = np.broadcast_to(wishes.T[:, None], (2, len(roomy), count))
        height = plane_height(origin.T[:, :, None], turn[:, :, 2].T[:, :, None], x, y)
        local = (np.stack([x, y, height], axis=-1) - origin[:, None]) @ turn
        within = np.repeat(np.array([regions[row] for row in roomy], object), count)
        flat = _nearest(within, local[..., :2].reshape(-1, 2)).reshape(len(roomy), count, 2)
        rows = (np.array(roomy)[:, None] * count + np.arange(count)).ravel()
        frame = np.stack([axis, np.cross(turn[:, :, 2], axis), turn[:, :, 2]], axis=-1)
        found.surface[rows] = np.repeat(chosen, count)
        found.position[rows] = (origin[:, None] + flat @ turn[:, :, :2].transpose(0, 2, 1)).reshape(-1, 3)
        found.rotation[rows] = np.repeat(frame, count, axis=0)
        return self._seats.lay(found, self._half)

    def _longest_edge(self, index: int) -> float:
        """Heading in rad of the longest edge of a surface."""
        if index not in self._edges:
            surface = self._surfaces[index]
            ring = surface.boundary[0]
            sides = np.roll(ring, -1, axis=0) - ring
            side = surface.pose.rotation[:, :2] @ sides[np.argmax(np.hypot(*sides.T))]
            self._edges[index] = float(np.arctan2(side[1], side[0]))
        return self._edges[index]

    def _region(self, index: int, axis: np.ndarray) -> BaseGeometry:
        """Where, in the frame of a surface, the centre of a sole with this x axis may be; prepared for queries."""
        surface = self._surfaces[index]
        along = axis @ surface.pose.rotation[:, :2]
        key = index, round(float(np.arctan2(along[1], along[0])) * 1e4)
        if key not in self._regions:
            if len(self._regions) >= _KEPT:
                self._regions.clear()
            region = self._room(surface, along)
            shapely.prepare(region)
            self._regions[key] = region
        return self._regions[key]

    def _room(self, surface: Surface, along: np.ndarray) -> BaseGeometry:
        """Where the centre of a sole with this x axis (2,) may be: with less margin where none with more is near."""

        def room(share: float) -> BaseGeometry:
            return eroded(surface, along, self._half + share * self._margin)

        found, near = shapely.Polygon(), _NEAR * float(np.max(self._margin))
        convex = len(surface.pieces) == 1  # narrow everywhere or nowhere
        least = shapely.Polygon() if convex else room(_SHARES[-1])
        for share in _SHARES:
            if found.is_empty:
                found = room(share)
                continue
            beside = shapely.buffer(found, near, join_style="mitre")
            if shapely.difference(least, beside).is_empty:
                break
            found = shapely.union(found, shapely.difference(room(share), beside))
        return found


def _sole_axis(normal: np.ndarray, yaw: float) -> np.ndarray:
    """(3,) x axis of a sole on a plane with this normal."""
    return np.array(along_plane(normal, np.cos(yaw), np.sin(yaw)))


def _nearest(region: BaseGeometry | np.ndarray, points: np.ndarray) -> np.ndarray:
    """The points (n, 2) of a region, or of n regions, nearest to points (n, 2)."""
    lines = shapely.shortest_line(shapely.points(points), region)
    return shapely.get_coordinates(lines).reshape(-1, 2, 2)[:, 1]


def eroded(surface: Surface, along: np.ndarray, half: np.ndarray) -> BaseGeometry:
    """The part of a surface in which a rectangle with this x axis (2,) and half extents (2,) m may be centred."""
    across = np.array([-along[1], along[0]])
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half @ np.stack([along, across])
    outer, *holes = surface.boundary
    if not holes and len(outer) > _MANY and is_convex(outer):
        moved = np.asarray(shapely.polygons(outer + corners[:, None]))
        return shapely.intersection(shapely.intersection(*moved[:2]), shapely.intersection(*moved[2:]))
    swept = []
    for ring in surface.boundary:
        ends = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)  # (edges, 2, 2)
        swept.append((ends[:, :, None] + corners).reshape(len(ring), -1, 2))
    points = np.concatenate(swept)
    hulls = shapely.convex_hull(shapely.multipoints(points))
    return shapely.difference(surface.region, shapely.union_all(hulls))
