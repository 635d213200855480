"""From a world's MJCF to the scene that is simulated: read, check, and make every mesh collide as it looks."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from toolkit.errors import WorldError
from toolkit.world.decomposition import Decomposition, decompose_mesh
from toolkit.world.facets import Facet

VISUAL_GROUP = 2  # geoms that do not collide
PART_GROUP = 3  # convex parts of a mesh that is drawn as a whole; hidden by default in MuJoCo's viewer
RAY_GROUPS = np.array([1, 1, 0, 1, 1, 1], np.uint8)  # `geomgroup` of mj_ray that sees exactly what collides

_ALL_BITS = 0x7FFFFFFF
_NAN = re.compile(r"""=\s*["'][^"']*(?<![^\s"'])[+-]?nan(?![^\s"'])""", re.IGNORECASE)


@dataclass(frozen=True)
class Source:
    """A world's scene, ready to compile or to take in a robot.

    Attributes:
        spec: the scene; colliding geoms have all contact bits set, the others none.
        model: `spec` compiled.
        facets: mesh geom name -> its flat facets in the world frame, for mesh geoms replaced by convex parts.
        owner: (ngeom,) labels; the authored geom that each geom of the model stands for.
    """

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    facets: dict[str, list[Facet]]
    owner: tuple[str, ...]


def one_line(message: object) -> str:
    """A message of MuJoCo condensed to one line."""
    text = str(message).replace("Error=", "").replace("XML Error: Error:", "").replace("XML Error:", "")
    return " ".join(text.split()).removeprefix("Error: ")


def read_source(path: Path, mjcf: str | None = None) -> Source:
    """Read and check a world's MJCF.

    MuJoCo collides a mesh geom as its convex hull. A mesh that is not convex is therefore replaced by convex parts,
    one or more per flat facet, and itself kept for drawing only: what is seen, what rays hit and what is touched agree.

    Args:
        path: the MJCF file; meshes are looked for beside it.
        mjcf: its text where it exists in memory only.

    Returns:
        The scene.

    Raises:
        WorldError: the file is missing or broken, has moving parts, NaN, unusable friction or unsupported geoms.
    """
    spec, model = _compiled(path, mjcf)
    _check_static(path, spec, model)
    _check_finite(path, model)
    colliding = (model.geom_contype | model.geom_conaffinity) != 0
    _check_geoms(path, model, colliding)

    labels = [geom_label(model, i) for i in range(model.ngeom)]
    parts = _decompositions(path, model, colliding, labels)
    replaced = set(parts)
    for geom in list(spec.geoms):
        _normalise(geom, model, bool(colliding[geom.id]), geom.id in replaced)
    owner = {}
    for index, decomposition in parts.items():
        owner.update(_add_parts(spec, model, index, labels[index], decomposition))
    try:
        final = spec.compile()
    except ValueError as error:
        raise WorldError(f"{path}: a mesh cannot be split into convex parts ({one_line(error)})") from error
    authored = iter(labels)
    owners = tuple(owner[name] if (name := final.geom(i).name) in owner else next(authored) for i in range(final.ngeom))
    return Source(spec, final, {labels[i]: part.facets for i, part in parts.items()}, owners)


def geom_label(model: mujoco.MjModel, index: int) -> str:
    """A geom's name, or `type#id`."""
    kind = mujoco.mjtGeom(int(model.geom_type[index])).name.removeprefix("mjGEOM_").lower()
    return model.geom(index).name or f"{kind}#{index}"


def _compiled(path: Path, mjcf: str | None) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    if mjcf is None and not path.is_file():
        raise WorldError(f"{path}: no such world file; give the path of an MJCF file")
    _check_text(path, mjcf)
    try:
        if mjcf is None:
            spec = mujoco.MjSpec.from_file(str(path))
        else:
            spec = mujoco.MjSpec.from_string(mjcf)
            spec.modelfiledir = str(path.parent)
        for mesh in spec.meshes:
            mesh.maxhullvert = -1  # the whole hull collides
        return spec, spec.compile()
    except ValueError as error:
        raise WorldError(f"{path}: MuJoCo cannot read this world: {one_line(error)}") from error


def _check_text(path: Path, mjcf: str | None) -> None:
    """Raise for NaN before MuJoCo, which would only write a warning into a log file, reads it."""
    try:
        text = mjcf if mjcf is not None else path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise WorldError(f"{path}: cannot be read as text ({error}); give the path of an MJCF file") from error
    for number, line in enumerate(text.splitlines(), 1):
        if _NAN.search(line):
            raise WorldError(f"{path}: line {number} has a NaN: {line.strip()[:80]}; give plain numbers")


def _check_static(path: Path, spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    if model.njnt:
        joint = model.joint(0)
        body = model.body(int(model.jnt_bodyid[0])).name or f"body#{int(model.jnt_bodyid[0])}"
        what = f"joint '{joint.name}'" if joint.name else "a joint"
        raise WorldError(f"{path}: body '{body}' moves ({what}); a world is static, remove the joint")
    if model.nmocap:
        body = int(np.argmax(model.body_mocapid >= 0))
        raise WorldError(f"{path}: body '{model.body(body).name}' is a mocap body; a world is static, remove mocap")
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


def _check_finite(path: Path, model: mujoco.MjModel) -> None:
    """Raise for a number that is not finite, naming the thing it belongs to."""
    fields = {
        "geom": ("geom_pos", "geom_quat", "geom_size", "geom_friction"),
        "site": ("site_pos", "site_quat", "site_size"),
        "body": ("body_pos", "body_quat"),
    }
    for kind, names in fields.items():
        for name in names:
            values = getattr(model, name)
            bad = ~np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
            if bad.any():
                index = int(np.argmax(bad))
                label = getattr(model, kind)(index).name or f"{kind}#{index}"
                field = name.split("_")[1]
                raise WorldError(f"{path}: {field} of {kind} '{label}' is not finite; give plain numbers")
    for values, what in ((model.mesh_vert, "a mesh vertex"), (model.hfield_data, "a height of a height field")):
        if not np.isfinite(values).all():
            raise WorldError(f"{path}: {what} is not finite; repair the file it comes from")


def _check_geoms(path: Path, model: mujoco.MjModel, colliding: np.ndarray) -> None:
    for index in np.flatnonzero(colliding).tolist():
        friction = float(model.geom_friction[index, 0])
        label = geom_label(model, index)
        if friction <= 0.0:
            raise WorldError(
                f"{path}: geom '{label}' has friction {friction:g}; give a sliding friction above zero "
                "(the first number of `friction`)"
            )
        if model.geom_type[index] == mujoco.mjtGeom.mjGEOM_SDF:
            raise WorldError(f"{path}: geom '{label}' is an SDF, which is not supported; use a mesh")


def _decompositions(
    path: Path, model: mujoco.MjModel, colliding: np.ndarray, labels: list[str]
) -> dict[int, Decomposition]:
    """Geom id -> decomposition, for the colliding mesh geoms that are not convex."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    result = {}
    for index in np.flatnonzero(colliding & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)).tolist():
        vertices, triangles = mesh_of_geom(model, data, index)
        try:
            decomposition = decompose_mesh(vertices, triangles)
        except ValueError as error:
            raise WorldError(f"{path}: mesh geom '{labels[index]}': {error}") from error
        if decomposition is not None:
            result[index] = decomposition
    return result


def mesh_of_geom(model: mujoco.MjModel, data: mujoco.MjData, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) in the world frame and triangles (k, 3) of a mesh geom."""
    mesh = int(model.geom_dataid[index])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float)
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    rotation, position = data.geom_xmat[index].reshape(3, 3), data.geom_xpos[index]
    return vertices @ rotation.T + position, model.mesh_face[first : first + count].copy()


def _normalise(geom, model: mujoco.MjModel, colliding: bool, replaced: bool) -> None:
    """Set contact bits and the group of a geom: it collides with everything, or is there for the eye only."""
    index = geom.id
    if not colliding or replaced:
        geom.contype = geom.conaffinity = 0
        geom.group = VISUAL_GROUP
        return
    geom.contype = geom.conaffinity = _ALL_BITS
    if geom.group == VISUAL_GROUP:
        geom.group = 0
    if model.geom_rgba[index, 3] == 0.0:  # MuJoCo's rays pass through what is invisible
        geom.material = ""
        geom.rgba = [0.5, 0.5, 0.5, 1e-3]


def _add_parts(
    spec: mujoco.MjSpec, model: mujoco.MjModel, index: int, label: str, decomposition: Decomposition
) -> dict[str, str]:
    """Add a mesh geom's convex parts to the world body; returns part name -> label."""
    names = {}
    for number, vertices in enumerate(decomposition.parts):
        name = f"{label}/part{number}"
        centre = vertices.mean(axis=0)
        spec.add_mesh(name=name, uservert=(vertices - centre).ravel())
        spec.worldbody.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            pos=centre,
            friction=model.geom_friction[index],
            group=PART_GROUP,
            contype=_ALL_BITS,
            conaffinity=_ALL_BITS,
        )
        names[name] = label
    return names
