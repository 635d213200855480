"""Scenes that are scanned, as meshes."""

import numpy as np
import pytest
import trimesh

from toolkit.geometry.pose import Pose
from toolkit.scanning.samples import Scan


def sheet(pose: Pose, size: tuple[float, float], step: float = 0.015) -> Scan:
    """A rectangle in the xy plane of a frame, its centre at the origin, as a mesh of small triangles."""
    x, y = (np.linspace(-side / 2, side / 2, round(side / step) + 1) for side in size)
    points = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    corner = (np.arange(len(x) - 1)[:, None] * len(y) + np.arange(len(y) - 1)).ravel()
    right, up, across = corner + len(y), corner + 1, corner + len(y) + 1
    return Scan(pose @ points, np.column_stack([corner, right, across, corner, across, up]).reshape(-1, 3))


def noisy(scan: Scan, sigma: float, seed: int = 0) -> Scan:
    """A scan whose points are moved in random directions."""
    return Scan(scan.vertices + np.random.default_rng(seed).normal(0.0, sigma, scan.vertices.shape), scan.triangles)


def joined(*scans: Scan) -> Scan:
    """Scans in one mesh."""
    first = np.cumsum([0, *(len(scan.vertices) for scan in scans)])
    triangles = [scan.triangles + begin for scan, begin in zip(scans, first[:-1], strict=True)]
    return Scan(np.concatenate([scan.vertices for scan in scans]), np.concatenate(triangles))


@pytest.fixture
def steps() -> trimesh.Trimesh:
    """Three steps of 0.15 m, 1 m wide, that begin at x = 0."""
    boxes = []
    for step in range(3):
        size = np.array([0.4, 1.0, 0.15 * (step + 1)])
        middle = [0.4 * step + 0.2, 0.0, size[2] / 2]
        boxes.append(trimesh.creation.box(size, trimesh.transformations.translation_matrix(middle)))
    return trimesh.util.concatenate(boxes)
