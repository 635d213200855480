"""The relief of a surface: how its ground curves about its plane.

A relief is the six numbers of a paraboloid over the xy of a surface's frame: its height at the origin in m, its slopes
along x and y, and its second derivatives by xx, xy and yy in 1/m. All are 0 where the ground is flat.
"""

from __future__ import annotations

import numpy as np

FLAT = np.zeros(6)
_TRUSTED = 0.01  # terms that the points determine less than this part as well as the best are left at their least


def relief_of(points: np.ndarray) -> np.ndarray:
    """The relief (6,) nearest to points (n, 3) m in the frame; few points leave some terms open, which stay small."""
    size = max(float(np.abs(points[:, :2]).max()), 1e-9)
    unit = np.array([1.0, size, size, size**2, size**2, size**2])
    return np.linalg.lstsq(_terms(points[:, :2] / size), points[:, 2], rcond=_TRUSTED)[0] / unit


def off_relief(relief: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) m by which points (n, 3) of the frame are above a relief."""
    return points[:, 2] - _terms(points[:, :2]) @ relief


def moved_relief(relief: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """The relief of the same ground in the frame moved by `origin` (2,) m in its plane."""
    if not relief.any():
        return relief
    height, slopes = height_and_slopes(relief, origin[None])
    return np.array([height[0], *slopes[0], *relief[3:]])


def height_and_slopes(relief: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights (n,) in m and slopes (n, 2) at places (n, 2) m of a relief (6,), or of reliefs (n, 6) at one each."""
    x, y = places.T
    _, along_x, along_y, xx, xy, yy = relief.T
    slopes = np.column_stack([along_x + xx * x + xy * y, along_y + xy * x + yy * y])
    return (_terms(places) * relief).sum(axis=1), slopes


def crest(relief: np.ndarray) -> float:
    """The largest curvature in 1/m with which the ground falls to both sides; 0 where it does so nowhere."""
    *_, xx, xy, yy = relief
    return max(0.0, float(np.hypot((xx - yy) / 2, xy) - (xx + yy) / 2))


def _terms(places: np.ndarray) -> np.ndarray:
    """What each of a relief's numbers is multiplied with at places (n, 2), (n, 6)."""
    x, y = places.T
    return np.column_stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2])
