"""Questions about a surface's region."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon

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
