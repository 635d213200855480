"""What was measured, as points that each stand for a part of a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from toolkit.errors import InputError

_CLOSED = 0.02  # the sides of a closed mesh cancel each other up to this share
_MOST_POINTS = 150_000  # thinned points; the spacing grows with the scene
_MOST_ASKED = 5_000  # points whose neighbours are asked for
_MOST_PIECES = 2_000_000  # pieces of triangles
_WIDEST = 0.08  # m; places for feet cannot be made out of samples further apart


@dataclass(frozen=True)
class Scan:
    """What a file holds, in metres with z up.

    Attributes:
        vertices: Points (n, 3) float, m.
        triangles: Triangles (k, 3) int, counterclockwise seen from outside; none for a point cloud.
    """

    vertices: np.ndarray
    triangles: np.ndarray

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest coordinates (2, 3), m."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])


@dataclass(frozen=True)
class Samples:
    """Points of measured surfaces, and fewer points that stand for them.

    Attributes:
        points: Points (n, 3) float, m.
        area: What each point stands for, (n,) float, m^2.
        turned: Area times outward normal (n, 3) float, m^2; zero where a side is not known.
        spacing: Edge of the cells in which points are put together, m.
        owner: Thin point (n,) int that a point belongs to.
        thin: Thin points (t, 3) float, m: means of the points of each cell.
        weight: Area that each thin point stands for, (t,) float, m^2.
    """

    points: np.ndarray
    area: np.ndarray
    turned: np.ndarray
    spacing: float
    owner: np.ndarray
    thin: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, area: np.ndarray, turned: np.ndarray, spacing: float) -> Samples:
        """Samples from points, with the thin points computed.

        Raises:
            InputError: They lie too far apart, or would because the scene is so large.
        """
        if len(points) == 0:
            return cls(points, area, turned, spacing, np.zeros(0, int), np.zeros((0, 3)), np.zeros(0))
        owner, count = cells_of(points, spacing)
        if count > _MOST_POINTS:
            spacing *= float(np.sqrt(count / _MOST_POINTS))
            owner, count = cells_of(points, spacing)
        if spacing > _WIDEST:
            raise InputError(
                f"samples of the scan are {spacing:.2g} m apart, too far to find places for feet; give a denser scan, "
                "cut out the part that the robot walks through, or see --scale"
            )
        number = np.bincount(owner, minlength=count)
        thin = np.column_stack([np.bincount(owner, points[:, axis], count) for axis in range(3)]) / number[:, None]
        return cls(points, area, turned, spacing, owner, thin, np.bincount(owner, area, count))

    @classmethod
    def joined(cls, parts: Sequence[Samples], spacing: float) -> Samples:
        """The samples of several scans of one place; `spacing` m holds where there are none."""
        if not parts:
            return cls.of(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), spacing)
        points, area, turned = (
            np.concatenate(column) for column in zip(*((s.points, s.area, s.turned) for s in parts), strict=True)
        )
        return cls.of(points, area, turned, max(part.spacing for part in parts))


def cells_of(points: np.ndarray, size: float) -> tuple[np.ndarray, int]:
    """Cubic cell (n,) of each point, numbered from 0, and the number of cells that hold one."""
    index = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    extent = index.max(axis=0) + 1
    key = (index[:, 0] * extent[1] + index[:, 1]) * extent[2] + index[:, 2]
    found, owner = np.unique(key, return_inverse=True)
    return owner.reshape(-1), len(found)


def samples_of(scan: Scan, spacing: float) -> Samples:
    """Samples of a scan: at most one cell of `spacing` m apart, wider where the scene is too large for that.

    Triangles are cut into as many pieces as their area asks for; each piece gives a point. The points of a cloud all
    stand for the same area.
    """
    if len(scan.triangles) == 0:
        spacing = max(spacing, _distance(scan.vertices))
        each = _column_area(scan.vertices, spacing)
        return Samples.of(scan.vertices, np.full(len(scan.vertices), each), np.zeros_like(scan.vertices), spacing)
    corners = scan.vertices[scan.triangles]
    turned = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turned *= _outward(corners, turned)
    area = np.linalg.norm(turned, axis=1)
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = _parts(edge, spacing)
    while (parts.astype(float) ** 2).sum() > max(_MOST_PIECES, 1.5 * len(parts)):
        spacing *= 1.3
        parts = _parts(edge, spacing)
    points, areas, sides = [], [], []
    for count in np.unique(parts).tolist():
        chosen = parts == count
        shares = _barycentres(count)
        found = np.einsum("pc,kcx->kpx", shares, corners[chosen]).reshape(-1, 3)
        points.append(found)
        areas.append(np.repeat(area[chosen] / len(shares), len(shares)))
        sides.append(np.repeat(turned[chosen] / len(shares), len(shares), axis=0))
    return Samples.of(np.concatenate(points), np.concatenate(areas), np.concatenate(sides), spacing)


def _outward(corners: np.ndarray, turned: np.ndarray) -> float:
    """1 or -1: the sign with which triangles (k, 3, 3) of a closed mesh face outward, and those of a sheet up."""
    total, area = turned.sum(axis=0), np.linalg.norm(turned, axis=1).sum()
    middle = corners.reshape(-1, 3).mean(axis=0)
    volume = float(np.einsum("kx,kx->", corners.mean(axis=1) - middle, turned))
    closed = np.linalg.norm(total) < _CLOSED * area
    return -1.0 if (volume if closed else total[2]) < 0 else 1.0


def _distance(points: np.ndarray) -> float:
    """Usual distance of a point of a cloud from the fourth nearest, m: on a grid, the distance of its lines."""
    some = points[:: len(points) // _MOST_ASKED + 1]
    distance, _ = KDTree(points).query(some, min(5, len(points)))
    return float(np.median(distance[:, -1]))


def _column_area(points: np.ndarray, spacing: float) -> float:
    """Area in m^2 that a point of a cloud stands for in the mean: that of its columns seen along the best axis."""
    covered = max(len(np.unique(np.floor(np.delete(points, axis, 1) / spacing), axis=0)) for axis in range(3))
    return covered * spacing**2 / max(len(points), 1)


def _parts(edge: np.ndarray, spacing: float) -> np.ndarray:
    """Parts (k,) into which the sides of triangles are cut, by their longest edges (k,)."""
    return np.maximum(np.ceil(edge / (2 * spacing)), 1).astype(int)


def _barycentres(count: int) -> np.ndarray:
    """Weights (count^2, 3) of the corners at the centres of the `count`^2 equal parts of a triangle."""
    upright = [(3 * i + 1, 3 * j + 1) for i in range(count) for j in range(count - i)]
    turned = [(3 * i + 2, 3 * j + 2) for i in range(count - 1) for j in range(count - 1 - i)]
    first = np.array(upright + turned, float) / (3 * count)
    return np.column_stack([first, 1.0 - first.sum(axis=1)])
