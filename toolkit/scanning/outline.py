"""Outlines of what lies on a plane, drawn where the density of its points falls to a half."""

from __future__ import annotations

import numpy as np
import shapely
from contourpy import FillType, contour_generator
from scipy.ndimage import gaussian_filter
from shapely.geometry import Polygon

_WIDE = 4.0  # widths of the kernel: radius over which the usual density is taken
_EDGE = 0.575  # share of the usual density at an edge; what is usual is taken over a disc that the edge cuts, too
_MOST_CELLS = 4_000_000
_ROUND_ERROR = 0.97  # a convex hull takes the place of an outline that fills so much of it


def outline(points: np.ndarray, weight: np.ndarray, kernel: float, hole: float) -> list[Polygon]:
    """Regions of a plane that points cover, largest first, m.

    The density is smoothed by a Gaussian kernel and compared with what is usual around it. At a straight edge the
    smoothed density is a half of that inside, however blurred the edge is.

    Args:
        points: Points (n, 2) float in the plane, m.
        weight: Area that each stands for, (n,) float.
        kernel: Standard deviation of the kernel, m.
        hole: Holes in which no circle of this radius fits are closed, m.
    """
    step = kernel / 2
    extent = np.ptp(points, axis=0) + 12 * kernel
    step = max(step, float(np.sqrt(extent.prod() / _MOST_CELLS)))
    low = points.min(axis=0) - 6 * kernel
    cells = np.ceil(extent / step).astype(int) + 1
    index = np.floor((points - low) / step + 0.5).astype(int)
    density = np.bincount(index[:, 0] * cells[1] + index[:, 1], weight, cells.prod()).reshape(cells)
    narrow = gaussian_filter(density, kernel / step, mode="constant")
    wide = gaussian_filter(narrow, _WIDE * kernel / step, mode="constant")
    usual = gaussian_filter(narrow**2, _WIDE * kernel / step, mode="constant") / np.maximum(wide, 1e-12 * wide.max())
    share = np.where(wide > 1e-3 * wide.max(), narrow / np.maximum(usual, 1e-12 * usual.max()), 0.0)
    x, y = (low[axis] + step * np.arange(cells[axis]) for axis in range(2))
    contours = contour_generator(y, x, share, fill_type=FillType.OuterOffset)
    shapes = []
    for ring, first in zip(*contours.filled(_EDGE, np.inf), strict=True):
        parts = [ring[a:b, ::-1] for a, b in zip(first[:-1], first[1:], strict=True)]
        shape = shapely.make_valid(Polygon(parts[0], [part for part in parts[1:] if _is_hole(part, hole)]))
        shapes += [part for part in shapely.get_parts(shape) if isinstance(part, Polygon)]
    return sorted(shapes, key=lambda shape: -shape.area)


def _is_hole(ring: np.ndarray, radius: float) -> bool:
    """Whether a circle fits into a ring (k, 2)."""
    return len(ring) > 3 and not Polygon(ring).buffer(-radius).is_empty


def tidy(region: Polygon, tolerance: float, width: float) -> list[Polygon]:
    """A region without necks, spikes and notches narrower than `width` m, with few corners, as one or more polygons.

    Corners that stand out less than `tolerance` m are left out.
    """
    closed = region.buffer(width / 2, join_style="mitre", mitre_limit=1.5).buffer(-width, join_style="mitre")
    opened = closed.buffer(width / 2, join_style="mitre", mitre_limit=2.0)
    result = []
    for part in shapely.get_parts(opened):
        simple = shapely.make_valid(part.simplify(tolerance))
        for piece in shapely.get_parts(simple):
            if isinstance(piece, Polygon) and piece.area > width**2 / 2:
                hull = piece.convex_hull
                result.append(hull.simplify(tolerance) if piece.area > _ROUND_ERROR * hull.area else piece)
    return result


def is_wide(region: Polygon, width: float) -> bool:
    """Whether a circle of a diameter of `width` m fits into a region."""
    return not region.buffer(-width / 2).is_empty
