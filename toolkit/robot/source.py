"""Read a robot's model file, MJCF or URDF, into one MjSpec."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import mujoco

from toolkit.errors import InputError, PackageError, RobotError
from toolkit.mjcf import one_line, read_spec
from toolkit.robot.description import RobotDescription
from toolkit.robot.mend_table import Box, Mend
from toolkit.robot.mesh_files import READABLE, converted, lies_down
from toolkit.robot.reader import suggestion


@dataclass(frozen=True)
class ModelSource:
    """A model file as it was read.

    Attributes:
        path: The model file.
        spec: Content of the file, including the files that it names.
        velocity: Velocity limits in a URDF by joint, rad/s; MuJoCo ignores them.
        unread: Links of a URDF whose collision shapes cannot be read and were left out.
        turned: Whether COLLADA shapes whose files say that y points up were turned to have z up.
    """

    path: Path
    spec: mujoco.MjSpec
    velocity: dict[str, float]
    unread: tuple[str, ...] = ()
    turned: bool = False


def find_model_file(description: RobotDescription) -> Path:
    """The existing model file that a robot.toml names.

    Raises:
        PackageError: The package that contains it is not installed.
        RobotError: The file is missing, or a package has several such files.
    """
    where = description.path
    if description.module is not None:
        return file_of_module(str(where), description.module)
    if description.package is None:
        path = description.path.parent / description.file
        if not os.path.isfile(path):
            raise RobotError(f"{where}: model.file '{description.file}' does not exist in {path.parent}")
        return path
    return file_in_package(str(where), description.package, description.file)


def file_in_package(where: str, package: str, name: str) -> Path:
    """The file of an installed distribution whose path ends with a name.

    Args:
        where: What asks for it, at the beginning of messages.
        package: Name of the distribution.
        name: End of the file's path.

    Raises:
        PackageError: The distribution is not installed.
        RobotError: It has no such file, or several.
    """
    try:
        files = importlib.metadata.files(package) or []
    except importlib.metadata.PackageNotFoundError:
        raise PackageError(f"{where}: package '{package}' is not installed; `pip install {package}`") from None
    matches = [file for file in files if f"/{file.as_posix()}".endswith("/" + name.lstrip("/"))]
    if len(matches) != 1:
        models = [file.name for file in files if file.suffix in (".urdf", ".xml")]
        found = "several files" if matches else "no file"
        hint = "give more of its path" if matches else suggestion(Path(name).name, models[:200])
        raise RobotError(f"{where}: package '{package}' has {found} '{name}'; {hint}")
    return Path(str(matches[0].locate())).resolve()


def file_of_module(where: str, name: str) -> Path:
    """The model file that a module of `robot_descriptions` knows; importing the module may download it.

    Args:
        where: What asks for it, at the beginning of messages.
        name: Name of the module.

    Raises:
        PackageError: The distribution is not installed, or the model cannot be fetched.
        RobotError: It has no such module.
    """
    try:
        importlib.import_module("robot_descriptions")
    except ImportError:
        raise PackageError(
            f"{where}: package 'robot_descriptions' is not installed; `pip install robot_descriptions`"
        ) from None
    try:
        module = vars(importlib.import_module(f"robot_descriptions.{name}"))
    except ModuleNotFoundError:
        raise RobotError(f"{where}: robot_descriptions has no module '{name}'; see `robot_descriptions list`") from None
    except Exception as error:  # git, network and disk fail in ways of their own
        raise PackageError(f"{where}: robot_descriptions.{name} cannot be fetched: {one_line(error)}") from None
    found = module.get("MJCF_PATH") or module.get("URDF_PATH")
    if not isinstance(found, str) or not os.path.isfile(found):
        raise RobotError(f"{where}: robot_descriptions.{name} names no model file")
    return Path(found).resolve()


def read_model(path: Path, mend: Mend | None = None, *, lenient: bool = False, upright: bool = False) -> ModelSource:
    """Read an MJCF or URDF file.

    A URDF keeps its fixed links and loses visual shapes that MuJoCo cannot draw; its `package://` paths are resolved.
    Collision shapes that `mend` replaces need not be readable. Where `lenient`, none needs to be, and links that lose
    theirs are named. Shapes that lie down are turned where `mend` says so, or where `upright`; nothing else of `mend`
    counts here.

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
    unread: list[str] = []
    meshes = _Meshes(path, upright or (mend is not None and mend.up_axis))
    try:
        if root.tag == "mujoco":
            spec = read_spec(path)
        else:
            velocity = _velocity_limits(path, root)
            unread = _prepare_urdf(path, root, mend, lenient, meshes)
            spec = read_spec(path, ElementTree.tostring(root, encoding="unicode"), meshes.assets)
            spec.compiler.fusestatic = False
            for geom in spec.geoms:
                geom.density = 0.0  # a link without <inertial> has no mass, whatever its shapes
    except RobotError:
        raise
    except InputError as error:
        raise RobotError(f"{path}: {error}") from None
    except (ValueError, OSError) as error:
        raise RobotError(f"{path}: MuJoCo cannot load it: {one_line(error)}") from None
    return ModelSource(path, spec, velocity, tuple(unread), meshes.turned)


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


def _prepare_urdf(
    path: Path, root: ElementTree.Element, mend: Mend | None, lenient: bool, meshes: _Meshes
) -> list[str]:
    """Make a URDF readable for MuJoCo; returns the links that lost a collision shape which cannot be read."""
    names: set[str] = set()
    unread: list[str] = []
    for link in root.iter("link"):
        if mend is not None and _is_replaced(mend, link.get("name", "")):
            for shape in link.findall("collision"):
                link.remove(shape)
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            if shape.get("name") in names:  # MuJoCo prints a warning past Python
                del shape.attrib["name"]
            names.add(shape.get("name", ""))
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            drawn = shape.tag == "visual"
            try:
                mesh.set("filename", meshes.name_of(name, drawn))
            except ValueError as error:
                if not drawn and not lenient:
                    raise RobotError(
                        f"{path}: collision mesh '{name}' of link '{link.get('name')}' {error}; add the file, or "
                        "replace the shape in [mend.collision]"
                    ) from None
                link.remove(shape)
                unread += [] if drawn else [link.get("name", "")]
    for extension in root.findall("mujoco"):
        root.remove(extension)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", strippath="false", fusestatic="false", discardvisual="false")
    return list(dict.fromkeys(unread))


class _Meshes:
    """The mesh files of a URDF, as MuJoCo can read them.

    Attributes:
        assets: Content of those that had to be converted, by new names.
        turned: Whether some of them lay down and were turned.
    """

    def __init__(self, urdf: Path, upright: bool) -> None:
        self._urdf = urdf
        self._names: dict[Path, str] = {}
        self.assets: dict[str, bytes] = {}
        self.turned = False
        self._upright = upright

    def name_of(self, name: str, drawn: bool) -> str:
        """What a mesh is called from now on: a path, or a name in `assets`.

        Raises:
            ValueError: It cannot be read, or is COLLADA and only drawn; the message has the mesh as its subject.
        """
        file = _resolve(self._urdf, name)
        if file is None:
            raise ValueError("is missing")
        ending = file.suffix.lower()
        if ending not in READABLE or (drawn and ending == ".dae"):
            raise ValueError(f"is not one of {', '.join(sorted(READABLE))}")
        if file not in self._names:
            content, self._names[file] = converted(file, upright=self._upright), str(file)
            self.turned |= self._upright and ending == ".dae" and lies_down(file)
            if content is not None:
                self._names[file] = f"{len(self._names)}_{file.stem}.stl"
                self.assets[self._names[file]] = content
        return self._names[file]


def _resolve(path: Path, name: str) -> Path | None:
    """The existing file that a URDF names; a `package://` is searched for in the folders above the URDF."""
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        candidates = [parent / package / rest for parent in path.parents]
        candidates += [parent / rest for parent in path.parents if parent.name == package]
    else:
        candidates = [path.parent / name.removeprefix("file://")]
    return next((file.resolve() for file in candidates if os.path.isfile(file)), None)


def _is_replaced(mend: Mend, link: str) -> bool:
    """Whether the collision shapes of a link make room for others."""
    name = mend.bodies.get(link, link)
    shapes = [shape for pattern, shape in mend.collision.items() if fnmatchcase(name, pattern)]
    return bool(shapes) and (shapes[-1] == "none" or isinstance(shapes[-1], Box))
