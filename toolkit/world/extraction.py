"""Contact surfaces of a world: merge flush faces, cut away what is covered, split the rest into convex pieces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from toolkit.geometry.pose import Pose
from toolkit.world.convex import convex_partition
from toolkit.world.faces import Face, faces_of
from toolkit.world.solids import Solids
from toolkit.world.source import Source
from toolkit.world.surface import Surface


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
    source: Source, solids: Solids, square: tuple[float, ...], config: SurfaceConfig
) -> tuple[Surface, ...]:
    """Contact surfaces of a world.

    Args:
        source: the world's scene.
        solids: its colliding geometry (`solids_of`).
        square: (xmin, ymin, xmax, ymax), m; infinite planes are cut to it.
        config: what counts as a surface.

    Returns:
        Surfaces that serve feet or palms, in the order of the geoms.
    """
    least = min(config.foot_area, config.palm_area) / 3  # flush faces of several geoms may be large enough together
    faces = faces_of(source, square=square, least_area=least)
    faces = [face for face in faces if any(_serves(face.frame.normal, config))]
    surfaces: list[Surface] = []
    for face in _merged(faces, config):
        foot, palm = _serves(face.frame.normal, config)
        for region in _open_regions(face, solids, config):
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


def _serves(normal: np.ndarray, config: SurfaceConfig) -> tuple[bool, bool]:
    """Whether a surface with this normal serves feet, palms."""
    angle = np.arccos(np.clip(normal[2], -1.0, 1.0))
    slack = 1e-6  # a wall of exactly the limit counts
    foot = angle <= config.foot_angle + slack
    palm = config.palm_angle_min - slack <= angle <= config.palm_angle_max + slack
    return bool(foot), bool(palm)


def _merged(faces: list[Face], config: SurfaceConfig) -> list[Face]:
    """Faces with the flush ones of different geoms and equal friction joined.

    As with facets, what is joined is measured against the largest face of the group: a chain of slightly raised
    tiles does not become one surface.
    """
    if len({face.geom for face in faces}) < 2:
        return faces
    normals = np.array([face.frame.normal for face in faces])
    friction = np.array([face.friction for face in faces])
    origins = np.array([face.frame.position for face in faces])
    geoms = np.unique([face.geom for face in faces], return_inverse=True)[1]
    outlines = [face.frame @ _with_zeros(shapely.get_coordinates(face.polygon)) for face in faces]
    low = np.array([points.min(axis=0) for points in outlines]) - config.flush
    high = np.array([points.max(axis=0) for points in outlines]) + config.flush
    used = np.zeros(len(faces), bool)
    result: dict[int, Face] = {}
    for seed in np.argsort([-face.polygon.area for face in faces], kind="stable").tolist():
        if used[seed]:
            continue
        used[seed] = True
        alike = ~used & (friction == friction[seed]) & (normals @ normals[seed] > np.cos(config.flush_angle))
        alike &= np.abs((origins - origins[seed]) @ normals[seed]) < 2 * config.flush
        frame, shape, names = faces[seed].frame, faces[seed].polygon, [faces[seed].geom]
        members, grown = [seed], True
        while grown:
            grown = False
            touching = alike & ~used & (geoms != geoms[seed] if len(members) == 1 else True)
            touching &= (low <= high[members].max(axis=0)).all(axis=1) & (high >= low[members].min(axis=0)).all(axis=1)
            for other in np.flatnonzero(touching).tolist():
                local = frame.inverse() @ outlines[other]
                if np.abs(local[:, 2]).max() > config.flush:
                    continue
                moved = _in_frame(faces[other], frame)
                if shape.distance(moved) > config.flush:
                    continue
                shape = _sealed([shape, moved], config.flush)
                used[other] = grown = True
                members.append(other)
                names.append(faces[other].geom)
        first = min(members)
        result[first] = Face("+".join(dict.fromkeys(names)), faces[seed].friction, frame, shape)
    return [result[first] for first in sorted(result)]


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


def _open_regions(face: Face, solids: Solids, config: SurfaceConfig) -> Iterator[Polygon]:
    """Connected regions of a face that nothing covers, large enough for a contact; holes are kept."""
    if not _holds_contact(face.polygon, face.frame.normal, config):
        return
    region = face.polygon.simplify(1e-6)
    shadow = solids.shadow(face.frame, region.bounds, config.flush, config.clearance)
    if len(shadow):
        shapely.prepare(region)
        shadow = shadow[shapely.intersects(region, shadow)]
        shadow = shadow[shapely.area(shapely.intersection(region, shadow)) > 1e-7]
    if len(shadow):
        # Widened by what the outline may move when it is simplified: the result stays free.
        cover = shapely.union_all(shadow).buffer(config.simplify, join_style="mitre")
        region = shapely.difference(region, cover).simplify(config.simplify)
    for part in shapely.get_parts(shapely.make_valid(region)):
        for piece in shapely.get_parts(part):
            if isinstance(piece, Polygon) and _holds_contact(piece, face.frame.normal, config):
                yield orient(shapely.remove_repeated_points(piece, 1e-6))


def _holds_contact(region: Polygon, normal: np.ndarray, config: SurfaceConfig) -> bool:
    """Whether a region is large and wide enough for what it serves."""
    foot, palm = _serves(normal, config)
    area = min(config.foot_area if foot else np.inf, config.palm_area if palm else np.inf)
    width = min(config.foot_width if foot else np.inf, config.palm_width if palm else np.inf)
    if region.area < area:
        return False
    # A little less than the width, and mitred: a rectangle of exactly that width must not be lost to rounding.
    return not region.buffer(1e-6 - width / 2, join_style="mitre").is_empty
