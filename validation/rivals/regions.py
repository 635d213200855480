"""Terrain as the rivals see it: convex regions in which the centre of a sole with a given heading may be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from toolkit.geometry.plane import along_plane
from toolkit.world.surface import Surface


class Region(NamedTuple):
    """A convex polygon in space.

    Attributes:
        surface: Index of its surface.
        sides: (k, 3) outward normals of its edges, along its plane.
        bounds: (k,) m; `sides @ p <= bounds` inside.
        normal: (3,) outward normal of its plane.
        height: m; `normal @ p == height` on it.
        friction: Sliding coefficient.
    """

    surface: int
    sides: np.ndarray
    bounds: np.ndarray
    normal: np.ndarray
    height: float
    friction: float


def sole_turn(normal: np.ndarray, heading: float) -> np.ndarray:
    """(3, 3) world_from_contact of a sole on a plane with this normal and a heading in rad."""
    ahead = np.array(along_plane(normal, np.cos(heading), np.sin(heading)))
    return np.column_stack([ahead, np.cross(normal, ahead), normal])


def regions_of(surfaces: Sequence[Surface], half_size: np.ndarray, heading: float) -> list[Region]:
    """The convex pieces of all surfaces for feet, shrunk so that a whole sole fits; pieces without room are left out.

    Args:
        surfaces: Surfaces of a world.
        half_size: (2,) m; half extents of a sole, zeros for a point.
        heading: rad; of all soles.
    """
    found = []
    for surface in surfaces:
        if not surface.serves_foot:
            continue
        turn = surface.pose.rotation
        sole = (sole_turn(surface.normal, heading)[:, :2].T @ turn[:, :2]) * half_size[:, None]
        for piece in surface.pieces:
            edges = np.roll(piece, -1, axis=0) - piece
            outward = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
            inner = (outward * piece).sum(1) - np.abs(outward @ sole.T).sum(1)
            if not _has_room(outward, inner):
                continue
            sides = outward @ turn[:, :2].T
            origin = surface.pose.position
            height = float(surface.normal @ origin)
            found.append(Region(surface.index, sides, inner + sides @ origin, surface.normal, height, surface.friction))
    return found


def _has_room(outward: np.ndarray, inner: np.ndarray) -> bool:
    """Whether a point satisfies `outward @ point <= inner`."""
    free = (None, None)
    return linprog(np.zeros(2), A_ub=outward, b_ub=inner, bounds=[free, free]).status == 0
