"""Drawings that every recording shares: the scene, the robot's bodies, surfaces, the goal, contact patches."""

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

ROBOT_ALPHA = 140  # of 255, so that the CoM and the forces inside the robot are visible
SCENE_SHADE = 0.8  # darkens the scene a little, so that drawings on a bright floor are clear
SURFACE_OFFSET = 0.002  # m along the normal, so that a surface does not flicker with the geom it lies on
PATCH_ALPHA = 150  # of 255, for the fill of contact patches


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


def draw_scene(
    stream: rr.RecordingStream, model: mujoco.MjModel, root: str = "world", floor: np.ndarray | None = None
) -> None:
    """Draw every geom that cannot move, one entity each below `root`, where the compiled `model` has it.

    Where given, infinite planes are cut to the convex polygon `floor` (k, 2) m, counterclockwise from above.
    """
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
        if floor is not None and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and pose.normal[2] > 0.1:
            if not model.geom_size[geom, :2].any():
                mesh, pose = _fill([_over(pose, floor)]), Pose.identity()
        entity = rr.new_entity_path([*root.split("/"), "scene", name_of(model, mujoco.mjtObj.mjOBJ_GEOM, geom)])
        shade = geom_rgba(model, geom) * [SCENE_SHADE, SCENE_SHADE, SCENE_SHADE, 1.0]
        stream.log(entity, _mesh_archetype(_moved(mesh, pose), (shade * 255).astype(np.uint8)), static=True)


def draw_bodies(stream: rr.RecordingStream, model: mujoco.MjModel, root: str = "world") -> dict[int, str]:
    """Draw the shape of every body that can move, one mesh each below `root`, in the body's frame.

    Returns the entity path of each body index; the caller logs `world_from_body` transforms to it.
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
        entities[int(body)] = rr.new_entity_path(
            [*root.split("/"), "robot", name_of(model, mujoco.mjtObj.mjOBJ_BODY, body)]
        )
        whole = TriangleMesh(
            np.concatenate([mesh.vertices for mesh in meshes]),
            np.concatenate([m.triangles + o for m, o in zip(meshes, offsets, strict=True)]),
            np.concatenate([mesh.normals for mesh in meshes]),
        )
        shape = _mesh_archetype(whole, [255, 255, 255, ROBOT_ALPHA], (colors * 255).astype(np.uint8))
        stream.log(entities[int(body)], shape, static=True)
    return entities


def draw_surfaces(stream: rr.RecordingStream, surfaces: Iterable[Surface], alpha: int = 50) -> None:
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
        stream.log(f"world/surfaces/{name}/outline", outline, static=True)
        fill = _fill([_on_surface(surface, piece) for surface in group for piece in surface.pieces])
        if len(fill.triangles):
            stream.log(f"world/surfaces/{name}/fill", _mesh_archetype(fill, [*color, alpha]), static=True)


def draw_goal(stream: rr.RecordingStream, goal: Goal, root: str = "world") -> None:
    """Draw the goal below `root` as a circle with its label."""
    angle = np.linspace(0, 2 * np.pi, 65)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], -1)
    ring = circle * goal.radius + goal.position + [0, 0, 0.01]
    stream.log(f"{root}/goal", rr.LineStrips3D([ring], radii=0.008, colors=GOAL, labels=["goal"]), static=True)


def draw_patches(
    stream: rr.RecordingStream,
    path: str,
    contacts: Sequence[Contact],
    half_sizes: np.ndarray,
    labels: Sequence[str],
) -> None:
    """Draw contact patches as labelled, filled rectangles coloured by limb, at all times.

    The outline goes to the entity `path`, the fill to `path`/fill. Half sizes are (4, 2) m, by limb.
    """
    colors = [LIMB_COLORS[contact.limb] for contact in contacts]
    strips = patch_outlines(contacts, half_sizes)
    outline = rr.LineStrips3D(strips, radii=0.004, colors=colors, labels=labels, show_labels=True)
    stream.log(path, outline, static=True)
    shades = np.repeat([[*color, 255] for color in colors], 4, axis=0).reshape(-1, 4).astype(np.uint8)
    fill = _fill([strip[:4] for strip in strips])
    stream.log(f"{path}/fill", _mesh_archetype(fill, [255, 255, 255, PATCH_ALPHA], shades), static=True)


def patch_outlines(contacts: Sequence[Contact], half_sizes: np.ndarray) -> list[np.ndarray]:
    """Closed outline (5, 3) m of each contact in the world."""
    return [patch_outline(contact.pose, half_sizes[contact.limb]) for contact in contacts]


def patch_outline(pose: Pose, half_size: np.ndarray) -> np.ndarray:
    """(5, 3) m; closed outline in the world of a patch with half extents (2,) m, lifted off the surface a little."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]], float)
    return pose @ np.concatenate([signs * half_size, np.full((5, 1), 2 * SURFACE_OFFSET)], axis=1)


def _mesh_archetype(mesh: TriangleMesh, rgba: list[int] | np.ndarray, colors: np.ndarray | None = None) -> rr.Mesh3D:
    """A mesh in one colour (4,), times a colour (n, 4) per vertex where given, all in 0..255."""
    return rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        triangle_indices=mesh.triangles,
        vertex_normals=mesh.normals.astype(np.float32),
        vertex_colors=colors,
        albedo_factor=rgba,
    )


def _moved(mesh: TriangleMesh, pose: Pose) -> TriangleMesh:
    """The mesh with vertices and normals mapped by `pose`."""
    return TriangleMesh(pose @ mesh.vertices, mesh.triangles, mesh.normals @ pose.rotation.T)


def _on_surface(surface: Surface, points: np.ndarray) -> np.ndarray:
    """(k, 3) world points of (k, 2) points in the surface frame, lifted off the surface a little."""
    return surface.pose @ np.concatenate([points, np.full((len(points), 1), SURFACE_OFFSET)], axis=1)


def _over(plane: Pose, polygon: np.ndarray) -> np.ndarray:
    """(k, 3) points of a plane, whose normal is z, at (k, 2) points of the world's xy."""
    off = (polygon - plane.position[:2]) @ plane.normal[:2]
    return np.column_stack([polygon, plane.position[2] - off / plane.normal[2]])


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
