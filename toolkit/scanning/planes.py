"""Planes of a scan: cores grown over local planes, and every thin point given to the plane that explains it best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from toolkit.geometry.pose import Pose
from toolkit.scanning.local_planes import LocalPlanes
from toolkit.scanning.outline import is_wide, outline
from toolkit.scanning.samples import Samples
from toolkit.world.facets import plane_frame

_CORE_ANGLE = np.radians(8.0)  # local planes of a core are within this angle of its plane
_REGROWN = 3  # times that a core is grown again from its better plane
_LEAST_CORE = 3  # places
_SAME_ANGLE = np.radians(9.0)  # planes within this angle may be one
_WORSE, _EXACT = 0.2, 2e-3  # share of the variance of the noise, and m, by which one plane may fit worse than two
_WIDTHS = (0.0, 0.0, 0.5, 0.75, 1.0, 1.0)  # least width of planes in the rounds, as a share of the configured one


@dataclass(frozen=True)
class PlaneConfig:
    """What counts as lying on one plane.

    Attributes:
        noise: Standard deviation of the scan along normals, m.
        radius: Radius of the neighbourhoods of the local planes, m.
        tolerance: Largest distance of a core's places from its plane, m.
        width: Planes on which no circle of this diameter fits are left out, m.
        smoothing: Radius over which the distances from a plane are averaged, m.
        kernel: Standard deviation of the kernel that smoothes the density of points on a plane, m.
    """

    noise: float
    radius: float
    tolerance: float
    width: float
    smoothing: float
    kernel: float

    @classmethod
    def of(cls, noise: float, spacing: float, radius: float) -> PlaneConfig:
        """What suits a scan with some noise and points some distance apart, all in m."""
        return cls(
            noise=noise,
            radius=radius,
            tolerance=max(4e-3, 0.5 * noise),
            width=max(0.06, 2 * spacing, 12 * noise),
            smoothing=max(3.5 * spacing, min(6.5 * noise, 0.09)),
            kernel=max(1.25 * spacing, 2 * noise),
        )

    @property
    def near(self) -> float:
        """Points further from a plane do not belong to it, m."""
        return 3.0 * self.noise + self.tolerance


@dataclass(frozen=True)
class Plane:
    """A plane and where to look for its points.

    Attributes:
        normal: Unit normal (3,).
        centre: Point (3,) on the plane, m.
        sided: Whether the scan says that the normal points outward.
        reach: Thin points that may lie on it, ascending (r,) int.
        points: Thin points that lie on it, (n,) int.
    """

    normal: np.ndarray
    centre: np.ndarray
    sided: bool
    reach: np.ndarray
    points: np.ndarray

    @property
    def frame(self) -> Pose:
        """World_from_plane pose; z is the normal."""
        return plane_frame(self.centre, self.normal)


def find_planes(samples: Samples, local: LocalPlanes, config: PlaneConfig) -> list[Plane]:
    """The planes of a scan, largest first.

    Cores grow over local planes that agree. Every thin point is then given to the plane that it and its neighbours lie
    on best, the planes are fitted to their points, and planes that turn out to be one are joined. Planes that are too
    narrow, as those that bridge the seam of two others, leave their points to the rest in a few rounds.
    """
    planes = _cores(samples, local, config)
    around = _neighbours(samples.thin, config.smoothing)
    for share in _WIDTHS:
        planes = [_fitted(samples, plane) for plane in _assigned(samples, planes, around, config)]
        planes = _unified(samples, planes, config)
        if share > 0.0:
            planes = [plane for plane in planes if _is_wide(samples, plane, share * config.width, config.kernel)]
    planes = _assigned(samples, planes, around, config)
    return sorted(planes, key=lambda plane: -samples.weight[plane.points].sum())


def _cores(samples: Samples, local: LocalPlanes, config: PlaneConfig) -> list[Plane]:
    """Planes of connected groups of local planes that agree, flattest first."""
    flat = np.flatnonzero(local.spread < 1.35 * config.noise + 0.5 * config.tolerance)
    places, normals, weight, sided = (
        column[flat] for column in (local.places, local.normals, local.weight, local.sided)
    )
    graph = _neighbours(places, 0.8 * config.radius)
    tree = KDTree(samples.thin)
    free, tried = np.ones(len(flat), bool), np.zeros(len(flat), bool)
    planes = []
    for seed in np.argsort(local.spread[flat], kind="stable").tolist():
        if not free[seed] or tried[seed]:
            continue
        normal, centre = normals[seed], places[seed]
        group = np.array([seed])
        for _ in range(_REGROWN):
            along = normals @ normal
            alike = free & (np.where(sided, along, np.abs(along)) > np.cos(_CORE_ANGLE))
            alike &= np.abs((places - centre) @ normal) < config.tolerance
            group = _connected(graph, np.flatnonzero(alike), seed)
            if len(group) < _LEAST_CORE:
                break
            normal, centre = _fit(places[group], weight[group], normal)
        tried[group] = True
        if len(group) >= _LEAST_CORE:
            free[group] = False
            near = np.concatenate(tree.query_ball_point(places[group], config.radius).tolist())
            known = bool(sided[group].mean() > 0.5)
            planes.append(Plane(normal, centre, known, np.unique(near).astype(int), np.zeros(0, int)))
    return planes


def _connected(graph: csr_array, chosen: np.ndarray, seed: int) -> np.ndarray:
    """The chosen nodes that hang together with `seed`; none if it is not chosen."""
    at = np.searchsorted(chosen, seed)
    if at == len(chosen) or chosen[at] != seed:
        return np.zeros(0, int)
    _, part = connected_components(graph[chosen][:, chosen], directed=False)
    return chosen[part == part[at]]


def _fit(points: np.ndarray, weight: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal (3,), on the side of `towards`, and centre (3,) of the plane through weighted points (n, 3)."""
    centre = weight @ points / weight.sum()
    offset = points - centre
    _, vectors = np.linalg.eigh((offset * weight[:, None]).T @ offset)
    normal = vectors[:, 0]
    return (normal if normal @ towards >= 0 else -normal), centre


def _neighbours(points: np.ndarray, radius: float) -> csr_array:
    """Matrix (t, t) that sums over the points within `radius` m, the point itself included."""
    pairs = KDTree(points).query_pairs(radius, output_type="ndarray")
    own = np.arange(len(points))
    rows = np.concatenate([pairs[:, 0], pairs[:, 1], own])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0], own])
    return csr_array(coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(points), len(points))))


def _assigned(samples: Samples, planes: list[Plane], around: csr_array, config: PlaneConfig) -> list[Plane]:
    """The planes with their points: those whose neighbourhoods lie on that plane best, and well enough."""
    thin, weight = samples.thin, samples.weight
    total = around @ weight
    best = np.full(len(thin), (1.7 * config.noise + 0.5 * config.tolerance) ** 2)
    label, squares = np.full(len(thin), -1), np.zeros(len(thin))
    for number, plane in enumerate(planes):
        off = np.abs((thin[plane.reach] - plane.centre) @ plane.normal)
        close = plane.reach[off < config.near]
        rows = around[close]
        used = np.zeros(len(thin), bool)
        used[rows.indices] = True
        squares[used] = ((thin[used] - plane.centre) @ plane.normal) ** 2
        squares[used] = np.minimum(squares[used], config.near**2) * weight[used]
        cost = (rows @ squares) / total[close]
        better = cost < best[close]
        best[close[better]], label[close[better]] = cost[better], number
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(len(planes) + 1))
    points = [order[a:b] for a, b in zip(ends[:-1], ends[1:], strict=True)]
    return [replace(plane, points=own) for plane, own in zip(planes, points, strict=True) if len(own) > _LEAST_CORE]


def _fitted(samples: Samples, plane: Plane) -> Plane:
    """The plane through its points."""
    normal, centre = _fit(samples.thin[plane.points], samples.weight[plane.points], plane.normal)
    return replace(plane, normal=normal, centre=centre)


def _is_wide(samples: Samples, plane: Plane, width: float, kernel: float) -> bool:
    """Whether a circle of a diameter of `width` m fits on what the plane's points cover."""
    points = (plane.frame.inverse() @ samples.thin[plane.points])[:, :2]
    regions = outline(points, samples.weight[plane.points], kernel, width)
    return any(is_wide(region, width) for region in regions)


def _unified(samples: Samples, planes: list[Plane], config: PlaneConfig) -> list[Plane]:
    """The planes, each joined with a larger one that it touches if one plane fits the points of both nearly as well."""
    result: list[Plane] = []
    for plane in sorted(planes, key=lambda plane: -len(plane.points)):
        for index, larger in enumerate(result):
            joint = _joint(samples, larger, plane, config)
            if joint is not None:
                result[index] = joint
                break
        else:
            result.append(plane)
    return result


def _joint(samples: Samples, larger: Plane, plane: Plane, config: PlaneConfig) -> Plane | None:
    """One plane for the points of two; None where they do not touch or need two planes."""
    along = plane.normal @ larger.normal
    if (along if plane.sided and larger.sided else abs(along)) < np.cos(_SAME_ANGLE):
        return None
    between = plane.centre - larger.centre
    if min(abs(between @ larger.normal), abs(between @ plane.normal)) > config.near:
        return None
    tree = KDTree(samples.thin[larger.points])
    distance, _ = tree.query(samples.thin[plane.points], distance_upper_bound=3 * samples.spacing)
    if not np.isfinite(distance).any():
        return None
    both = (np.concatenate([a, b]) for a, b in ((larger.reach, plane.reach), (larger.points, plane.points)))
    reach, points = (np.unique(indices) for indices in both)
    joint = _fitted(samples, replace(larger, reach=reach, points=points))
    worse = max(_square(samples, one.points, joint) - _square(samples, one.points, one) for one in (larger, plane))
    return joint if worse < _WORSE * config.noise**2 + _EXACT**2 else None


def _square(samples: Samples, points: np.ndarray, plane: Plane) -> float:
    """Mean square distance of some thin points from a plane, m^2."""
    return float(np.mean(((samples.thin[points] - plane.centre) @ plane.normal) ** 2))
