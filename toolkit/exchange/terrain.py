"""The world that a run collided with, as an MJCF file of its own and as one mesh."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import trimesh

from toolkit.geometry.pose import Pose
from toolkit.geometry.triangles import field_heights, mesh_triangles, mesh_vertices
from toolkit.report.meshes import mesh_of_geom, static_bodies
from toolkit.world.scene import WORLD_PREFIX

_KINDS = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_HFIELD: "hfield",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}
_SIZES = {"plane": 3, "sphere": 1, "capsule": 2, "ellipsoid": 3, "cylinder": 2, "box": 3}
_AROUND = 5.0  # m; how far an infinite plane reaches beyond the motion in the mesh


def terrain_geoms(scene: mujoco.MjModel) -> np.ndarray:
    """(k,) int; geoms of the world in a scene that the robot can collide with."""
    static = static_bodies(scene)[scene.geom_bodyid]
    collides = (scene.geom_contype | scene.geom_conaffinity) != 0
    named = [scene.geom(g).name.startswith(WORLD_PREFIX) for g in range(scene.ngeom)]
    return np.flatnonzero(static & collides & named)


def terrain_name(scene: mujoco.MjModel, geom: int) -> str:
    """Name of a geom of the world as the world's own file has it."""
    return scene.geom(geom).name.removeprefix(WORLD_PREFIX)


def terrain_mjcf(scene: mujoco.MjModel, name: str) -> str:
    """MJCF text of what collides in a scene's world, with its friction, start and goal, and no further files.

    Meshes that are not convex are there as the convex parts that ran. Palms that start in contact have no sites.
    """
    data = _still(scene)
    root = ElementTree.Element("mujoco", model="".join(letter for letter in name if letter.isprintable()))
    ElementTree.SubElement(root, "compiler", angle="radian")
    assets, world = ElementTree.SubElement(root, "asset"), ElementTree.SubElement(root, "worldbody")
    ElementTree.SubElement(world, "light", pos="0 0 10", directional="true")
    for geom in terrain_geoms(scene).tolist():
        kind, label = _KINDS[mujoco.mjtGeom(scene.geom_type[geom])], terrain_name(scene, geom)
        entry = {"name": label, "type": kind, "pos": _text(data.geom_xpos[geom])}
        entry["quat"] = _text(Pose(data.geom_xmat[geom].reshape(3, 3), np.zeros(3)).quaternion_wxyz)
        entry["friction"], entry["rgba"] = _text(scene.geom_friction[geom]), _text(scene.geom_rgba[geom])
        if kind in _SIZES:
            entry["size"] = _text(scene.geom_size[geom, : _SIZES[kind]])
        else:
            entry[kind] = label
            ElementTree.SubElement(assets, kind, {"name": label} | _asset(scene, kind, int(scene.geom_dataid[geom])))
        ElementTree.SubElement(world, "geom", entry)
    for site in range(scene.nsite):
        label = scene.site(site).name
        if label in (f"{WORLD_PREFIX}start", f"{WORLD_PREFIX}goal"):
            ElementTree.SubElement(world, "site", _site(scene, data, site))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def terrain_mesh(scene: mujoco.MjModel, path: np.ndarray) -> trimesh.Trimesh:
    """One mesh of what collides in a scene's world, z up, in m.

    Args:
        scene: The scene.
        path: (T, 3) m; where the robot goes. Infinite planes reach beyond it by 5 m and more.
    """
    data = _still(scene)
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    for geom in terrain_geoms(scene).tolist():
        pose = Pose(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom].copy())
        extent = float(np.abs(path - pose.position).max()) + _AROUND
        shape = mesh_of_geom(scene, geom, plane_extent=extent)
        parts.append((pose @ shape.vertices, shape.triangles))
    corners = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    triangles = [faces + first for first, (_, faces) in zip(corners[:-1], parts, strict=True)]
    return trimesh.Trimesh(np.concatenate([vertices for vertices, _ in parts]), np.concatenate(triangles))


def terrain_friction(scene: mujoco.MjModel) -> dict[str, float]:
    """Sliding friction of each geom of the world by its name."""
    return {terrain_name(scene, geom): float(scene.geom_friction[geom, 0]) for geom in terrain_geoms(scene).tolist()}


def _still(scene: mujoco.MjModel) -> mujoco.MjData:
    """Poses of everything; those of the world are the same in every state."""
    data = mujoco.MjData(scene)
    mujoco.mj_kinematics(scene, data)
    return data


def _text(values: np.ndarray) -> str:
    """Numbers separated by blanks, such that reading them gives the same ones."""
    array = np.asarray(values)
    return " ".join(str(value) for value in (array.ravel() + array.dtype.type(0)).tolist())


def _asset(scene: mujoco.MjModel, kind: str, index: int) -> dict[str, str]:
    """Attributes of a mesh or a height field as text."""
    if kind == "mesh":
        return {"vertex": _text(mesh_vertices(scene, index)), "face": _text(mesh_triangles(scene, index))}
    heights = field_heights(scene, index)
    # MJCF lists the rows of a height field from the top of the map, the compiled model from its bottom.
    return {
        "nrow": str(heights.shape[0]),
        "ncol": str(heights.shape[1]),
        "size": _text(scene.hfield_size[index]),
        "elevation": _text(heights[::-1]),
    }


def _site(scene: mujoco.MjModel, data: mujoco.MjData, site: int) -> dict[str, str]:
    """Attributes of the start or the goal."""
    kind = mujoco.mjtGeom(scene.site_type[site]).name.removeprefix("mjGEOM_").lower()
    rotation = data.site_xmat[site].reshape(3, 3)
    return {
        "name": scene.site(site).name.removeprefix(WORLD_PREFIX),
        "type": kind,
        "pos": _text(data.site_xpos[site]),
        "quat": _text(Pose(rotation, np.zeros(3)).quaternion_wxyz),
        "size": _text(scene.site_size[site]),
    }
