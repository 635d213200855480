"""Read a robot.toml strictly."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.mjcf import one_line

FILE_NAME = "robot.toml"

_TOP = ("description", "licence", "source", "model", "limbs", "home", "gains", "armature", "limits", "declared")
_MODEL = ("file", "package", "base", "locked_joints")
_LIMB = ("body", "site", "position", "quaternion_wxyz", "patch", "max_force", "pad")
_LIMITS = ("position", "velocity", "torque")
_MOST = 1e9  # largest number that is accepted


@dataclass(frozen=True)
class LimbDescription:
    """A contact limb in robot.toml.

    Attributes:
        limb: The limb.
        body: Body that carries the patch, or None if `site` is given.
        site: Site of the model file at the patch, or None if `body` is given.
        pose: Pose of the contact frame in the body or in the site.
        patch: Full extents (2,) float of the patch along x and y, m.
        max_force: Largest normal force, N.
        pad: Thickness of a box added under the patch as its collision shape, m; None for no box.
    """

    limb: Limb
    body: str | None
    site: str | None
    pose: Pose
    patch: np.ndarray
    max_force: float
    pad: float | None


@dataclass(frozen=True)
class RobotDescription:
    """A robot.toml, checked as far as possible without the model.

    Pattern tables map joint-name patterns (`fnmatch`, case sensitive) to values; the last match of a joint is used.

    Attributes:
        path: The robot.toml.
        description, licence, source: Free text.
        file: Model file, relative to the folder of `path` or to the installed files of `package`.
        package: Name of a Python distribution that contains the model file, or None.
        base: Name of the base body.
        locked_joints: Positions at which joints are frozen, by pattern, rad.
        limbs: Contact limbs.
        home: Positions in the home posture, by pattern, rad.
        gains: Joint gains (kp, kd) by pattern.
        armature: Armature by pattern, kg m^2.
        position, velocity, torque: Limits by pattern that replace the model's: (lower, upper) in rad, rad/s and N m.
        declared: Numbers that tests compare with the compiled model.
    """

    path: Path
    description: str
    licence: str
    source: str
    file: str
    package: str | None
    base: str
    locked_joints: dict[str, float]
    limbs: dict[Limb, LimbDescription]
    home: dict[str, float]
    gains: dict[str, tuple[float, float]]
    armature: dict[str, float]
    position: dict[str, tuple[float, float]]
    velocity: dict[str, float]
    torque: dict[str, float]
    declared: dict[str, Any] = field(default_factory=dict)


def suggestion(name: str, allowed: Iterable[str]) -> str:
    """End of an error message: the allowed name that is close to the given one, or all allowed names."""
    allowed = sorted(allowed)
    close = get_close_matches(name, allowed, n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else f"allowed: {', '.join(allowed) or 'none'}"


def read_description(path: Path) -> RobotDescription:
    """Read a robot.toml without looking up its names of bodies, sites and joints.

    Raises:
        RobotError: The file is missing or not valid TOML, or a key is unknown, missing or of the wrong kind.
    """
    if path.exists() and not path.is_file():  # a device may be read without end
        raise RobotError(f"{path}: cannot be read (it is not a file)")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise RobotError(f"{path}: not valid TOML: {one_line(error)}") from None
    reader = _Reader(path)
    reader.keys(data, _TOP, "")
    reader.numbers_within(data, "")
    model = reader.table(data, "model", _MODEL)
    limits = reader.table(data, "limits", _LIMITS)
    return RobotDescription(
        path=path,
        description=reader.text(data, "description", ""),
        licence=reader.text(data, "licence", "", default=None),
        source=reader.text(data, "source", "", default=None),
        file=reader.text(model, "file", "model.", default=None),
        package=reader.text(model, "package", "model.") or None,
        base=reader.text(model, "base", "model.", default=None),
        locked_joints=reader.patterns(model, "locked_joints", "model."),
        limbs=_limbs(reader, data),
        home=reader.patterns(data, "home", ""),
        gains=reader.patterns(data, "gains", "", count=2, lowest=0.0),
        armature=reader.patterns(data, "armature", "", lowest=0.0),
        position=reader.patterns(limits, "position", "limits.", count=2),
        velocity=reader.patterns(limits, "velocity", "limits.", lowest=1e-6),
        torque=reader.patterns(limits, "torque", "limits.", lowest=1e-6),
        declared=reader.table(data, "declared", None),
    )


def match_joints(path: Path, table: str, patterns: Mapping[str, Any], joint_names: Iterable[str]) -> dict[str, Any]:
    """Values by name of the joints that match a pattern; the last pattern that matches a joint is used.

    Raises:
        RobotError: A pattern matches no joint; the message names the robot.toml and the table.
    """
    names = tuple(joint_names)
    values: dict[str, Any] = {}
    for pattern, value in patterns.items():
        matched = [name for name in names if fnmatchcase(name, pattern)]
        if not matched:
            raise RobotError(f"{path}: [{table}] '{pattern}' matches no joint; {suggestion(pattern, names)}")
        values.update(dict.fromkeys(matched, value))
    return values


def _limbs(reader: _Reader, data: dict) -> dict[Limb, LimbDescription]:
    labels = [limb.label for limb in Limb]
    tables = reader.table(data, "limbs", labels)
    for foot in FEET:
        if foot.label not in tables:
            raise RobotError(f"{reader.path}: [limbs.{foot.label}] is missing; both feet are needed")
    limbs = {}
    for label in tables:
        table, where = reader.table(tables, label, _LIMB, "limbs."), f"limbs.{label}."
        body, site = reader.text(table, "body", where) or None, reader.text(table, "site", where) or None
        if (body is None) == (site is None):
            raise RobotError(f"{reader.path}: [limbs.{label}] needs either 'body' or 'site'")
        quaternion = np.array(reader.numbers(table, "quaternion_wxyz", where, 4, default=(1.0, 0.0, 0.0, 0.0)))
        if not 0.99 < np.linalg.norm(quaternion) < 1.01:
            raise RobotError(f"{reader.path}: {where}quaternion_wxyz = {quaternion.tolist()} is not of unit length")
        position = np.array(reader.numbers(table, "position", where, 3, default=(0.0, 0.0, 0.0)))
        limb = Limb.from_label(label)
        limbs[limb] = LimbDescription(
            limb=limb,
            body=body,
            site=site,
            pose=Pose.from_quaternion(position, quaternion),
            patch=np.array(reader.numbers(table, "patch", where, 2, lowest=1e-3)),
            max_force=reader.numbers(table, "max_force", where, 1, default=(float("inf"),), lowest=1e-6)[0],
            pad=reader.numbers(table, "pad", where, 1, lowest=1e-3)[0] if "pad" in table else None,
        )
    return dict(sorted(limbs.items()))


@dataclass(frozen=True)
class _Reader:
    """Typed access to tables; error messages name the file and the key."""

    path: Path

    def keys(self, table: dict, allowed: Iterable[str], where: str) -> None:
        for key in table:
            if key not in allowed:
                raise RobotError(f"{self.path}: unknown key '{where}{key}'; {suggestion(key, allowed)}")

    def numbers_within(self, item: Any, where: str) -> None:
        """Raise if a number at any depth is not finite or too large."""
        if isinstance(item, dict | list):
            for key, value in item.items() if isinstance(item, dict) else enumerate(item):
                self.numbers_within(value, f"{where}.{key}".lstrip("."))
        elif isinstance(item, int | float) and not abs(item) <= _MOST:
            raise RobotError(f"{self.path}: '{where}' = {str(item)[:20]} must be a finite number up to {_MOST:g}")

    def table(self, data: dict, key: str, allowed: Iterable[str] | None, where: str = "") -> dict:
        table = data.get(key, {})
        if not isinstance(table, dict):
            raise RobotError(f"{self.path}: '{where}{key}' must be a table")
        if allowed is not None:
            self.keys(table, allowed, f"{where}{key}.")
        return table

    def text(self, table: dict, key: str, where: str, default: str | None = "") -> str:
        value = table.get(key, default)
        if value is None:
            raise RobotError(f"{self.path}: '{where}{key}' is missing")
        if not isinstance(value, str) or (default is None and not value):
            raise RobotError(f"{self.path}: '{where}{key}' = {value!r} must be text")
        return value

    def numbers(
        self, table: dict, key: str, where: str, count: int, default: tuple | None = None, lowest: float = -np.inf
    ) -> tuple[float, ...]:
        if key not in table and default is not None:
            return default
        return self._check(table.get(key), f"{where}{key}", count, lowest)

    def patterns(self, data: dict, key: str, where: str, count: int = 1, lowest: float = -np.inf) -> dict[str, Any]:
        table = self.table(data, key, None, where)
        values = {name: self._check(v, f"{where}{key}.{name}", count, lowest) for name, v in table.items()}
        return {name: v[0] for name, v in values.items()} if count == 1 else values

    def _check(self, value: Any, where: str, count: int, lowest: float) -> tuple[float, ...]:
        values = value if count > 1 else [value]
        kind = "a number" if count == 1 else f"{count} numbers"
        if value is None:
            raise RobotError(f"{self.path}: '{where}' is missing; it is {kind}")
        good = isinstance(values, list) and len(values) == count
        good = good and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
        if not good or min(values) < lowest:
            bound = f" of at least {lowest:g}" if np.isfinite(lowest) else ""
            raise RobotError(f"{self.path}: '{where}' = {value!r} must be {kind}{bound}")
        return tuple(float(v) for v in values)
