"""Triangle meshes of MuJoCo geoms, for drawing only."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from toolkit.geometry.triangles import height_field_triangles, mesh_triangles, mesh_vertices

SHOWN_GROUPS = range(3)  # MuJoCo's viewer shows geom groups 0-2; collision-only geoms are usually in group 3
FLAT_SHADED = 2000  # triangles; a finer mesh is shaded smoothly


@dataclass(frozen=True)
class TriangleMesh:
    """A triangle mesh with vertex normals.

    Attributes:
        vertices: (n, 3) float, m.
        triangles: (m, 3) int, counterclockwise seen from outside.
        normals: (n, 3) float unit outward normals.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray


def shown_geoms(model: mujoco.MjModel, geoms: np.ndarray) -> np.ndarray:
    """The `geoms` (k,) int in visible groups that are not fully transparent; all of them where there is none."""
    geoms = np.asarray(geoms, int)
    shown = np.isin(model.geom_group[geoms], list(SHOWN_GROUPS))
    shown &= np.array([geom_rgba(model, geom)[3] > 0.01 for geom in geoms], bool)
    return geoms[shown] if shown.any() else geoms


def static_bodies(model: mujoco.MjModel) -> np.ndarray:
    """(nbody,) bool; bodies that cannot move, with the world body."""
    return model.body_weldid == 0


def geom_rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """(4,) float in 0..1; colour of a geom. Where it is the default, it is the material's times its texture's mean."""
    material = model.geom_matid[geom]
    if material < 0 or not np.allclose(model.geom_rgba[geom], [0.5, 0.5, 0.5, 1.0]):
        return np.array(model.geom_rgba[geom], float)
    rgba = np.array(model.mat_rgba[material], float)
    texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if texture >= 0:
        channels, first = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
        count = int(model.tex_height[texture]) * int(model.tex_width[texture]) * channels
        mean = model.tex_data[first : first + count].reshape(-1, channels).mean(0) / 255
        rgba[:3] *= mean[:3] if channels >= 3 else mean[0]
    return rgba


def name_of(model: mujoco.MjModel, kind: mujoco.mjtObj, index: int) -> str:
    """Name of an object, or `type#id` where it has none."""
    return mujoco.mj_id2name(model, kind, index) or f"{kind.name.removeprefix('mjOBJ_').lower()}#{index}"


def mesh_of_geom(model: mujoco.MjModel, geom: int, *, plane_extent: float = 10.0) -> TriangleMesh:
    """Mesh of a geom in the geom's own frame; empty for a kind of geom without a shape.

    A plane that is infinite is drawn with half size `plane_extent` in m.
    """
    kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        x, y = (half if half > 0 else plane_extent for half in size[:2])
        corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
        return TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.tile([0.0, 0, 1], (4, 1)))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return _box(size)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _compiled_mesh(model, model.geom_dataid[geom])
    if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
        return _flat_shaded(*height_field_triangles(model, model.geom_dataid[geom]))
    angles = np.linspace(-np.pi / 2, np.pi / 2, 13)
    arc, rise = np.cos(angles), np.sin(angles)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return _revolve(arc * size[0], rise * size[0], arc, rise)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        ball = _revolve(arc, rise, arc, rise)
        normals = ball.normals / size
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return TriangleMesh(ball.vertices * size, ball.triangles, normals)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        shift = size[1] * np.sign(rise)
        middle = len(angles) // 2
        radius = np.insert(arc, middle, 1.0) * size[0]
        shift[middle] = size[1]
        height = np.insert(rise * size[0] + shift, middle, -size[1])
        return _revolve(radius, height, np.insert(arc, middle, 1.0), np.insert(rise, middle, 0.0))
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        radius, half = size[0], size[1]
        profile = np.array([[0, -half, 0, -1], [radius, -half, 0, -1], [radius, -half, 1, 0]])
        profile = np.concatenate([profile, [[radius, half, 1, 0], [radius, half, 0, 1], [0, half, 0, 1]]])
        return _revolve(*profile.T)
    return TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros((0, 3)))


def _box(half: np.ndarray) -> TriangleMesh:
    """Box with four vertices per face, so that its edges look sharp."""
    vertices, normals = [], []
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = np.empty((4, 3))
            face[:, axis] = sign
            face[:, [(axis + 1) % 3, (axis + 2) % 3]] = square[:: int(sign)]
            vertices.append(face * half)
            normals.append(np.tile(sign * np.eye(3)[axis], (4, 1)))
    triangles = (np.arange(6)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return TriangleMesh(np.concatenate(vertices), triangles, np.concatenate(normals))


def _revolve(
    radius: np.ndarray, height: np.ndarray, normal_r: np.ndarray, normal_z: np.ndarray, sides: int = 24
) -> TriangleMesh:
    """Surface of revolution about z of a profile (k,) and its normals, given from bottom to top."""
    angle = np.arange(sides) * 2 * np.pi / sides
    c, s = np.cos(angle), np.sin(angle)

    def swept(r: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.stack([np.outer(r, c), np.outer(r, s), np.repeat(z[:, None], sides, 1)], -1).reshape(-1, 3)

    ring, column = np.meshgrid(np.arange(len(radius) - 1) * sides, np.arange(sides), indexing="ij")
    after = (column + 1) % sides
    a, b, d, e = ring + column, ring + after, ring + sides + after, ring + sides + column
    triangles = np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, e], -1)]).reshape(-1, 3)
    return TriangleMesh(swept(radius, height), triangles, swept(normal_r, normal_z))


def _flat_shaded(vertices: np.ndarray, triangles: np.ndarray) -> TriangleMesh:
    """A mesh whose triangles own their vertices, each with the triangle's normal; degenerate triangles are dropped."""
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    corners, normal = corners[length > 0], normal[length > 0] / length[length > 0, None]
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    return TriangleMesh(corners.reshape(-1, 3), triangles, np.repeat(normal, 3, axis=0))


def _smooth_shaded(vertices: np.ndarray, triangles: np.ndarray) -> TriangleMesh:
    """A mesh whose triangles share vertices, with the mean of their normals: a sixth of the size of a flat one."""
    corners = vertices[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normal, triangles[:, corner], face)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return TriangleMesh(vertices, triangles, np.where(length > 0, normal / np.maximum(length, 1e-300), [0.0, 0.0, 1.0]))


def _compiled_mesh(model: mujoco.MjModel, mesh: int) -> TriangleMesh:
    """A mesh asset as MuJoCo compiled it."""
    vertices, triangles = mesh_vertices(model, mesh).astype(float), mesh_triangles(model, mesh).astype(int)
    return _flat_shaded(vertices, triangles) if len(triangles) <= FLAT_SHADED else _smooth_shaded(vertices, triangles)
