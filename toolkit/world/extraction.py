"""Contact surfaces of a world: merge flush faces, cut away what is covered, split the rest into convex pieces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.sparse import coo_array
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from toolkit.geometry.pose import Pose
from toolkit.world.convex import convex_partition
from toolkit.world.faces import Face, faces_of
from toolkit.world.solids import Solids
from toolkit.world.source import Source
from toolkit.world.surface import Surface

_BATCH = 64  # faces that are looked at together
_LARGEST = 12  # shadows that are tried one after the other
_MANY = 50  # faces that are joined at once; fewer one after the other


@dataclass(frozen=True)
class SurfaceConfig:
    """What counts as a contact surface.

    Attributes:
        foot_angle: rad; a surface serves feet up to this angle between its normal and up.
        palm_angle_min, palm_angle_max: rad; a surface serves palms between these.
        clearance: m; room needed above a surface, along its normal.
        flush: m; geometry up to this height above a surface does not cover it, and faces of equal friction whose
            planes differ by less and that are no further apart are one surface.
        flush_angle: rad; faces that are merged have normals within this.
        foot_area, palm_area: m^2; smaller regions are dropped.
        foot_width, palm_width: m; regions in which no circle of this diameter fits are dropped.
        simplify: m; what covers a surface is widened by this, and its corners that stand out less are left out.
        plane_margin: m; infinite planes end this far beyond start and goal.
    """

    foot_angle: float = np.radians(45.0)
    palm_angle_min: float = np.radians(60.0)
    palm_angle_max: float = np.radians(120.0)
    clearance: float = 0.15
    flush: float = 1e-3
    flush_angle: float = np.radians(0.5)
    foot_area: float = 0.01
    palm_area: float = 3e-3
    foot_width: float = 0.06
    palm_width: float = 0.05
    simplify: float = 1e-3
    plane_margin: float = 3.0


def extract_surfaces(
    source: Source,
    solids: Solids,
    square: tuple[float, ...],
    config: SurfaceConfig,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Surface, ...]:
    """Contact surfaces of a world.

    Args:
        source: the world's scene.
        solids: its colliding geometry (`solids_of`).
        square: (xmin, ymin, xmax, ymax), m; infinite planes are cut to it.
        config: what counts as a surface.
        progress: told how much is done, in [0, 1].

    Returns:
        Surfaces that serve feet or palms, in the order of the geoms.
    """
    least = min(config.foot_area, config.palm_area) / 3  # flush faces of several geoms may be large enough together
    faces = faces_of(source, square=square, least_area=least)
    faces = [face for face, served in zip(faces, _serves(faces, config).tolist(), strict=True) if any(served)]
    faces = _merged(faces, config)
    faces = [face for face, holds in zip(faces, _hold_contacts(faces, config), strict=True) if holds]
    regions: list[Face] = []
    for begin in range(0, len(faces), _BATCH):
        progress(begin / len(faces))
        regions += _open_regions(faces[begin : begin + _BATCH], solids, config)
    regions = [face for face, holds in zip(regions, _hold_contacts(regions, config), strict=True) if holds]
    surfaces: list[Surface] = []
    for face, (foot, palm) in zip(regions, _serves(regions, config).tolist(), strict=True):
        region = orient(shapely.remove_repeated_points(face.polygon, 1e-6))
        centre = np.asarray(region.centroid.coords[0])
        moved = shapely.transform(region, lambda points, by=centre: points - by)
        pose = face.frame @ Pose(np.eye(3), np.array([*centre, 0.0]))
        rings = (moved.exterior, *moved.interiors)
        surfaces.append(
            Surface(
                index=len(surfaces),
                geom=face.geom,
                pose=pose,
                boundary=tuple(np.asarray(ring.coords)[:-1] for ring in rings),
                pieces=tuple(convex_partition(moved)),
                friction=face.friction,
                serves_foot=foot,
                serves_palm=palm,
            )
        )
    return tuple(surfaces)


def _serves(faces: list[Face], config: SurfaceConfig) -> np.ndarray:
    """(n, 2) bool; whether faces serve feet, palms, by the angle of their normals."""
    normals = np.array([face.frame.normal for face in faces]).reshape(-1, 3)
    angle = np.arccos(np.clip(normals[:, 2], -1.0, 1.0))
    slack = 1e-6  # a wall of exactly the limit counts
    palm = (angle >= config.palm_angle_min - slack) & (angle <= config.palm_angle_max + slack)
    return np.column_stack([angle <= config.foot_angle + slack, palm])


def _merged(faces: list[Face], config: SurfaceConfig) -> list[Face]:
    """Faces with the flush ones of different geoms and equal friction joined.

    As with facets, what is joined is measured against the largest face of the group: a chain of slightly raised
    tiles does not become one surface.
    """
    if len({face.geom for face in faces}) < 2:
        return faces
    normals = np.array([face.frame.normal for face in faces])
    origins = np.array([face.frame.position for face in faces])
    geoms = np.unique([face.geom for face in faces], return_inverse=True)[1]
    outlines = [face.frame @ _with_zeros(shapely.get_coordinates(face.polygon)) for face in faces]
    first, second = _near_pairs(faces, normals, outlines, config)
    size = (len(faces), len(faces))
    graph = coo_array((np.ones(len(first), bool), (first, second)), shape=size).tocsr()
    used = np.zeros(len(faces), bool)
    result: dict[int, Face] = {}
    for seed in np.argsort([-face.polygon.area for face in faces], kind="stable").tolist():
        if used[seed]:
            continue
        used[seed] = True
        frame, shapes = faces[seed].frame, {seed: faces[seed].polygon}

        def joins(here: int, other: int, seed: int = seed, frame: Pose = frame, shapes: dict = shapes) -> bool:
            """Whether a face lies in the seed's plane and touches one of its group."""
            if normals[other] @ normals[seed] <= np.cos(config.flush_angle):
                return False
            if other not in shapes:
                if abs((origins[other] - origins[seed]) @ normals[seed]) >= 2 * config.flush:
                    return False
                if np.abs((frame.inverse() @ outlines[other])[:, 2]).max() > config.flush:
                    return False
                shapes[other] = _in_frame(faces[other], frame)
            return shapely.dwithin(shapes[here], shapes[other], config.flush)

        def neighbours(here: int) -> list[int]:
            around = graph.indices[graph.indptr[here] : graph.indptr[here + 1]]
            return [int(other) for other in np.sort(around) if not used[other]]

        members, waiting = [seed], [seed]
        while waiting:
            here = waiting.pop(0)
            for other in neighbours(here):
                if (geoms[other] != geoms[seed] or len(members) > 1) and joins(here, other):
                    used[other] = True
                    members.append(other)
                    waiting.append(other)
        polygon, others = shapes[seed], [shapes[member] for member in members[1:]]
        for batch in [[other] for other in others] if len(others) < _MANY else [others]:
            polygon = _sealed([polygon, *batch], config.flush)
        names = dict.fromkeys(faces[member].geom for member in members)
        result[min(members)] = Face("+".join(names), faces[seed].friction, frame, polygon)
    return [result[first] for first in sorted(result)]


def _near_pairs(
    faces: list[Face], normals: np.ndarray, outlines: list[np.ndarray], config: SurfaceConfig
) -> np.ndarray:
    """(2, k) pairs of faces, both ways round, of equal friction whose boxes touch and that may lie in one plane."""
    low = np.array([points.min(axis=0) for points in outlines]) - config.flush
    high = np.array([points.max(axis=0) for points in outlines]) + config.flush
    friction = np.array([face.friction for face in faces])
    boxes = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    pairs = shapely.STRtree(boxes).query(boxes)
    first, second = pairs
    near = (first != second) & (friction[first] == friction[second])
    near &= (low[first, 2] <= high[second, 2]) & (low[second, 2] <= high[first, 2])
    near &= (normals[first] * normals[second]).sum(axis=1) > np.cos(2 * config.flush_angle)
    return pairs[:, near]


def _with_zeros(points: np.ndarray) -> np.ndarray:
    """(n, 3) points of the plane z = 0 from (n, 2)."""
    return np.column_stack([points, np.zeros(len(points))])


def _in_frame(face: Face, frame: Pose) -> Polygon:
    """Outline of a face projected on another frame's xy."""
    other = frame.inverse() @ face.frame
    return shapely.transform(face.polygon, lambda points: (other @ _with_zeros(points))[:, :2])


def _sealed(shapes: list[Polygon], gap: float) -> Polygon:
    """Union of shapes, seams up to `gap` wide closed."""
    union = shapely.union_all(shapes)
    if isinstance(union, Polygon) and not union.interiors:
        return union
    closed = shapely.union_all(shapes).buffer(gap, join_style="mitre").buffer(-gap, join_style="mitre")
    return closed if isinstance(closed, Polygon) else max(shapely.get_parts(closed), key=lambda part: part.area)


def _open_regions(faces: list[Face], solids: Solids, config: SurfaceConfig) -> list[Face]:
    """Connected regions of faces that nothing covers; holes are kept."""
    regions = shapely.simplify([face.polygon for face in faces], 1e-6)
    shapely.prepare(regions)
    frames = [face.frame for face in faces]
    owner, shadows = solids.shadows(frames, shapely.bounds(regions), config.flush, config.clearance)
    covers = shapely.intersects(regions[owner], shadows)
    owner, shadows = owner[covers], shadows[covers]
    rest, large = _without_largest(regions, owner, shadows, least := min(config.foot_area, config.palm_area) / 2)
    lost = shapely.area(rest) < least
    regions[lost] = Polygon()
    shapely.prepare(rest)
    covers = ~lost[owner] & (large | shapely.dwithin(rest[owner], shadows, 10 * config.simplify))
    covers[covers] = shapely.area(shapely.intersection(regions[owner[covers]], shadows[covers])) > 1e-7
    owner, shadows = owner[covers], shadows[covers]
    covered = np.unique(owner)
    if len(covered):
        # Widened by what the outline may move when it is simplified: the result stays free.
        unions = [shapely.union_all(group) for group in np.split(shadows, np.searchsorted(owner, covered[1:]))]
        covers = shapely.buffer(unions, config.simplify, join_style="mitre", quad_segs=16)
        regions[covered] = shapely.simplify(shapely.difference(regions[covered], covers), config.simplify)
    parts, whole = shapely.get_parts(shapely.make_valid(regions), return_index=True)
    pieces, part = shapely.get_parts(parts, return_index=True)
    return [
        replace(faces[index], polygon=piece)
        for index, piece in zip(whole[part].tolist(), pieces, strict=True)
        if isinstance(piece, Polygon)
    ]


def _without_largest(
    regions: np.ndarray, owner: np.ndarray, shadows: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """What the largest shadows of each region leave of it, and (k,) bool which these are.

    It tells most buried faces, and which of many shadows matter, without a union of all. A region of which less than
    `least` m^2 is left is not looked at further.
    """
    rest = regions.copy()
    order = np.lexsort((-shapely.area(shadows), owner))
    rank = np.empty(len(owner), int)
    rank[order] = np.arange(len(owner)) - np.searchsorted(owner, owner)
    for turn in range(_LARGEST):
        chosen = np.flatnonzero(rank == turn)
        chosen = chosen[shapely.area(rest[owner[chosen]]) >= least]
        rest[owner[chosen]] = shapely.difference(rest[owner[chosen]], shadows[chosen])
    return rest, rank < _LARGEST


def _hold_contacts(faces: list[Face], config: SurfaceConfig) -> np.ndarray:
    """(n,) bool; whether faces are large and wide enough for what they serve."""
    serves = _serves(faces, config)
    area = np.where(serves, [config.foot_area, config.palm_area], np.inf).min(axis=1)
    width = np.where(serves, [config.foot_width, config.palm_width], np.inf).min(axis=1)
    regions = np.array([face.polygon for face in faces], object)
    result: np.ndarray = np.greater_equal(shapely.area(regions), area)
    # A little less than the width, and mitred: a rectangle of exactly that width must not be lost to rounding.
    inner = shapely.buffer(regions[result], 1e-6 - width[result] / 2, join_style="mitre")
    result[result] = ~shapely.is_empty(inner)
    return result
