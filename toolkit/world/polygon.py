"""Questions about a surface's region."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.ops import nearest_points

from toolkit.world.surface import Surface


def region_of(surface: Surface) -> Polygon:
    """The region of a surface, holes included, in the surface's frame."""
    return Polygon(surface.boundary[0], surface.boundary[1:])


def surface_height(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Height of a surface over points of the ground plane.

    Args:
        surface: not vertical.
        points: (n, 2) float, m; world xy.

    Returns:
        (n,) float, m; world z, NaN where the surface is not there.
    """
    normal, origin = surface.normal, surface.pose.position
    height = origin[2] - (points - origin[:2]) @ normal[:2] / normal[2]
    local = surface.pose.inverse() @ np.column_stack([points, height])
    inside = shapely.intersects_xy(region_of(surface), local[:, 0], local[:, 1])
    return np.where(inside, height, np.nan)


def nearest_point(surface: Surface, point: np.ndarray) -> np.ndarray:
    """(3,) m; the point of a surface nearest to a point (3,) m of the world."""
    x, y, _ = surface.pose.inverse() @ point
    nearest = nearest_points(region_of(surface), Point(x, y))[0]
    return surface.pose @ np.array([nearest.x, nearest.y, 0.0])
