"""The table [mend] of a robot.toml: what is changed in a model file that cannot be used as it is."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from toolkit.robot.reader import Reader

_KEYS = (
    "rename_bodies", "rename_joints", "drop", "collision", "exclude", "up", "forward", "balance_inertia", "least_mass",
    "least_inertia", "up_axis", "without_tendons",
)  # fmt: skip
_GROUP = re.compile(r"group ([0-5])")


@dataclass(frozen=True)
class Box:
    """A box as the collision shape of a body.

    Attributes:
        centre: (3,) m, in the body.
        size: Full size (3,) m along the body's axes.
    """

    centre: tuple[float, ...]
    size: tuple[float, ...]


@dataclass(frozen=True)
class Mend:
    """What is changed in a model file.

    Attributes:
        bodies, joints: New names by old ones.
        drop: Patterns of bodies that are removed with everything below them.
        collision: What the collision shapes of bodies become, by pattern; the last that matches a body counts. "none"
            removes them, "box" is a box around them (or around what is drawn, where nothing collides), an int is the
            group whose shapes collide, and a `Box` stands for itself.
        exclude: Pairs of patterns of bodies that do not collide with each other.
        up: Direction (x, y, z) that points up in the axes of the file's base body, or None for its z axis. The axes are
            turned with it the shortest way.
        forward: Direction (x, y) of the toes in these axes, or None for their x axis.
        balance_inertia: Whether inertias that no body can have are evened out.
        up_axis: Whether COLLADA shapes are turned to have z up where their files say that y points up.
        without_tendons: Whether tendons are left out, with what they limit and pull.
        least_mass, least_inertia: Least mass in kg, and least principal inertia in kg m^2, of every body.
    """

    bodies: dict[str, str]
    joints: dict[str, str]
    drop: tuple[str, ...]
    collision: dict[str, str | int | Box]
    exclude: tuple[tuple[str, str], ...]
    up: tuple[float, ...] | None
    forward: tuple[float, float] | None
    balance_inertia: bool
    up_axis: bool
    without_tendons: bool
    least_mass: float
    least_inertia: float


def read_mend(reader: Reader, data: dict) -> Mend:
    """The table [mend]; nothing is changed where it is missing."""
    table = reader.table(data, "mend", _KEYS)
    up = forward = None
    if "up" in table:
        up = reader.numbers(table, "up", "mend.", 3)
        if np.linalg.norm(up) < 1e-3:
            reader.problems.add("'mend.up' is no direction; it is (x, y, z) of what points up in the axes of the base")
            up = None
    if "forward" in table:
        x, y = reader.numbers(table, "forward", "mend.", 2)
        if np.hypot(x, y) < 1e-3:
            reader.problems.add("'mend.forward' is no direction; it is (x, y) of the toes in the axes of the base")
        forward = x, y
    return Mend(
        bodies=_names(reader, table, "rename_bodies"),
        joints=_names(reader, table, "rename_joints"),
        drop=reader.texts(table, "drop", "mend."),
        collision={
            pattern: _shape(reader, value, f"mend.collision.{pattern}")
            for pattern, value in reader.table(table, "collision", None, "mend.").items()
        },
        exclude=_pairs(reader, table),
        up=up,
        forward=forward,
        balance_inertia=reader.flag(table, "balance_inertia", "mend."),
        up_axis=reader.flag(table, "up_axis", "mend."),
        without_tendons=reader.flag(table, "without_tendons", "mend."),
        least_mass=reader.numbers(table, "least_mass", "mend.", 1, default=(0.0,), lowest=0.0)[0],
        least_inertia=reader.numbers(table, "least_inertia", "mend.", 1, default=(0.0,), lowest=0.0)[0],
    )


def _names(reader: Reader, table: dict, key: str) -> dict[str, str]:
    names = reader.table(table, key, None, "mend.")
    return {old: reader.text(names, old, f"mend.{key}.", default=None) for old in names}


def _shape(reader: Reader, value: object, where: str) -> str | int | Box:
    if isinstance(value, str) and value in ("none", "box"):
        return value
    if isinstance(value, str) and (found := _GROUP.fullmatch(value)):
        return int(found.group(1))
    if isinstance(value, list) and len(value) == 2:
        return Box(reader.values(value[0], f"{where}.0", 3), reader.values(value[1], f"{where}.1", 3, lowest=1e-4))
    reader.problems.add(f"'{where}' = {value!r} must be 'none', 'box', 'group N' or [centre, full size] in m")
    return "none"


def _pairs(reader: Reader, table: dict) -> tuple[tuple[str, str], ...]:
    pairs = table.get("exclude", [])
    if isinstance(pairs, list) and all(
        isinstance(pair, list) and len(pair) == 2 and all(isinstance(name, str) for name in pair) for pair in pairs
    ):
        return tuple((first, second) for first, second in pairs)
    reader.problems.add(f"'mend.exclude' = {pairs!r} must be a list of pairs of body patterns")
    return ()
