"""A planar surface that can be touched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.ops import nearest_points

from toolkit.geometry.pose import Pose


@dataclass(frozen=True)
class Surface:
    """A connected planar region of the world's geometry, free of covered and buried parts.

    Attributes:
        index: position in `World.surfaces`.
        geom: name (or `type#id`) of the geom it comes from.
        pose: world_from_surface; origin on the plane, z the outward normal.
        boundary: rings of (k, 2) float points in the surface frame; the first is the outer ring, counterclockwise, the
            others are holes, clockwise. Not closed (the last point is not the first one repeated).
        pieces: convex polygons (k, 2), counterclockwise, that cover the region; they may overlap.
        friction: sliding coefficient.
        serves_foot, serves_palm: by the angle of the normal.
    """

    index: int
    geom: str
    pose: Pose
    boundary: tuple[np.ndarray, ...]
    pieces: tuple[np.ndarray, ...]
    friction: float
    serves_foot: bool
    serves_palm: bool

    @property
    def normal(self) -> np.ndarray:
        """(3,) float outward normal in the world."""
        return self.pose.rotation[:, 2]

    @property
    def region(self) -> Polygon:
        """The region, holes included, in the surface's frame."""
        return Polygon(self.boundary[0], self.boundary[1:])

    def height(self, points: np.ndarray) -> np.ndarray:
        """Height over points of the ground plane, of a surface that is not vertical.

        Args:
            points: (n, 2) float, m; world xy.

        Returns:
            (n,) float, m; world z, NaN where the surface is not there.
        """
        normal, origin = self.normal, self.pose.position
        height = origin[2] - (points - origin[:2]) @ normal[:2] / normal[2]
        local = self.pose.inverse() @ np.column_stack([points, height])
        inside = shapely.intersects_xy(self.region, local[:, 0], local[:, 1])
        return np.where(inside, height, np.nan)

    def nearest_point(self, point: np.ndarray) -> np.ndarray:
        """(3,) m; the point of the surface nearest to a point (3,) m of the world."""
        x, y, _ = self.pose.inverse() @ point
        nearest = nearest_points(self.region, Point(x, y))[0]
        return self.pose @ np.array([nearest.x, nearest.y, 0.0])
