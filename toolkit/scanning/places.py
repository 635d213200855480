"""Where the robot starts in a scanned world, and where it goes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial.distance import cdist

from toolkit.errors import InputError
from toolkit.world.surface import Surface

_ROOM, _LEAST_ROOM = 0.3, 0.12  # m; wanted and least distance from the edge of a surface
_LEVEL = np.cos(np.radians(15.0))  # the robot starts and ends on what is no steeper, where there is such ground
_MOST = 400  # places that are compared


@dataclass(frozen=True)
class Places:
    """Start and goal.

    Attributes:
        start, goal: Points (3,) m on surfaces for feet.
        heading: Yaw of the start, rad.
    """

    start: np.ndarray
    goal: np.ndarray
    heading: float


def choose_places(
    surfaces: Sequence[Surface],
    start: tuple[float, ...] | None = None,
    goal: tuple[float, ...] | None = None,
) -> Places:
    """Put start and goal on surfaces for feet.

    Args:
        surfaces: Of the world.
        start: x and y in m, and the yaw in rad, which points to the goal where it is left out; None for one end of
            the longest way between places on level ground.
        goal: x and y in m; None for the place on level ground that is furthest from the start.

    Raises:
        InputError: There is no surface for feet where one is wanted.
    """
    ground = [surface for surface in surfaces if surface.serves_foot]
    if not ground:
        raise InputError("no flat place of at least 0.01 m^2 for a foot was found; see the options --up and --scale")
    candidates = _open_places(ground)
    if goal is not None:
        last = _on_ground(ground, goal[:2], "--goal")
        first = _furthest(candidates, last) if start is None else _on_ground(ground, start[:2], "--start")
    elif start is not None:
        first = _on_ground(ground, start[:2], "--start")
        last = _furthest(candidates, first)
    else:
        distance = cdist(candidates[:, :2], candidates[:, :2])
        ends = candidates[list(np.unravel_index(int(distance.argmax()), distance.shape))]
        first, last = ends[np.lexsort((ends[:, 1], ends[:, 0]))]
    way = last - first
    heading = start[2] if start is not None and len(start) > 2 else float(np.arctan2(way[1], way[0]))
    return Places(first, last, heading)


def _furthest(candidates: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The candidate (3,) that is furthest from a point (3,) seen from above."""
    return candidates[int(np.linalg.norm(candidates[:, :2] - point[:2], axis=1).argmax())]


def _open_places(ground: list[Surface]) -> np.ndarray:
    """Points (n, 3) on ground as level and as far from edges as can be had, m."""
    level = [surface for surface in ground if surface.normal[2] > _LEVEL] or ground
    places: list[np.ndarray] = []
    for surface in level:
        inner = surface.region.buffer(-_ROOM)
        if inner.is_empty:
            radius = shapely.maximum_inscribed_circle(surface.region)  # from its centre to the edge
            corners = shapely.get_coordinates(radius)[:1] if radius.length > _LEAST_ROOM else []
        else:
            corners = shapely.get_coordinates(inner)
        places += [surface.pose @ np.array([*corner, 0.0]) for corner in corners]
    places = places or [surface.nearest_point(surface.pose.position) for surface in level]
    return np.array(places)[:: len(places) // _MOST + 1]


def _on_ground(ground: list[Surface], point: Sequence[float], option: str) -> np.ndarray:
    """The lowest point (3,) of the ground over which x and y lie."""
    heights = np.array([surface.height(np.array([point]))[0] for surface in ground])
    if np.isfinite(heights).any():
        return np.array([*point, np.nanmin(heights)])
    corners = np.concatenate([surface.rings[0] for surface in ground])
    near = corners[int(np.linalg.norm(corners[:, :2] - point, axis=1).argmin())]
    low, high = corners.min(axis=0), corners.max(axis=0)
    raise InputError(
        f"{option} {point[0]:g},{point[1]:g}: no surface for feet there; the nearest has a corner at "
        f"{near[0]:.2f},{near[1]:.2f}, and all lie within {low[0]:.2f},{low[1]:.2f} and {high[0]:.2f},{high[1]:.2f}"
    )
