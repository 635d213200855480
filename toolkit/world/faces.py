"""Planar faces of the world's geoms, before covered parts are cut away."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
import shapely
from shapely.geometry import Polygon

from toolkit.geometry.pose import Pose
from toolkit.geometry.triangles import height_field_triangles
from toolkit.world.decomposition import FACET_ANGLE, FACET_DISTANCE
from toolkit.world.facets import find_facets, with_overlapping
from toolkit.world.relief import FLAT
from toolkit.world.solids import plane_rectangle
from toolkit.world.source import Source, mesh_of_geom

_OVERLAP_AREA = 0.01  # m^2; smaller ones are no use to a sole
_CURVED = 1e-4  # m; facets that are off their plane by more are overlapped
_CAP_SIDES = 64  # corners of a cylinder's cap; they lie on the circle


@dataclass(frozen=True)
class Face:
    """A flat face of a geom.

    Attributes:
        geom: Label of the authored geom.
        friction: Sliding coefficient.
        frame: World_from_face pose; z is the outward normal.
        polygon: Outline in the frame's xy, m; it may have holes.
        relief: How the geom's surface curves there; see `toolkit.world.relief`.
        own: Which of the scene's solids (`Solids`) the face is on: the geom's number, and the places among its solids.
    """

    geom: str
    friction: float
    frame: Pose
    polygon: Polygon
    relief: np.ndarray = field(default_factory=lambda: FLAT)
    own: tuple[int, np.ndarray] | None = None


def faces_of(source: Source, *, square: tuple[float, ...], least_area: float) -> list[Face]:
    """All flat faces of the colliding geoms of a world, in the order of the geoms.

    Spheres, capsules, ellipsoids and the sides of cylinders and of height fields have none. Infinite planes are cut to
    a square (xmin, ymin, xmax, ymax) in m; faces smaller than `least_area` m^2 are left out.
    """
    model = source.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    faces, done = [], set()
    for index in np.flatnonzero((model.geom_contype | model.geom_conaffinity) != 0).tolist():
        label, friction = source.owner[index], float(model.geom_friction[index, 0])
        pose = Pose(data.geom_xmat[index].reshape(3, 3).copy(), data.geom_xpos[index].copy())
        if label in source.facets:  # the facets of a mesh that consists of parts are added once
            # They are as flat as the parts that collide, however curved the mesh was.
            facets = source.facets[label] if label not in done else []
            found = [Face(label, friction, facet.frame, facet.polygon) for facet in facets]
            done.add(label)
        else:
            found = _local_faces(Face(label, friction, pose, Polygon()), model, data, index, square, least_area)
        faces += [face for face in found if face.polygon.area > least_area]
    return faces


def _local_faces(body: Face, model, data, index: int, square: tuple[float, ...], least_area: float) -> list[Face]:
    """The faces of a geom, which are like `body` but for frame, outline and relief; its frame is the geom's."""
    pose = body.frame

    def face(frame: Pose, polygon: Polygon) -> Face:
        return replace(body, frame=frame, polygon=polygon)

    types, size = mujoco.mjtGeom, model.geom_size[index]
    kind = model.geom_type[index]
    if kind == types.mjGEOM_PLANE:
        rectangle = plane_rectangle(pose, square)
        drawn = np.where(size[:2] > 0, size[:2], np.inf)
        low, high = np.maximum(rectangle.min(axis=0), -drawn), np.minimum(rectangle.max(axis=0), drawn)
        return [face(pose, shapely.box(*low, *high))] if (high > low).all() else []
    if kind == types.mjGEOM_BOX:
        halves = [np.abs(turn[:, :2].T @ size) for turn in _BOX_TURNS]
        shapes = [shapely.box(*-half, *half) for half in halves]
        return [face(pose @ Pose(turn, turn[:, 2] * size), box) for turn, box in zip(_BOX_TURNS, shapes, strict=True)]
    if kind == types.mjGEOM_CYLINDER:
        angle = 2 * np.pi * np.arange(_CAP_SIDES) / _CAP_SIDES
        cap = Polygon(size[0] * np.column_stack([np.cos(angle), np.sin(angle)]))
        down = np.diag([1.0, -1.0, -1.0])
        return [face(pose @ Pose(turn, turn[:, 2] * size[1]), cap) for turn in (np.eye(3), down)]
    import trimesh  # here, since it takes long to import

    if kind == types.mjGEOM_MESH:
        vertices, _ = mesh_of_geom(model, data, index)
        hull = trimesh.convex.convex_hull(vertices)
    elif kind == types.mjGEOM_HFIELD:
        points, triangles = height_field_triangles(model, int(model.geom_dataid[index]))
        hull = trimesh.Trimesh(pose @ points, triangles, process=False)
    else:
        return []
    facets = find_facets(hull, angle=FACET_ANGLE, distance=FACET_DISTANCE, least_area=least_area)
    facets = with_overlapping(hull, facets, flat=_CURVED, least_area=max(_OVERLAP_AREA, least_area))
    whole = np.zeros(1, int)  # a convex mesh is one solid, and a height field one for each triangle
    return [
        replace(
            face(facet.frame, facet.polygon),
            relief=facet.relief,
            own=(index, facet.triangles if kind == types.mjGEOM_HFIELD else whole),
        )
        for facet in facets
    ]


def _box_turns() -> list[np.ndarray]:
    """Rotations box_from_face of the six faces of a box."""
    turns = []
    for axis, sign in ((2, 1), (2, -1), (0, 1), (0, -1), (1, 1), (1, -1)):
        normal = sign * np.eye(3)[axis]
        x = np.eye(3)[0 if axis == 2 else (axis + 1) % 3]
        turns.append(np.stack([x, np.cross(normal, x), normal], axis=1))
    return turns


_BOX_TURNS = _box_turns()
