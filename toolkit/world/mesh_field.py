"""Terrain meshes as height fields: what is curved has no flat parts, and a height field follows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import shapely

from toolkit.geometry.pose import Pose
from toolkit.world.decomposition import FACET_DISTANCE
from toolkit.world.facets import Facet

_SPACING = 0.05  # m; between the points of a field. MuJoCo keeps too few contacts of a sole with a finer one
_STEEP = 0.1  # vertical part of the unit normals of the steepest triangles that are ground
_SMALL = 0.05  # m^2; smaller facets hardly hold a sole
_LEVEL = 0.01  # m; the underside of a terrain is level but for so much
_LEAST_BASE = 0.05  # m; thickness of a field under its lowest point
_AREA = 1e-3  # part by which the ground may miss its rectangle


@dataclass(frozen=True)
class MeshField:
    """A height field in the place of a mesh.

    Attributes:
        pose: World_from_field; its origin is above the middle of the field, at the height of the lowest point.
        half: (2,) m; half extents along x and y.
        heights: (rows, columns) m above the lowest point; rows along y, from its least.
        base: m; thickness under the lowest point.
    """

    pose: Pose
    half: np.ndarray
    heights: np.ndarray
    base: float


def is_splintered(facets: Sequence[Facet]) -> bool:
    """Whether most of what faces up in a mesh is in facets too small for a sole: it is curved."""
    area = np.array([facet.polygon.area for facet in facets if facet.frame.normal[2] > np.sqrt(0.5)])
    return bool(area[area < _SMALL].sum() > area.sum() / 2)


def field_of(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, vertices: np.ndarray, triangles: np.ndarray
) -> MeshField | None:
    """The height field that a mesh geom is to 1.5 mm; None where it is none over a whole rectangle.

    Args:
        model: The scene.
        data: Its state, with the kinematics computed.
        geom: The mesh geom.
        vertices: Its vertices (n, 3) in the world, m.
        triangles: Its triangles (k, 3).
    """
    corners = vertices[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    open_sheet = abs(cross[:, 2].sum()) > 0.5 * np.abs(cross[:, 2]).sum()
    cross *= np.sign(cross[:, 2].sum() if open_sheet else (corners.mean(axis=1) * cross).sum())
    length = np.maximum(np.linalg.norm(cross, axis=1), 1e-12)
    up, down = cross[:, 2] > _STEEP * length, cross[:, 2] < -_STEEP * length
    low = float(vertices[:, 2].min())
    if not up.any() or (down.any() and corners[down][..., 2].max() > low + _LEVEL):
        return None
    ground = corners[up]
    envelope = shapely.oriented_envelope(shapely.multipoints(vertices[np.unique(triangles[up]), :2]))
    if not isinstance(envelope, shapely.Polygon):
        return None
    around = np.asarray(envelope.exterior.coords)
    sides = np.diff(around[:3], axis=0)
    half = np.linalg.norm(sides, axis=1) / 2
    if abs(cross[up, 2].sum() / 2 - 4 * half.prod()) > _AREA * 4 * half.prod():
        return None  # it overhangs itself, or does not fill the rectangle
    frame = Pose.from_yaw(np.array([*around[:4].mean(axis=0), 0.0]), float(np.arctan2(sides[0, 1], sides[0, 0])))
    points = [np.linspace(-size, size, 1 + int(np.ceil(2 * size / _SPACING))) for size in half]
    above = float(vertices[:, 2].max()) + 1.0

    def heights(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(len(y), len(x)) m; NaN where nothing is."""
        inset = 1.0 - 1e-6
        places = np.stack([*np.meshgrid(inset * x, inset * y), np.full((len(y), len(x)), above)], axis=-1)
        ray = np.array([0.0, 0.0, -1.0])
        hits = np.array([mujoco.mj_rayMesh(model, data, geom, p, ray) for p in (frame @ places.reshape(-1, 3))])
        return np.where(hits < 0.0, np.nan, above - hits).reshape(len(y), len(x))

    grid = heights(*points)
    middles = [(line[1:] + line[:-1]) / 2 for line in points]
    seen = np.stack([*np.meshgrid(*middles), heights(*middles)], axis=-1).reshape(-1, 3)
    known = frame.inverse() @ np.concatenate([ground.reshape(-1, 3), ground.mean(axis=1)])
    checked = np.concatenate([known, seen])
    right = np.abs(_height(grid, half, checked) - checked[:, 2]) <= FACET_DISTANCE  # not where nothing was hit: NaN
    if not right.all():
        return None
    lowest = float(grid.min())
    pose = Pose(frame.rotation, np.array([*frame.position[:2], lowest]))
    return MeshField(pose, half, grid - lowest, max(lowest - low, _LEAST_BASE))


def _height(grid: np.ndarray, half: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) m; heights of a field at points (n, >= 2), between the grid's as MuJoCo splits its squares."""
    rows, columns = grid.shape
    x, y = ((points[:, :2] / half + 1.0) / 2 * [columns - 1, rows - 1]).T
    i, j = np.clip(y.astype(int), 0, rows - 2), np.clip(x.astype(int), 0, columns - 2)
    u, v = x - j, y - i
    here, right, over, across = grid[i, j], grid[i, j + 1], grid[i + 1, j], grid[i + 1, j + 1]
    below = here + (right - here) * u + (across - right) * v
    return np.where(u >= v, below, here + (across - over) * u + (over - here) * v)
