"""Read and check a world's MJCF, and make every mesh collide as it looks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from toolkit.errors import InputError, WorldError
from toolkit.geometry.triangles import mesh_triangles, mesh_vertices
from toolkit.mjcf import SIZES, compile_spec, one_line, read_spec
from toolkit.world.decomposition import Decomposition, decompose_mesh
from toolkit.world.facets import Facet
from toolkit.world.mesh_field import MeshField, field_of, is_splintered
from toolkit.world.options import check_options

VISUAL_GROUP = 2  # geoms that do not collide
PART_GROUP = 3  # convex parts of a mesh that is drawn as a whole; hidden by default in MuJoCo's viewer
RAY_GROUPS = np.array([1, 1, 0, 1, 1, 1], np.uint8)  # `geomgroup` of mj_ray that sees exactly what collides

_ALL_BITS = 0x7FFFFFFF
_LEAST = 1e-5  # m; smaller half sizes of a geom are refused, because its sides cannot be computed


@dataclass(frozen=True)
class Source:
    """A world's scene, ready to be compiled or combined with a robot.

    Attributes:
        spec: The scene. Colliding geoms have all contact bits set, the others none; every geom has a name.
        model: The compiled `spec`.
        facets: Flat facets in the world frame, by label, of the mesh geoms that were replaced by convex parts.
        owner: Labels (ngeom,) of the authored geoms that the geoms of the model stand for. A label is the geom's name,
            or `type#id` if it has none, and is unique.
    """

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    facets: dict[str, list[Facet]]
    owner: tuple[str, ...]


def read_source(path: Path, mjcf: str | None = None, progress: Callable[[float], None] = lambda share: None) -> Source:
    """Read and check a world's MJCF file, or its text if it exists in memory only.

    MuJoCo collides a mesh geom as its convex hull. A mesh that is not convex is therefore replaced by convex parts,
    one or more per flat facet, or, where it is curved terrain, by a height field, and kept for drawing only. So
    drawing, rays and contacts agree. `progress` is called with the share of the meshes that is done, in [0, 1].

    Raises:
        WorldError: The file is missing or broken, or has moving parts, NaN, unusable friction or unsupported geoms.
    """
    spec, model = _compiled(path, mjcf)
    _check_static(path, spec, model)
    check_options(path, spec.option)
    colliding = (model.geom_contype | model.geom_conaffinity) != 0
    names = {model.geom(i).name for i in range(model.ngeom)} | {mesh.name for mesh in spec.meshes}
    labels = [model.geom(i).name or _unused(_kind(model, i), names) for i in range(model.ngeom)]
    _check_geoms(path, model, colliding, labels)

    parts, fields = _decompositions(path, model, colliding, labels, progress)
    for geom in list(spec.geoms):
        index = geom.id
        geom.name = labels[index]
        _normalise(geom, model, index, bool(colliding[index]) and index not in parts and index not in fields)
    owner = {}
    for index, decomposition in parts.items():
        owner.update(_add_parts(spec, model, index, labels[index], decomposition, names))
    for index, field in fields.items():
        owner.update(_add_field(spec, model, index, labels[index], field, names))
    try:
        final = compile_spec(spec)
    except (ValueError, InputError) as error:
        raise WorldError(f"{path}: a mesh cannot be split into convex parts ({one_line(error)})") from error
    owners = tuple(owner.get(name := final.geom(i).name, name) for i in range(final.ngeom))
    return Source(spec, final, {labels[i]: part.facets for i, part in parts.items()}, owners)


def _kind(model: mujoco.MjModel, index: int) -> str:
    """A label for a geom without a name: `type#id`."""
    return f"{mujoco.mjtGeom(int(model.geom_type[index])).name.removeprefix('mjGEOM_').lower()}#{index}"


def _unused(name: str, taken: set[str]) -> str:
    """The wanted name, changed if it is taken; the result is added to the taken names."""
    while name in taken:
        name += "'"
    taken.add(name)
    return name


def _compiled(path: Path, mjcf: str | None) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    if mjcf is None:
        try:
            if path.exists() and not path.is_file():  # a device may be read without end
                raise FileNotFoundError
            path.read_text(encoding="utf-8")
        except (FileNotFoundError, IsADirectoryError, NotADirectoryError):
            raise WorldError(f"{path}: no such world file; give the path of an MJCF file") from None
        except (OSError, UnicodeDecodeError) as error:
            raise WorldError(f"{path}: cannot be read as text ({error}); give the path of an MJCF file") from error
    try:
        spec = read_spec(path, mjcf)
        # Every geom must stay where the file has it.
        spec.compiler.discardvisual = spec.compiler.fusestatic = False
        for size in SIZES:
            setattr(spec, size, -1)
        for mesh in spec.meshes:
            mesh.maxhullvert = -1  # the whole hull collides
        return spec, compile_spec(spec)
    except InputError as error:
        raise WorldError(f"{path}: {error}") from error
    except (ValueError, OSError) as error:
        raise WorldError(f"{path}: MuJoCo cannot read this world: {one_line(error)}") from error


def _body_label(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"body#{body}"


def _check_static(path: Path, spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    if model.njnt:
        joint = model.joint(0)
        what = f"joint '{joint.name}'" if joint.name else "a joint"
        body = _body_label(model, int(model.jnt_bodyid[0]))
        raise WorldError(f"{path}: body '{body}' moves ({what}); a world is static, remove the joint")
    if model.nmocap:
        body = _body_label(model, int(np.argmax(model.body_mocapid >= 0)))
        raise WorldError(f"{path}: body '{body}' is a mocap body; a world is static, remove mocap")
    for count, what in (
        (model.nu, "an actuator"),
        (model.neq, "an equality constraint"),
        (model.ntendon, "a tendon"),
        (model.nflex, "a flex"),
    ):
        if count:
            raise WorldError(
                f"{path}: the world has {what}; only static geoms, sites, lights and cameras are supported"
            )


def _check_geoms(path: Path, model: mujoco.MjModel, colliding: np.ndarray, labels: list[str]) -> None:
    for index in np.flatnonzero(colliding).tolist():
        friction, label = float(model.geom_friction[index, 0]), labels[index]
        if friction <= 0.0:
            raise WorldError(
                f"{path}: geom '{label}' has friction {friction:g}; give a sliding friction above zero "
                "(the first number of `friction`)"
            )
        size = model.geom_size[index]
        if 0.0 < size[size > 0.0].min(initial=np.inf) < _LEAST:
            raise WorldError(f"{path}: geom '{label}' is thinner than {_LEAST:g} m; give it a size, or remove it")
        if model.geom_type[index] == mujoco.mjtGeom.mjGEOM_SDF:
            raise WorldError(f"{path}: geom '{label}' is an SDF, which is not supported; use a mesh")


def _decompositions(
    path: Path, model: mujoco.MjModel, colliding: np.ndarray, labels: list[str], progress: Callable[[float], None]
) -> tuple[dict[int, Decomposition], dict[int, MeshField]]:
    """What the colliding mesh geoms that are not convex are replaced with, by geom id: parts, or a height field."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    parts: dict[int, Decomposition] = {}
    fields: dict[int, MeshField] = {}
    meshes = np.flatnonzero(colliding & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)).tolist()
    for done, index in enumerate(meshes):
        progress(done / len(meshes))
        vertices, triangles = mesh_of_geom(model, data, index)
        try:
            found = _replacement(model, data, index, vertices, triangles)
        except ValueError as error:
            raise WorldError(f"{path}: mesh geom '{labels[index]}': {error}") from error
        if isinstance(found, MeshField):
            fields[index] = found
        elif found is not None:
            parts[index] = found
    return parts, fields


def _replacement(
    model: mujoco.MjModel, data: mujoco.MjData, index: int, vertices: np.ndarray, triangles: np.ndarray
) -> Decomposition | MeshField | None:
    """What a mesh geom is replaced with, None where it is convex; raises ValueError as `decompose_mesh` does."""
    try:
        parts = decompose_mesh(vertices, triangles)
    except ValueError:
        field = field_of(model, data, index, vertices, triangles)
        if field is None:
            raise
        return field
    if parts is None or not is_splintered(parts.facets):
        return parts
    return field_of(model, data, index, vertices, triangles) or parts


def mesh_of_geom(model: mujoco.MjModel, data: mujoco.MjData, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) in the world frame and triangles (k, 3) of a mesh geom."""
    mesh = int(model.geom_dataid[index])
    vertices = mesh_vertices(model, mesh).astype(float)
    rotation, position = data.geom_xmat[index].reshape(3, 3), data.geom_xpos[index]
    return vertices @ rotation.T + position, mesh_triangles(model, mesh).copy()


def _normalise(geom, model: mujoco.MjModel, index: int, collides: bool) -> None:
    """Set the contact bits and the group of a geom: it collides with everything or is only drawn."""
    geom.contype = geom.conaffinity = _ALL_BITS if collides else 0
    if not collides:
        geom.group = VISUAL_GROUP
        return
    if geom.group == VISUAL_GROUP:
        geom.group = 0
    material = int(model.geom_matid[index])
    if model.geom_rgba[index, 3] == 0.0 or (material >= 0 and model.mat_rgba[material, 3] == 0.0):
        geom.material = ""  # MuJoCo's rays pass through invisible geoms
        geom.rgba = [0.5, 0.5, 0.5, 1e-3]


def _colliding(model: mujoco.MjModel, index: int) -> dict[str, Any]:
    """What geoms that collide in the place of a mesh geom have in common."""
    return {
        "friction": model.geom_friction[index],
        "group": PART_GROUP,
        "contype": _ALL_BITS,
        "conaffinity": _ALL_BITS,
    }


def _add_field(
    spec: mujoco.MjSpec, model: mujoco.MjModel, index: int, label: str, field: MeshField, taken: set[str]
) -> dict[str, str]:
    """Add the height field of a mesh geom to the world body; return the label by its name."""
    name = _unused(f"{label}/field", taken)
    rows, columns = field.heights.shape
    top = max(float(field.heights.max()), _LEAST)
    spec.add_hfield(
        name=name,
        nrow=rows,
        ncol=columns,
        size=[*field.half, top, field.base],
        userdata=(field.heights / top).ravel(),
    )
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname=name,
        pos=field.pose.position,
        quat=field.pose.quaternion_wxyz,
        **_colliding(model, index),
    )
    return {name: label}


def _add_parts(
    spec: mujoco.MjSpec, model: mujoco.MjModel, index: int, label: str, decomposition: Decomposition, taken: set[str]
) -> dict[str, str]:
    """Add a mesh geom's convex parts to the world body; return the label by the name of each part."""
    names = {}
    for number, vertices in enumerate(decomposition.parts):
        name = _unused(f"{label}/part{number}", taken)
        centre = vertices.mean(axis=0)
        spec.add_mesh(name=name, uservert=(vertices - centre).ravel())
        spec.worldbody.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            pos=centre,
            **_colliding(model, index),
        )
        names[name] = label
    return names
