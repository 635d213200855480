"""Find a model file by what a user calls it: a path, a package, or a file in a package."""

from __future__ import annotations

import importlib.metadata
import os
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import InputError, PackageError
from toolkit.robot.source import file_in_package, file_of_module

_MODULES = "robot_descriptions"
_MOST = 100  # most models of a package that a message names


@dataclass(frozen=True)
class Located:
    """A model file, and how a robot.toml names it.

    Attributes:
        path: The file.
        package: Distribution that it is a file of, or None.
        file: End of its path in the distribution, by which it is found.
        module: Module of `robot_descriptions` that knows it, or None.
    """

    path: Path
    package: str | None = None
    file: str = ""
    module: str | None = None

    def lines(self, folder: Path | None) -> list[str]:
        """Lines of [model] in a robot.toml of a folder; None for one anywhere on this machine."""
        if self.module is not None:
            return [f'robot_descriptions = "{self.module}"']
        if self.package is not None:
            return [f'package = "{self.package}"', f'file = "{self.file}"']
        path = self.path if folder is None else Path(os.path.relpath(self.path, folder.resolve()))
        return [f'file = "{path.as_posix()}"']


def locate(what: str) -> Located:
    """The model file that a user means by FILE, PACKAGE, PACKAGE:FILE or robot_descriptions:MODULE.

    Raises:
        PackageError: A package is not installed, or a model cannot be fetched.
        InputError: There is no such file, or the package has several models and none is named.
    """
    if os.path.isfile(what):
        return Located(Path(what).resolve())
    package, colon, name = what.partition(":")
    if not colon and (os.path.sep in what or what.endswith((".xml", ".urdf"))):
        raise InputError(f"{what}: no such file; give an MJCF or URDF file, or PACKAGE:FILE")
    if package == _MODULES and name:
        return Located(file_of_module("--inspect", name), module=name)
    models = _models(package)
    if name:
        path = file_in_package("--inspect", package, name)
    elif len(models) == 1:
        path = models[0][1]
    else:
        shown = ", ".join(file for file, _ in models[:_MOST]) + (", ..." if len(models) > _MOST else "")
        raise InputError(f"package '{package}' has {len(models)} models; name one as {package}:FILE: {shown or 'none'}")
    file = next((file for file, found in models if found == path), name)
    return Located(path, package=package, file=file)


def _models(package: str) -> list[tuple[str, Path]]:
    """Ends of paths of the MJCF and URDF files of a distribution that have bodies or links, as short as they can be."""
    try:
        files = importlib.metadata.files(package) or []
    except (importlib.metadata.PackageNotFoundError, ValueError):
        raise PackageError(f"'{package}' is neither a file nor an installed package; `pip install {package}`") from None
    found = {}
    for file in files:
        path = Path(str(file.locate()))
        if path.suffix in (".urdf", ".xml") and path.is_file():
            text = path.read_text(encoding="utf-8", errors="replace")
            if ("<mujoco" in text and "<body" in text) or ("<robot" in text and "<link" in text):
                found[file.as_posix()] = path.resolve()
    ends = [file.as_posix() for file in files]
    return sorted((_short(name, ends), path) for name, path in found.items())


def _short(name: str, others: list[str]) -> str:
    """The shortest end of a path, from a folder on, that no other path has."""
    parts = name.split("/")
    for count in range(2, len(parts)):
        end = "/".join(parts[-count:])
        if sum(f"/{other}".endswith(f"/{end}") for other in others) == 1:
            return end
    return name
