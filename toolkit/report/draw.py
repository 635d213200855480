"""Drawing helpers that every recording shares: colours, the scene, the robot's bodies, surfaces, contact patches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np
import rerun as rr

from toolkit.contacts.stance import Contact
from toolkit.geometry.pose import Pose, rotation_from_quaternion
from toolkit.report.colors import FOOT_SURFACE, GOAL, LIMB_COLORS, OTHER_SURFACE, PALM_SURFACE
from toolkit.report.meshes import TriangleMesh, geom_rgba, mesh_of_geom, name_of, shown_geoms, static_bodies
from toolkit.world.surface import Surface
from toolkit.world.world import Goal

ROBOT_ALPHA = 140  # of 255, so that the CoM and the forces inside the robot are seen
SCENE_SHADE = 0.8  # darkens the scene a little, so that what is drawn on a bright floor stands out

SURFACE_OFFSET = 0.002  # m along the normal, so that a surface does not flicker with the geom it lies on


@contextmanager
def recording(
    path: Path, application: str, name: str, write: Callable[[Path, bytes], object] = Path.write_bytes
) -> Iterator[rr.RecordingStream]:
    """A stream that knows no time but the one it is given, and whose content is written to `path` at the end.

    The content is kept in memory until then: the library itself waits forever for a disk that is full.

    Raises:
        OSError: the file cannot be written (or what `write` raises then).
    """
    stream = rr.RecordingStream(application)
    stream.set_log_tick_enabled(False)
    stream.set_log_time_enabled(False)
    content = stream.binary_stream()
    try:
        stream.send_recording_name(name.encode("utf-8", "backslashreplace").decode("utf-8"))
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        yield stream
        write(path, content.read() or b"")
    finally:
        stream.disconnect()


def draw_scene(stream: rr.RecordingStream, model: mujoco.MjModel, path: str = "world/scene") -> None:
    """Draw every geom that cannot move, one entity each, where the compiled `model` puts it."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geoms = np.flatnonzero(static_bodies(model)[model.geom_bodyid])
    if not len(geoms):
        return
    bounded = [geom for geom in geoms if model.geom_rbound[geom] > 0]
    extent = 2.0 + max(
        (float(np.abs(data.geom_xpos[g, :2]).max() + model.geom_rbound[g]) for g in bounded), default=4.0
    )
    for geom in shown_geoms(model, geoms):
        mesh = mesh_of_geom(model, geom, plane_extent=extent)
        pose = Pose(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])
        entity = rr.new_entity_path([*path.split("/"), name_of(model, mujoco.mjtObj.mjOBJ_GEOM, geom)])
        shade = geom_rgba(model, geom) * [SCENE_SHADE, SCENE_SHADE, SCENE_SHADE, 1.0]
        stream.log(entity, mesh_archetype(_moved(mesh, pose), shade), static=True)


def draw_bodies(stream: rr.RecordingStream, model: mujoco.MjModel, path: str = "world/robot") -> dict[int, str]:
    """Draw the shape of every body that can move, one mesh each, in the body's frame.

    Returns:
        Body index -> entity path, to which the caller logs `world_from_body` transforms.
    """
    entities = {}
    moving = np.flatnonzero(~static_bodies(model))
    shown = shown_geoms(model, np.flatnonzero(np.isin(model.geom_bodyid, moving)))
    for body in moving:
        parts = [geom for geom in shown if model.geom_bodyid[geom] == body]
        if not parts:
            continue
        meshes = [
            _moved(mesh_of_geom(model, g), Pose(rotation_from_quaternion(model.geom_quat[g]), model.geom_pos[g]))
            for g in parts
        ]
        colors = np.concatenate(
            [np.tile(geom_rgba(model, g), (len(m.vertices), 1)) for g, m in zip(parts, meshes, strict=True)]
        )
        offsets = np.cumsum([0, *[len(mesh.vertices) for mesh in meshes[:-1]]])
        entities[int(body)] = rr.new_entity_path([*path.split("/"), name_of(model, mujoco.mjtObj.mjOBJ_BODY, body)])
        shape = rr.Mesh3D(
            vertex_positions=np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32),
            triangle_indices=np.concatenate([m.triangles + o for m, o in zip(meshes, offsets, strict=True)]),
            vertex_normals=np.concatenate([mesh.normals for mesh in meshes]).astype(np.float32),
            vertex_colors=(colors * 255).astype(np.uint8),
            albedo_factor=[255, 255, 255, ROBOT_ALPHA],
        )
        stream.log(entities[int(body)], shape, static=True)
    return entities


def draw_surfaces(
    stream: rr.RecordingStream, surfaces: Iterable[Surface], path: str = "world/surfaces", *, alpha: int = 50
) -> None:
    """Draw extracted surfaces: outlines with their index, and a translucent fill; blue for feet, amber for palms."""
    groups: dict[str, list[Surface]] = {"foot": [], "palm": [], "other": []}
    for surface in surfaces:
        groups["foot" if surface.serves_foot else "palm" if surface.serves_palm else "other"].append(surface)
    for (name, group), color in zip(groups.items(), (FOOT_SURFACE, PALM_SURFACE, OTHER_SURFACE), strict=True):
        if not group:
            continue
        strips, labels = [], []
        for surface in group:
            for index, ring in enumerate(surface.boundary):
                strips.append(_on_surface(surface, np.vstack([ring, ring[:1]])))
                labels.append(f"{surface.index}: {surface.geom}" if index == 0 else "")
        outline = rr.LineStrips3D(strips, radii=0.003, colors=color, labels=labels, show_labels=False)
        stream.log(f"{path}/{name}/outline", outline, static=True)
        fill = _fill([_on_surface(surface, piece) for surface in group for piece in surface.pieces])
        if len(fill.triangles):
            rgba = np.array([*color, alpha]) / 255
            stream.log(f"{path}/{name}/fill", mesh_archetype(fill, rgba), static=True)


def draw_goal(stream: rr.RecordingStream, goal: Goal, path: str = "world/goal") -> None:
    """Draw the goal as a circle with its label."""
    angle = np.linspace(0, 2 * np.pi, 65)
    ring = (
        np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], -1) * goal.radius + goal.position + [0, 0, 0.01]
    )
    stream.log(path, rr.LineStrips3D([ring], radii=0.008, colors=GOAL, labels=["goal"]), static=True)


def draw_patches(
    stream: rr.RecordingStream,
    path: str,
    contacts: Sequence[Contact],
    half_sizes: np.ndarray,
    *,
    labels: Sequence[str] | None = None,
    alpha: int = 150,
    static: bool = True,
) -> None:
    """Draw contact patches as filled rectangles coloured by limb.

    Args:
        stream: the recording.
        path: entity; the outline goes to `path`, the fill to `path`/fill.
        contacts: any number.
        half_sizes: (4, 2) m, by limb.
        labels: one text per contact.
        alpha: 0..255, of the fill.
        static: whether the patches hold at all times (else at the stream's current time).
    """
    corners = [patch_corners(contact.pose, half_sizes[contact.limb]) for contact in contacts]
    colors = [LIMB_COLORS[contact.limb] for contact in contacts]
    strips = [np.vstack([quad, quad[:1]]) for quad in corners]
    outline = rr.LineStrips3D(strips, radii=0.004, colors=colors, labels=labels, show_labels=labels is not None)
    stream.log(path, outline, static=static)
    fill = _fill(corners)
    shades = np.repeat([[*color, 255] for color in colors], 4, axis=0).reshape(-1, 4).astype(np.uint8)
    mesh = rr.Mesh3D(
        vertex_positions=fill.vertices.astype(np.float32),
        triangle_indices=fill.triangles,
        vertex_normals=fill.normals.astype(np.float32),
        vertex_colors=shades,
        albedo_factor=[255, 255, 255, alpha],
    )
    stream.log(f"{path}/fill", mesh, static=static)


def patch_corners(pose: Pose, half_size: np.ndarray) -> np.ndarray:
    """(4, 3) m corners in the world of a patch with half extents (2,), lifted off the surface a little."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    local = np.concatenate([signs * half_size, np.full((4, 1), 2 * SURFACE_OFFSET)], axis=1)
    return pose @ local


def mesh_archetype(mesh: TriangleMesh, rgba: np.ndarray) -> rr.Mesh3D:
    """A mesh in one colour (4,) of 0..1."""
    return rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        triangle_indices=mesh.triangles,
        vertex_normals=mesh.normals.astype(np.float32),
        albedo_factor=(np.asarray(rgba) * 255).astype(np.uint8),
    )


def _moved(mesh: TriangleMesh, pose: Pose) -> TriangleMesh:
    """The mesh with vertices and normals mapped by `pose`."""
    return TriangleMesh(pose @ mesh.vertices, mesh.triangles, mesh.normals @ pose.rotation.T)


def _on_surface(surface: Surface, points: np.ndarray) -> np.ndarray:
    """(k, 3) world points of (k, 2) points in the surface frame, lifted off it a little."""
    return surface.pose @ np.concatenate([points, np.full((len(points), 1), SURFACE_OFFSET)], axis=1)


def _fill(polygons: list[np.ndarray]) -> TriangleMesh:
    """Fans over convex polygons (k, 3), each with its own vertices and normal."""
    vertices, triangles, normals, first = [np.zeros((0, 3))], [np.zeros((0, 3), int)], [np.zeros((0, 3))], 0
    for polygon in polygons:
        count = len(polygon)
        fan = np.arange(1, count - 1)
        normal = np.cross(polygon[fan] - polygon[0], polygon[fan + 1] - polygon[0]).sum(0)
        vertices.append(polygon)
        normals.append(np.tile(normal / max(float(np.linalg.norm(normal)), 1e-12), (count, 1)))
        triangles.append(np.stack([np.zeros_like(fan), fan, fan + 1], -1) + first)
        first += count
    return TriangleMesh(np.concatenate(vertices), np.concatenate(triangles), np.concatenate(normals))
