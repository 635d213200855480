"""What is too rough to stand on, as ellipsoids: they hold a robot's body off and are never a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.scanning.samples import cells_of

BLOCK = 0.1  # m; edge of the blocks whose points become one ellipsoid
_MOST_BLOCKS = 1500  # blocks are larger where there would be more
_LEAST_POINTS = 0.15  # share of the points of a flat block that a block must have; less is a speck
_FILL = 2.4  # standard deviations from the centre of an even spread to its corners
_THINNEST = 0.01  # m; half the least thickness


@dataclass(frozen=True)
class Blob:
    """An ellipsoid.

    Attributes:
        centre: (3,) m.
        diameters: (3,) m.
        rotation: World_from_blob.
    """

    centre: np.ndarray
    diameters: np.ndarray
    rotation: Rotation


def blobs(points: np.ndarray, spacing: float, noise: float) -> list[Blob]:
    """Ellipsoids around the points of each block of the rest of a scan.

    Args:
        points: Points (n, 3) m.
        spacing: Their distance, m.
        noise: Standard deviation of their noise, m; ellipsoids are thinner by it than the points are spread.
    """
    if len(points) == 0:
        return []
    size = BLOCK
    owner, count = cells_of(points, size)
    while count > _MOST_BLOCKS:
        size *= 1.2 * np.sqrt(count / _MOST_BLOCKS) ** 0.5
        owner, count = cells_of(points, size)
    order = np.argsort(owner, kind="stable")
    groups = np.split(points[order], np.flatnonzero(np.diff(owner[order])) + 1)
    least = max(3.0, _LEAST_POINTS * (size / spacing) ** 2)
    return [_blob(group, noise) for group in groups if len(group) >= least]


def _blob(points: np.ndarray, noise: float) -> Blob:
    """The ellipsoid around some points (n, 3)."""
    centre = points.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(points.T))
    if np.linalg.det(vectors) < 0:
        vectors = -vectors
    half = _FILL * np.sqrt(np.maximum(values - noise**2, 0.0))
    return Blob(centre, 2 * np.maximum(half, _THINNEST), Rotation.from_matrix(vectors))
