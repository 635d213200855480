"""Which of the floors that lie one above the other a goal is on."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from toolkit.geometry.plane import plane_height
from toolkit.world.surface import Surface
from toolkit.world.world import Goal

_APART = 0.5  # m; where nothing lies between heights of the ground that are farther apart, they are of different floors


def goal_floor(goal: Goal, surfaces: Iterable[Surface]) -> tuple[float, float]:
    """Least and greatest height in m of the floor within a goal's radius that is nearest to its middle.

    Above and below it is bounded halfway to the next floor, or infinite.
    """
    spans = sorted(span for surface in surfaces if (span := _span(goal, surface)) is not None)
    floors: list[tuple[float, float]] = []
    for low, high in spans:
        if floors and low - floors[-1][1] <= _APART:
            floors[-1] = floors[-1][0], max(floors[-1][1], high)
        else:
            floors.append((low, high))
    if len(floors) < 2:
        return -np.inf, np.inf
    height = float(goal.position[2])
    own = int(np.argmin([max(low - height, height - high, 0.0) for low, high in floors]))
    between = [(below[1] + above[0]) / 2 for below, above in zip(floors, floors[1:], strict=False)]
    bounds = [-np.inf, *between, np.inf]
    return bounds[own], bounds[own + 1]


def _span(goal: Goal, surface: Surface) -> tuple[float, float] | None:
    """Least and greatest height in m of a surface within a goal's radius; None where no foot stands on it there."""
    if not surface.serves_foot:
        return None
    rings = [ring[:, :2] for ring in surface.rings]
    low, high = rings[0].min(0), rings[0].max(0)
    if (low > goal.position[:2] + goal.radius).any() or (high < goal.position[:2] - goal.radius).any():
        return None
    inside = Polygon(rings[0], rings[1:]).buffer(0.0).intersection(Point(goal.position[:2]).buffer(goal.radius))
    if inside.is_empty:
        return None
    heights = plane_height(surface.pose.position, surface.normal, *shapely.get_coordinates(inside).T)
    return float(np.min(heights)), float(np.max(heights))
