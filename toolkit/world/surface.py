"""A planar surface that can be touched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
