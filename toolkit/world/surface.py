"""A planar surface that can be touched."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.ops import nearest_points

from toolkit.geometry.plane import plane_height
from toolkit.geometry.pose import Pose
from toolkit.world.relief import FLAT, height_and_slopes


@dataclass(frozen=True)
class Surface:
    """A connected planar region of the world's geometry, free of covered and buried parts.

    Attributes:
        index: Position in `World.surfaces`.
        geom: Name (or `type#id`) of the geom that it comes from.
        pose: World_from_surface pose with its origin on the plane; z is the outward normal.
        boundary: Rings of points (k, 2) float in the surface frame, m. The first is the outer ring, counterclockwise;
            the others are holes, clockwise. The first point of a ring is not repeated at its end.
        pieces: Convex polygons (k, 2), counterclockwise, m, that cover the region; they may overlap.
        friction: Sliding coefficient.
        serves_foot, serves_palm: Whether the angle of the normal allows feet and palms.
        relief: (6,) How its ground curves about its plane; see `toolkit.world.relief`.
        bearing: m; how far from the middle of a patch the ground bears it, above 0; infinite but on crests.
    """

    index: int
    geom: str
    pose: Pose
    boundary: tuple[np.ndarray, ...]
    pieces: tuple[np.ndarray, ...]
    friction: float
    serves_foot: bool
    serves_palm: bool
    relief: np.ndarray = field(default_factory=lambda: FLAT)
    bearing: float = np.inf

    @property
    def normal(self) -> np.ndarray:
        """Outward normal (3,) float in the world."""
        return self.pose.rotation[:, 2]

    @property
    def region(self) -> Polygon:
        """The region, holes included, in the surface's frame."""
        return Polygon(self.boundary[0], self.boundary[1:])

    @property
    def rings(self) -> list[np.ndarray]:
        """Rings (k, 3) of the boundary in the world, m; see there."""
        return [self.pose @ np.column_stack([ring, np.zeros(len(ring))]) for ring in self.boundary]

    def height(self, points: np.ndarray) -> np.ndarray:
        """World z (n,) in m of a surface that is not vertical at points (n, 2) of the world's xy, NaN outside it."""
        normal, origin = self.normal, self.pose.position
        height = plane_height(origin, normal, *points.T)
        local = (self.pose.inverse() @ np.column_stack([points, height]))[:, :2]
        inside = shapely.intersects_xy(self.region, *local.T)
        above = height_and_slopes(self.relief, local)[0]
        return np.where(inside, height + above / normal[2], np.nan)

    def nearest_point(self, point: np.ndarray) -> np.ndarray:
        """The point (3,) of the surface nearest to a point (3,) of the world, m."""
        x, y, _ = self.pose.inverse() @ point
        nearest = nearest_points(self.region, Point(x, y))[0]
        return self.pose @ np.array([nearest.x, nearest.y, 0.0])
