"""Read a robot's model file, MJCF or URDF, into one MjSpec."""

from __future__ import annotations

import importlib.metadata
import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import mujoco

from toolkit.errors import InputError, PackageError, RobotError
from toolkit.mjcf import one_line, read_spec
from toolkit.robot.description import RobotDescription, suggestion

_MESH_ENDINGS = {".stl", ".obj", ".msh"}


@dataclass(frozen=True)
class ModelSource:
    """A model file as it was read.

    Attributes:
        path: The model file.
        spec: Content of the file, including the files that it names.
        velocity: Velocity limits in a URDF by joint, rad/s; MuJoCo ignores them.
    """

    path: Path
    spec: mujoco.MjSpec
    velocity: dict[str, float]


def find_model_file(description: RobotDescription) -> Path:
    """The existing model file that a robot.toml names.

    Raises:
        PackageError: The package that contains it is not installed.
        RobotError: The file is missing, or a package has several such files.
    """
    where = description.path
    if description.package is None:
        path = description.path.parent / description.file
        if not os.path.isfile(path):
            raise RobotError(f"{where}: model.file '{description.file}' does not exist in {path.parent}")
        return path
    try:
        files = importlib.metadata.files(description.package) or []
    except importlib.metadata.PackageNotFoundError:
        package = description.package
        raise PackageError(f"{where}: package '{package}' is not installed; `pip install {package}`") from None
    matches = [file for file in files if f"/{file.as_posix()}".endswith("/" + description.file.lstrip("/"))]
    if len(matches) != 1:
        models = [file.name for file in files if file.suffix in (".urdf", ".xml")]
        found = "several files" if matches else "no file"
        hint = "give more of its path" if matches else suggestion(Path(description.file).name, models[:200])
        raise RobotError(f"{where}: package '{description.package}' has {found} '{description.file}'; {hint}")
    return Path(str(matches[0].locate())).resolve()


def read_model(path: Path) -> ModelSource:
    """Read an MJCF or URDF file.

    A URDF keeps its fixed links and loses visual shapes that MuJoCo cannot draw; its `package://` paths are resolved.

    Raises:
        RobotError: The file is not valid XML or neither MJCF nor URDF, a mesh is missing, or MuJoCo cannot parse it.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, ValueError, LookupError) as error:
        raise RobotError(f"{path}: not valid XML: {error}") from None
    if root.tag not in ("mujoco", "robot"):
        raise RobotError(f"{path}: root element <{root.tag}>; expected <mujoco> (MJCF) or <robot> (URDF)")
    velocity: dict[str, float] = {}
    try:
        if root.tag == "mujoco":
            spec = read_spec(path)
        else:
            velocity = _velocity_limits(path, root)
            _prepare_urdf(path, root)
            spec = read_spec(path, ElementTree.tostring(root, encoding="unicode"))
            spec.compiler.fusestatic = False
            for geom in spec.geoms:
                geom.density = 0.0  # a link without <inertial> has no mass, whatever its shapes
    except RobotError:
        raise
    except InputError as error:
        raise RobotError(f"{path}: {error}") from None
    except (ValueError, OSError) as error:
        raise RobotError(f"{path}: MuJoCo cannot load it: {one_line(error)}") from None
    return ModelSource(path, spec, velocity)


def _velocity_limits(path: Path, root: ElementTree.Element) -> dict[str, float]:
    limits = {}
    for joint in root.iter("joint"):
        limit = joint.find("limit")
        text = limit.get("velocity") if limit is not None else None
        if text is not None and joint.get("name"):
            try:
                value = float(text)
            except ValueError:
                raise RobotError(f"{path}: joint '{joint.get('name')}' has the velocity limit '{text}'") from None
            if value > 0:
                limits[joint.get("name", "")] = value
    return limits


def _prepare_urdf(path: Path, root: ElementTree.Element) -> None:
    for link in root.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            file = _resolve(path, mesh.get("filename", ""))
            readable = file is not None and file.suffix.lower() in _MESH_ENDINGS
            if readable:
                mesh.set("filename", str(file))
            elif shape.tag == "visual":
                link.remove(shape)
            else:
                reason = "is missing" if file is None else f"is not one of {', '.join(sorted(_MESH_ENDINGS))}"
                raise RobotError(
                    f"{path}: collision mesh '{mesh.get('filename')}' of link '{link.get('name')}' {reason}; "
                    "add the file or remove the <collision>"
                )
    for extension in root.findall("mujoco"):
        root.remove(extension)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", strippath="false", fusestatic="false", discardvisual="false")


def _resolve(path: Path, name: str) -> Path | None:
    """The existing file that a URDF names; a `package://` is searched for in the folders above the URDF."""
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        candidates = [parent / package / rest for parent in path.parents]
        candidates += [parent / rest for parent in path.parents if parent.name == package]
    else:
        candidates = [path.parent / name.removeprefix("file://")]
    return next((file.resolve() for file in candidates if os.path.isfile(file)), None)
