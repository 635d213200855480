"""Read a robot.toml strictly."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.mjcf import one_line
from toolkit.robot.mend_table import Mend, read_mend
from toolkit.robot.problems import Problems
from toolkit.robot.reader import Reader, suggestion

FILE_NAME = "robot.toml"

_TOP = (
    "description", "licence", "source", "model", "mend", "limbs", "home", "gains", "armature", "damping",
    "friction_loss", "limits", "declared",
)  # fmt: skip
_MODEL = ("file", "package", "robot_descriptions", "base", "locked_joints")
_LIMB = ("body", "site", "position", "quaternion_wxyz", "patch", "max_force", "pad")
_LIMITS = ("position", "velocity", "torque")
_HOME = ("keyframe", "flat_soles")


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
        file: Model file, relative to the folder of `path` or to the installed files of `package`; empty where
            `module` names it.
        package: Name of a Python distribution that contains the model file, or None.
        module: Name of the module of `robot_descriptions` that knows the model file, or None.
        base: Name of the base body.
        locked_joints: Positions at which joints are frozen, by pattern, rad.
        mend: What is changed in the model file.
        limbs: Contact limbs.
        keyframe: Keyframe of the model file whose joints are the home posture, but for `home`; None for zeros.
        flat_soles: Whether the ankles of the home posture are turned until the soles lie flat.
        home: Positions in the home posture, by pattern, rad.
        gains: Joint gains (kp, kd) by pattern.
        armature: Armature by pattern, kg m^2.
        damping, friction_loss: Passive damping and friction by pattern, N m s/rad and N m.
        position, velocity, torque: Limits by pattern that replace the model's: (lower, upper) in rad, rad/s and N m.
        declared: Numbers that tests compare with the compiled model.
    """

    path: Path
    description: str
    licence: str
    source: str
    file: str
    package: str | None
    module: str | None
    base: str
    locked_joints: dict[str, float]
    mend: Mend
    limbs: dict[Limb, LimbDescription]
    keyframe: str | None
    flat_soles: bool
    home: dict[str, float]
    gains: dict[str, tuple[float, float]]
    armature: dict[str, float]
    damping: dict[str, float]
    friction_loss: dict[str, float]
    position: dict[str, tuple[float, float]]
    velocity: dict[str, float]
    torque: dict[str, float]
    declared: dict[str, Any] = field(default_factory=dict)

    @property
    def tables(self) -> dict[str, Mapping[str, Any]]:
        """Tables by joint-name pattern, by name; those of joints that remain after some are locked."""
        return {
            "home": self.home,
            "gains": self.gains,
            "armature": self.armature,
            "damping": self.damping,
            "friction_loss": self.friction_loss,
            "limits.position": self.position,
            "limits.velocity": self.velocity,
            "limits.torque": self.torque,
        }


def read_description(path: Path) -> RobotDescription:
    """Read a robot.toml without looking up its names of bodies, sites and joints.

    Raises:
        RobotError: The file is missing or not valid TOML, or keys are unknown, missing or of the wrong kind; the
            message names all of them.
    """
    if path.exists() and not path.is_file():  # a device may be read without end
        raise RobotError(f"{path}: cannot be read (it is not a file)")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise RobotError(f"{path}: not valid TOML: {one_line(error)}") from None
    reader = Reader(Problems(path))
    reader.keys(data, _TOP, "")
    reader.numbers_within(data)
    model = reader.table(data, "model", _MODEL)
    limits = reader.table(data, "limits", _LIMITS)
    home = reader.table(data, "home", None)
    module = reader.text(model, "robot_descriptions", "model.") or None
    if module is not None and {"file", "package"} & set(model):
        reader.problems.add("model.robot_descriptions stands for model.file and model.package; leave those out")
    if module is not None and not module.isidentifier():
        reader.problems.add(
            f"model.robot_descriptions = '{module}' must be the name of a module, as 'atlas_v4_description'"
        )
    description = RobotDescription(
        path=path,
        description=reader.text(data, "description", ""),
        licence=reader.text(data, "licence", "", default=None),
        source=reader.text(data, "source", "", default=None),
        file=reader.text(model, "file", "model.", default=None if module is None else ""),
        package=reader.text(model, "package", "model.") or None,
        module=module,
        base=reader.text(model, "base", "model.", default=None),
        locked_joints=reader.patterns(model, "locked_joints", "model."),
        mend=read_mend(reader, data),
        limbs=_limbs(reader, data),
        keyframe=reader.text(home, "keyframe", "home.") or None,
        flat_soles=reader.flag(home, "flat_soles", "home."),
        home=reader.patterns(data, "home", "", but=_HOME),
        gains=reader.patterns(data, "gains", "", count=2, lowest=0.0),
        armature=reader.patterns(data, "armature", "", lowest=0.0),
        damping=reader.patterns(data, "damping", "", lowest=0.0),
        friction_loss=reader.patterns(data, "friction_loss", "", lowest=0.0),
        position=reader.patterns(limits, "position", "limits.", count=2),
        velocity=reader.patterns(limits, "velocity", "limits.", lowest=1e-6),
        torque=reader.patterns(limits, "torque", "limits.", lowest=1e-6),
        declared=reader.table(data, "declared", None),
    )
    reader.problems.check()
    return description


def match_joints(
    problems: Problems, table: str, patterns: Mapping[str, Any], joint_names: Iterable[str]
) -> dict[str, Any]:
    """Values by name of the joints that match a pattern; the last pattern that matches a joint is used.

    A pattern that matches no joint is noted among the problems.
    """
    names = tuple(joint_names)
    values: dict[str, Any] = {}
    for pattern, value in patterns.items():
        matched = [name for name in names if fnmatchcase(name, pattern)]
        if not matched:
            problems.add(f"[{table}] '{pattern}' matches no joint; {suggestion(pattern, names)}")
        values.update(dict.fromkeys(matched, value))
    return values


def _limbs(reader: Reader, data: dict) -> dict[Limb, LimbDescription]:
    labels = [limb.label for limb in Limb]
    tables = reader.table(data, "limbs", labels)
    for foot in FEET:
        if foot.label not in tables:
            reader.problems.add(f"[limbs.{foot.label}] is missing; both feet are needed")
    limbs = {}
    for label in (label for label in tables if label in labels):
        table, where = reader.table(tables, label, _LIMB, "limbs."), f"limbs.{label}."
        body, site = reader.text(table, "body", where) or None, reader.text(table, "site", where) or None
        if (body is None) == (site is None):
            reader.problems.add(f"[limbs.{label}] needs either 'body' or 'site'")
        quaternion = np.array(reader.numbers(table, "quaternion_wxyz", where, 4, default=(1.0, 0.0, 0.0, 0.0)))
        if not 0.99 < np.linalg.norm(quaternion) < 1.01:
            reader.problems.add(f"{where}quaternion_wxyz = {quaternion.tolist()} is not of unit length")
            quaternion = np.array([1.0, 0.0, 0.0, 0.0])
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
