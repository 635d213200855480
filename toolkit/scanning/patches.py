"""Planar patches and rough rests: what is made of a scan."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from scipy.spatial import KDTree
from shapely.geometry import Polygon

from toolkit.geometry.pose import Pose
from toolkit.scanning.local_planes import local_planes
from toolkit.scanning.outline import outline, tidy
from toolkit.scanning.planes import Plane, PlaneConfig, find_planes
from toolkit.scanning.samples import Samples

_RADIUS = 0.11  # m; neighbourhood in which noise of 2 cm is told from shape
_MARGIN = 0.5  # of the noise; how far from its edge a patch can be touched
_HOLE = 0.1  # m; smaller holes of a patch were not seen and are taken to be closed
_LEVEL = np.cos(np.radians(80.0))  # what is flatter and has no known side faces up


@dataclass(frozen=True)
class Patch:
    """A planar region.

    Attributes:
        frame: World_from_patch pose; z is the outward normal.
        polygon: Outline in the frame's xy of what can be touched, m.
        body: Outline of what is there, m: noise makes it uncertain whether its edge can be touched. Empty where there
            is no more than the polygon.
    """

    frame: Pose
    polygon: Polygon
    body: Polygon = field(default_factory=Polygon)


@dataclass(frozen=True)
class Reading:
    """What was made of the samples of a scan.

    Attributes:
        patches: Planar regions, largest first.
        noise: Standard deviation of the noise along normals, m.
        explained: Share of the samples' area that lies on patches.
        rest: Points (r, 3) that lie on none, m.
        spacing: Distance of the samples, m.
    """

    patches: list[Patch]
    noise: float
    explained: float
    rest: np.ndarray
    spacing: float


def read_samples(samples: Samples) -> Reading:
    """Find the planar patches of a scan and what is left over."""
    if len(samples.thin) == 0:
        return Reading([], 0.0, 0.0, np.zeros((0, 3)), samples.spacing)
    radius = max(_RADIUS, 3 * samples.spacing)
    local = local_planes(samples, radius)
    noise = max(local.noise, 1e-3)
    finer = float(np.clip(16 * noise, 4 * samples.spacing, radius))
    if finer < 0.8 * radius:
        local, radius = local_planes(samples, finer), finer
    config = PlaneConfig.of(noise, samples.spacing, radius)
    planes = _facing(samples, find_planes(samples, local, config))
    label = np.full(len(samples.thin), -1)
    for number, plane in enumerate(planes):
        label[plane.points] = number
    order = np.argsort(label[samples.owner], kind="stable")
    ends = np.searchsorted(label[samples.owner][order], np.arange(len(planes) + 1))
    patches: list[Patch] = []
    for plane, first, last in zip(planes, ends[:-1], ends[1:], strict=True):
        own = order[first:last]
        points = (plane.frame.inverse() @ samples.points[own])[:, :2]
        for region in outline(points, samples.area[own], config.kernel, _HOLE):
            for body in tidy(region, config.kernel / 2, config.width / 2):
                inner = body.buffer(-_MARGIN * noise, join_style="mitre")
                parts = [part for part in shapely.get_parts(inner) if not part.is_empty]
                bodies = [body] + [Polygon()] * len(parts)  # of several parts the first has the body
                patches += [Patch(plane.frame, *both) for both in zip(parts, bodies, strict=False)]
    patches.sort(key=lambda patch: -patch.polygon.area)
    height, beside = _from_patches(samples.thin, patches, config)
    on_patch = (height <= config.near) & (beside <= config.kernel + noise)
    rest = (height > config.near + noise) | (beside > 2.5 * config.kernel + noise)
    explained = float(samples.weight[on_patch].sum() / max(samples.weight.sum(), 1e-12))
    return Reading(patches, noise, explained, samples.thin[rest], samples.spacing)


def _facing(samples: Samples, planes: list[Plane]) -> list[Plane]:
    """The planes with outward normals: as the scan says, else up, and walls towards the ground beside them."""
    ground = [i for plane in planes if abs(plane.normal[2]) > 0.7 for i in plane.points[::10].tolist()]
    tree = KDTree(samples.thin[ground]) if ground else None
    result = []
    for plane in planes:
        towards = plane.normal
        if not plane.sided:
            towards = np.array([0.0, 0.0, 1.0])
            if abs(plane.normal[2]) < _LEVEL and tree is not None:
                _, near = tree.query(plane.centre, min(50, len(ground)))
                towards = samples.thin[np.take(ground, near)].reshape(-1, 3).mean(axis=0) - plane.centre
        result.append(plane if plane.normal @ towards >= 0 else replace(plane, normal=-plane.normal))
    return result


def _from_patches(points: np.ndarray, patches: list[Patch], config: PlaneConfig) -> tuple[np.ndarray, np.ndarray]:
    """Distance (n,) of points (n, 3) from the plane of the nearest patch, and along it from the outline, m.

    Both are inf for points that are not near a patch.
    """
    height, beside = np.full(len(points), np.inf), np.full(len(points), np.inf)
    tree = KDTree(points)
    for patch in patches:
        shapely.prepare(patch.polygon)
        ring = shapely.get_coordinates(patch.polygon)
        radius = np.linalg.norm(ring, axis=1).max() + config.width
        near = np.array(tree.query_ball_point(patch.frame.position, radius), int)
        local = patch.frame.inverse() @ points[near]
        off = np.abs(local[:, 2])
        near, local, off = (column[off <= config.near + config.noise] for column in (near, local, off))
        away = np.asarray(shapely.distance(patch.polygon, shapely.points(local[:, :2])))
        better = away + off < height[near] + beside[near]
        height[near[better]], beside[near[better]] = off[better], away[better]
    return height, beside
