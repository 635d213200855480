"""Read a model file once, with its includes and assets, and catch MuJoCo's warnings."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from toolkit.errors import InputError, ToolkitError

LARGEST = 1e4
"""Largest length or distance in a world or a robot, m."""
SIZES = ("memory", "nemax", "njmax", "nconmax", "nstack")
"""Sizes of MuJoCo's buffers; for -1 MuJoCo chooses them."""

_TAG = re.compile(r"""<!--.*?-->|<(/?)([\w.-]+)((?:"[^"]*"|'[^']*'|[^"'>])*)>""", re.DOTALL)
_ATTRIBUTE = re.compile(r"""([\w.-]+)\s*=\s*["']([^"']*)["']""")
_NAN = re.compile(r"""=\s*["'][^"']*(?<![^\s"'])[+-]?nan(?![^\s"'])""", re.IGNORECASE)
_MOST_CELLS = 4_000_000  # most points of a height field, or pixels of a texture
_CELLS = {"hfield": ("height field", "nrow", "ncol"), "texture": ("texture", "width", "height")}
_MOST_COPIES = 10_000  # most elements that copies or patterns make; MuJoCo takes seconds for so many
_PATTERNS = {"flexcomp": "count", "composite": "count", "contact": "num"}  # elements that stand for many, and how many
_FINEST = 300  # largest number that shapes a mesh which MuJoCo makes; most are resolutions
_MOST_USER_VALUES = 1000  # most numbers of a user for each element, and most keys


def one_line(message: object) -> str:
    """A message of MuJoCo condensed to one line."""
    text = str(message).replace("Error=", "").replace("XML Error: Error:", "").replace("XML Error:", "")
    return " ".join(text.split()).removeprefix("Error: ")


def read_spec(path: Path, text: str | None = None, assets: Mapping[str, bytes] | None = None) -> mujoco.MjSpec:
    """Read an MJCF file, or MJCF or URDF text in place of the file's content, with all files that it names.

    The content of the files is in `spec.assets`, so that later changes on the disk have no effect. The names in
    `assets` stand for files that are not on the disk.

    Raises:
        ValueError: MuJoCo cannot read it, or a file is missing.
        InputError: A number is NaN, or something is too large. The message is one line without the path.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise InputError("the name of the file or of its folder is not UTF-8; rename it") from None
    _check_amounts(path.read_text(encoding="utf-8", errors="replace") if text is None else text, path.parent)
    with _caught() as found:
        spec = (
            mujoco.MjSpec.from_file(str(path))
            if text is None
            else mujoco.MjSpec.from_string(text, assets=dict(assets or {}))
        )
    if any("NaN" in warning for warning in found):
        text = path.read_text(encoding="utf-8") if text is None else text
        lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1) if _NAN.search(line)]
        where = [f"line {n} has a NaN: {line[:80]}" for n, line in lines] or ["a number is NaN"]
        raise InputError(f"{where[0]}; give plain numbers")
    for tag, items in (("hfield", spec.hfields), ("texture", spec.textures)):
        for item in items:
            _check_cells(tag, item.name, *(getattr(item, side) for side in _CELLS[tag][1:]))
    for name in [name for name in dir(spec) if name.startswith(("nuser", "nkey"))]:
        if getattr(spec, name) > _MOST_USER_VALUES:
            raise InputError(f"{name} of <size> is {getattr(spec, name)}; at most {_MOST_USER_VALUES} are read")
    _take_assets(spec, path.parent, assets or {})
    return spec


def compile_spec(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a spec and check that every number is finite and every length at most `LARGEST`.

    Raises:
        ValueError: MuJoCo cannot compile it.
        InputError: A number cannot be used. The message is one line without the path.
    """
    with _caught() as found:
        model = spec.compile()
    if found:
        raise InputError(f"MuJoCo warns: {found[0]}")
    names = sorted((name for name in dir(model) if "_" in name.strip("_")), key=lambda name: not _named(model, name))
    arrays = {name: getattr(model, name) for name in names}
    arrays = {name: a for name, a in arrays.items() if isinstance(a, np.ndarray) and a.dtype.kind == "f" and a.size}
    for name, values in arrays.items():
        if name.endswith(("_pos", "_size", "mesh_vert")):
            _check(model, name, np.abs(values) <= LARGEST, f"is more than {LARGEST:g} m")
        if name.endswith("quat") and not name.startswith("key_"):
            good = np.abs(np.linalg.norm(values, axis=-1) - 1.0) < 1e-6
            _check(model, name, good, "is no rotation")
    for name, values in arrays.items():
        if not name.startswith("numeric_"):
            _check(model, name, np.isfinite(values), "is not finite")
    return model


def _check_amounts(text: str, folder: Path) -> None:
    """Raise an InputError if a text and what it includes ask for more elements or cells than can be made.

    MuJoCo makes them while it reads the text. Attributes that are no numbers are left to MuJoCo.
    """
    made, seen = 0.0, set()
    waiting: list[tuple[str, Path, float]] = [(text, folder, 1.0)]
    while waiting:
        content, place, factor = waiting.pop()
        factors = [factor]
        for end, tag, rest in _TAG.findall(content):
            attributes = dict(_ATTRIBUTE.findall(rest))
            if tag == "replicate" and end:
                factors = factors[:-1] or factors
            elif tag == "replicate" and not rest.endswith("/"):
                factors.append(factors[-1] * _product(attributes.get("count", "")))
                made += factors[-1] - 1
            elif tag == "include":
                for file in {(base / attributes.get("file", "")).resolve() for base in (folder, place)} - seen:
                    seen.add(_regular(file))
                    if file.is_file():
                        waiting.append((file.read_text(encoding="utf-8", errors="replace"), file.parent, factors[-1]))
            elif not end:
                if tag in _CELLS:
                    sides = (_product(attributes.get(side, "")) for side in _CELLS[tag][1:])
                    _check_cells(tag, attributes.get("name", ""), *sides)
                made += factors[-1] * _product(attributes.get(_PATTERNS.get(tag, ""), "")) - 1
                finest = max((_product(word) for word in attributes.get("params", "").split()), default=0.0)
                if not finest <= _FINEST:
                    raise InputError(f"params of <{tag}> has {finest:g}; give numbers of at most {_FINEST}")
            if not made <= _MOST_COPIES:
                raise InputError(f"<{tag}> asks for {made:g} copies or more; at most {_MOST_COPIES} are made")


def _check_cells(tag: str, name: str, first: float, second: float) -> None:
    """Raise an InputError if a height field or a texture has too many cells."""
    if not first * second <= _MOST_CELLS:
        size = f"{first:.0f} x {second:.0f}"
        raise InputError(f"{_CELLS[tag][0]} '{name}' has {size} cells; at most {_MOST_CELLS} are read")


def _product(text: str) -> float:
    """Product of the numbers above one in a text; one if it holds something else."""
    try:
        return float(np.prod([max(float(word), 1.0) for word in text.split()]))
    except ValueError:
        return 1.0


def _regular(file: Path) -> Path:
    """The path of a file, if it is not something that may be read without end."""
    if file.exists() and not file.is_file() and not file.is_dir():
        raise InputError(f"{file} is no plain file; name a plain file")
    return file


def _check(model: mujoco.MjModel, name: str, good: np.ndarray, what: str) -> None:
    """Raise an InputError that names the element of the model whose numbers in an array are not good."""
    if good.all():
        return
    row = int(np.argmin(good.reshape(len(good), -1).all(axis=1)))
    values = getattr(model, name)[row]
    kind, _, field = name.partition("_")
    label = f"{kind} '{getattr(model, kind)(row).name or f'{kind}#{row}'}'" if _named(model, name) else f"a {kind}"
    raise InputError(f"{field} of {label} {what if np.isfinite(values).all() else 'is not finite'}; give plain numbers")


def _named(model: mujoco.MjModel, name: str) -> bool:
    """Whether an array of the model has a row for each element of a kind that has names."""
    kind, values = name.partition("_")[0], getattr(model, name)
    return hasattr(model, kind) and isinstance(values, np.ndarray) and getattr(model, f"n{kind}", -1) == len(values)


def fields_of(struct: Any) -> Iterator[tuple[str, Any]]:
    """Names and values of the public fields of one of MuJoCo's structs."""
    for name in dir(struct):
        value = getattr(struct, name)
        if not name.startswith("_") and not callable(value):
            yield name, value


def copy_fields(source: Any, target: Any) -> None:
    """Copy the public fields of one of MuJoCo's structs to another, nested structs included."""
    for name, value in fields_of(source):
        if isinstance(value, int | float | np.ndarray):
            setattr(target, name, value)
        else:
            copy_fields(value, getattr(target, name))


@contextmanager
def mujoco_warnings() -> Iterator[list[str]]:
    """Collect MuJoCo's warnings, one line each, instead of printing them and writing them to MUJOCO_LOG.TXT."""
    found: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: found.append(one_line(message)))
    try:
        yield found
    finally:
        mujoco.set_mju_user_warning(before)


@contextmanager
def warnings_refused(subject: str, error: type[ToolkitError] = InputError) -> Iterator[None]:
    """Make an error of MuJoCo's first warning, in one line that begins with the subject; also a decorator.

    What MuJoCo only warns of, such as contacts that it leaves out where its memory is full, makes a result worthless.
    """
    with mujoco_warnings() as found:
        yield
    if found:
        raise error(f"{subject}: MuJoCo warns: {found[0]}")


@contextmanager
def _caught() -> Iterator[list[str]]:
    """Collect all warnings, MuJoCo's and Python's, and turn MuJoCo's errors into ValueErrors."""
    try:
        with mujoco_warnings() as found, warnings.catch_warnings(record=True) as others:
            warnings.simplefilter("always")
            yield found
            found += [one_line(other.message) for other in others]
    except (mujoco.FatalError, MemoryError, RuntimeError) as error:  # the last where its C++ code finds no memory
        raise ValueError(one_line(error)) from error


def _take_assets(spec: mujoco.MjSpec, folder: Path, given: Mapping[str, bytes]) -> None:
    """Read a spec's files under short unique names, but those given; MuJoCo reads those of an attached model."""
    assets = dict(given)
    names: dict[Path, str] = {}

    def taken(name: str, directory: str) -> str:
        file = (folder / directory / (Path(name).name if spec.strippath else name)).resolve()
        if not name or name in given or not _regular(file).is_file():
            return name
        if file not in names:
            names[file] = file.name if file.name not in assets else f"{len(names)}_{file.name}"
            assets[names[file]] = file.read_bytes()
        return names[file]

    for item in [*spec.meshes, *spec.hfields, *spec.skins]:
        item.file = taken(item.file, spec.compiler.meshdir)
    for item in spec.textures:
        item.file = taken(item.file, spec.compiler.texturedir)
        item.cubefiles = [taken(name, spec.compiler.texturedir) for name in item.cubefiles]
    spec.compiler.meshdir = spec.compiler.texturedir = ""
    spec.strippath = False
    spec.assets = assets
