"""Contact surfaces of a world: merge flush faces, cut covered parts away, and split the rest into convex pieces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from toolkit.geometry.pose import Pose, steepness
from toolkit.world.convex import convex_partition
from toolkit.world.faces import Face, faces_of
from toolkit.world.overlay import cut, overlap, unions, united
from toolkit.world.relief import crest, moved_relief
from toolkit.world.solids import Solids
from toolkit.world.source import Source
from toolkit.world.surface import Surface

_BATCH = 256  # faces that are processed together
_LARGEST = 12  # shadows that are subtracted one after the other
_MANY = 50  # groups of at least this many faces are joined at once, others face by face
_ROUNDING = 1e-6  # m
_SHARP, _NARROW = 20.0, 5.0  # mitres: corners below 6 degrees lose their tips, notches below 23 are closed


@dataclass(frozen=True)
class SurfaceConfig:
    """What counts as a contact surface.

    Attributes:
        foot_angle: Largest angle between up and the normal of a surface for feet, rad.
        palm_angle_min, palm_angle_max: Range of that angle for palms, rad.
        clearance: Room needed above a surface along its normal, m.
        overhang: Room needed above ground below what hangs free, such as a bar to step over, m: a foot has room there,
            and its shin does not.
        flush: Geometry up to this height above a surface does not cover it, m. Faces of equal friction whose
            planes differ by less and that are no further apart than a seam are one surface.
        seam: Width of a gap between flush faces that soles and palms span, m: their planned centres of pressure stay
            further inside than what such a gap may take off their edges.
        flush_angle: Largest angle between the normals of merged faces, rad.
        foot_area, palm_area: Smaller regions are dropped, m^2.
        foot_width, palm_width: Regions in which no circle of this diameter fits are dropped, m.
        bed: Ground up to this far below the highest point under a patch bears, m: on a crest of curvature c as far as
            sqrt(2 bed / c) from there. A patch in a hollow rests on its edges.
        simplify: Covering shapes are widened by this, and corners that stand out less are left out, m.
        plane_margin: Infinite planes end this far beyond start and goal, m.
    """

    foot_angle: float = np.radians(45.0)
    palm_angle_min: float = np.radians(60.0)
    palm_angle_max: float = np.radians(120.0)
    clearance: float = 0.15
    overhang: float = 0.3
    flush: float = 1e-3
    seam: float = 0.015
    flush_angle: float = np.radians(0.5)
    foot_area: float = 0.01
    palm_area: float = 3e-3
    foot_width: float = 0.06
    palm_width: float = 0.05
    bed: float = 4e-4
    simplify: float = 1e-3
    plane_margin: float = 3.0


def extract_surfaces(
    source: Source,
    solids: Solids,
    square: tuple[float, ...],
    config: SurfaceConfig,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Surface, ...]:
    """Surfaces of a world that serve feet or palms, in the order of the geoms.

    Args:
        source: The world's scene.
        solids: The colliding geometry of the scene (`solids_of`).
        square: Infinite planes are cut to this (xmin, ymin, xmax, ymax), m.
        config: What counts as a surface.
        progress: Called with the share that is done, in [0, 1].
    """
    least = min(config.foot_area, config.palm_area) / 3  # several flush faces may be large enough together
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
                relief=moved_relief(face.relief, centre),
                bearing=float(np.sqrt(2.0 * config.bed / curved)) if (curved := crest(face.relief)) > 0.0 else np.inf,
            )
        )
    return tuple(surfaces)


def _serves(faces: list[Face], config: SurfaceConfig) -> np.ndarray:
    """Whether faces serve feet and palms, by the angle of their normals, (n, 2) bool."""
    normals = np.array([face.frame.normal for face in faces]).reshape(-1, 3)
    angle = np.arccos(np.clip(normals[:, 2], -1.0, 1.0))
    slack = 1e-6  # rad; a wall of exactly the limit is accepted
    palm = (angle >= config.palm_angle_min - slack) & (angle <= config.palm_angle_max + slack)
    return np.column_stack([angle <= config.foot_angle + slack, palm])


def _merged(faces: list[Face], config: SurfaceConfig) -> list[Face]:
    """The faces, with flush faces of equal friction joined: of different geoms, and of one mesh that consists of parts.

    Every face is compared with the largest face of its group, so that a chain of slightly raised tiles does not become
    one surface.
    """
    if len(faces) < 2:
        return faces
    normals = np.array([face.frame.normal for face in faces])
    origins = np.array([face.frame.position for face in faces])
    geoms = np.unique([face.geom for face in faces], return_inverse=True)[1]
    whole = np.array([face.own is not None for face in faces])  # of those, flush faces of one geom are one already
    outlines = [face.frame @ _with_zeros(shapely.get_coordinates(face.polygon)) for face in faces]
    first, second = _near_pairs(faces, normals, outlines, config)
    size = (len(faces), len(faces))
    from scipy.sparse import coo_array  # here, since it takes long to import

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
            return shapely.dwithin(shapes[here], shapes[other], config.seam + _ROUNDING)

        members, waiting = [seed], [seed]
        while waiting:
            here = waiting.pop(0)
            around = graph.indices[graph.indptr[here] : graph.indptr[here + 1]]
            for other in [int(other) for other in np.sort(around) if not used[other]]:
                if (geoms[other] != geoms[seed] or len(members) > 1 or not whole[other]) and joins(here, other):
                    used[other] = True
                    members.append(other)
                    waiting.append(other)
        if len(members) == 1:
            result[seed] = faces[seed]
            continue
        parts, others = [shapes[seed]], [shapes[member] for member in members[1:]]
        for batch in [[other] for other in others] if len(others) < _MANY else [others]:
            parts = _sealed([*parts, *batch], config.seam)
        inside = shapely.point_on_surface([shapes[member] for member in members])
        for part in parts:
            own = [members[index] for index in np.flatnonzero(shapely.dwithin(inside, part, config.flush)).tolist()]
            names = "+".join(dict.fromkeys(faces[member].geom for member in own))
            if own:  # closing seams may leave slivers
                flush = Face(names, faces[seed].friction, frame, part)
                result[min(own)] = flush if len(own) > 1 else faces[own[0]]
    return [result[first] for first in sorted(result)]


def _near_pairs(
    faces: list[Face], normals: np.ndarray, outlines: list[np.ndarray], config: SurfaceConfig
) -> np.ndarray:
    """Ordered pairs (2, k) of faces with equal friction and touching boxes that may lie in one plane."""
    low = np.array([points.min(axis=0) for points in outlines]) - config.seam
    high = np.array([points.max(axis=0) for points in outlines]) + config.seam
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


def _sealed(shapes: list[Polygon], gap: float) -> list[Polygon]:
    """Union of shapes in which seams up to `gap` m wide are closed; parts that touch in corners alone stay apart."""
    union, wide = united(shapes), gap / 2 + _ROUNDING
    closed = shapely.remove_repeated_points(union, _ROUNDING).buffer(wide, join_style="mitre", mitre_limit=_SHARP)
    closed = closed.buffer(-wide, join_style="mitre", mitre_limit=_NARROW)
    if isinstance(union, Polygon) and not union.interiors and closed.area - union.area < _ROUNDING * gap:
        return [union]
    return shapely.get_parts(closed).tolist()


def _open_regions(faces: list[Face], solids: Solids, config: SurfaceConfig) -> list[Face]:
    """Connected regions of faces that nothing covers; they may have holes."""
    regions = shapely.simplify([face.polygon for face in faces], 1e-6)
    shapely.prepare(regions)
    owner, shadows = _shadows(faces, shapely.bounds(regions), solids, config)
    covers = shapely.intersects(regions[owner], shadows)
    owner, shadows = owner[covers], shadows[covers]
    rest, large = _without_largest(regions, owner, shadows, least := min(config.foot_area, config.palm_area) / 2)
    lost = shapely.area(rest) < least
    regions[lost] = Polygon()
    shapely.prepare(rest)
    covers = ~lost[owner] & (large | shapely.dwithin(rest[owner], shadows, 10 * config.simplify))
    covers[covers] = overlap(regions[owner[covers]], shadows[covers])
    owner, shadows = owner[covers], shadows[covers]
    covered = np.unique(owner)
    if len(covered):
        # The covers are widened by the distance that simplifying may move the outline, so that the result stays free.
        covers = shapely.buffer(unions(shadows, owner), config.simplify, join_style="mitre", quad_segs=16)
        regions[covered] = shapely.simplify(cut(regions[covered], covers), config.simplify)
    parts, whole = shapely.get_parts(shapely.make_valid(regions), return_index=True)
    pieces, part = shapely.get_parts(parts, return_index=True)
    return [
        replace(faces[index], polygon=piece)
        for index, piece in zip(whole[part].tolist(), pieces, strict=True)
        if isinstance(piece, Polygon)
    ]


def _shadows(
    faces: list[Face], bounds: np.ndarray, solids: Solids, config: SurfaceConfig
) -> tuple[np.ndarray, np.ndarray]:
    """What covers faces with bounds (n, 4) m: ascending indices of faces (k,) int, and polygons (k,) in their xy."""
    frames, own = [face.frame for face in faces], [face.own for face in faces]
    owner, shadows = solids.shadows(frames, bounds, config.flush, config.clearance, own)
    feet = np.flatnonzero(_serves(faces, config)[:, 0])
    if len(feet) == 0:
        return owner, shadows
    grounds = [frames[index] for index in feet], bounds[feet]
    over, hanging = solids.shadows(*grounds, config.clearance, config.overhang, [own[index] for index in feet])
    over = feet[over]
    for index in np.unique(over[np.isin(over, owner)]).tolist():  # what stands on the ground covers no more than there
        lean = steepness(faces[index].frame.normal[2])
        beside = (config.overhang - config.clearance) * lean + 10 * config.simplify
        standing = shapely.buffer(united(shadows[owner == index]), beside)
        hanging[over == index] = shapely.difference(hanging[over == index], standing)
    left = shapely.area(hanging) > 0.0
    owner, shadows = np.concatenate([owner, over[left]]), np.concatenate([shadows, hanging[left]])
    order = np.argsort(owner, kind="stable")
    return owner[order], shadows[order]


def _without_largest(
    regions: np.ndarray, owner: np.ndarray, shadows: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """The rest of each region without its largest shadows, and which shadows these are, (k,) bool.

    This finds most buried faces, and the shadows that matter, without a union of all shadows. A region is finished
    once less than `least` m^2 of it is left.
    """
    rest = regions.copy()
    order = np.lexsort((-shapely.area(shadows), owner))
    rank = np.empty(len(owner), int)
    rank[order] = np.arange(len(owner)) - np.searchsorted(owner, owner)
    for turn in range(_LARGEST):
        chosen = np.flatnonzero(rank == turn)
        chosen = chosen[shapely.area(rest[owner[chosen]]) >= least]
        rest[owner[chosen]] = cut(rest[owner[chosen]], shadows[chosen])
    return rest, rank < _LARGEST


def _hold_contacts(faces: list[Face], config: SurfaceConfig) -> np.ndarray:
    """Whether faces are large and wide enough for the limbs that they serve, (n,) bool."""
    serves = _serves(faces, config)
    area = np.where(serves, [config.foot_area, config.palm_area], np.inf).min(axis=1)
    width = np.where(serves, [config.foot_width, config.palm_width], np.inf).min(axis=1)
    regions = np.array([face.polygon for face in faces], object)
    result: np.ndarray = np.greater_equal(shapely.area(regions), area)
    # The width is slightly reduced and mitred, so that rounding does not drop a rectangle of exactly that width.
    inner = shapely.buffer(regions[result], 1e-6 - width[result] / 2, join_style="mitre")
    result[result] = ~shapely.is_empty(inner)
    return result
