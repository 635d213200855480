"""What a run is held against, as JSON in the run's files."""

from __future__ import annotations

from typing import Any

import numpy as np

from toolkit.execution.config import SCUFF_LIMIT
from toolkit.execution.standard import Move, Standard, Subject
from toolkit.geometry.limb import FEET, Limb
from toolkit.report.files import plain
from toolkit.robot.model import LimbModel
from toolkit.world.world import Goal

_NAMES = ("timestep", "decimation", "ticks", "slip_limit", "com_rms_limit", "scuff_limit")
_JOINTS = ("lower", "upper", "velocity_limit", "torque_limit")
MOST_TICKS = 10**7
"""More control ticks than any run has: hours."""


def standard_entry(standard: Standard) -> dict[str, Any]:
    """A standard as JSON; a limit that is infinite becomes null."""
    robot = standard.robot
    limbs = {
        limb.label: {"site": model.site, "body": model.body, "half_size": model.half_size, "rolls": model.rolls}
        for limb, model in sorted(robot.limbs.items())
    }
    names = ("name", "base", "joint_names", "com_height", *_JOINTS)
    return plain(
        {
            "robot": {name: getattr(robot, name) for name in names} | {"limbs": limbs},
            "goal": {name: getattr(standard.goal, name) for name in ("position", "radius", "floor")},
            **{name: getattr(standard, name) for name in _NAMES},
            "moves": [
                {"limb": move.limb.label, "start": move.start, "end": move.end, "target": move.target}
                for move in standard.moves
            ],
        }
    )


def read_standard(entry: dict[str, Any]) -> Standard:
    """Inverse of `standard_entry`; raises KeyError, TypeError or ValueError where the entry is broken."""
    robot, goal = entry["robot"], entry["goal"]
    count = len(robot["joint_names"])
    limbs = {}
    for label, model in robot["limbs"].items():
        limb = Limb.from_label(label)
        rolls = bool(model.get("rolls", False))  # older runs have none that do
        half_size = _finite(model["half_size"], 2)
        limbs[limb] = LimbModel(limb, str(model["site"]), str(model["body"]), half_size, rolls=rolls)
    if not set(FEET) <= set(limbs):
        raise ValueError(f"robot {robot['name']} has not both feet")
    subject = Subject(
        str(robot["name"]),
        str(robot["base"]),
        tuple(str(name) for name in robot["joint_names"]),
        limbs,
        _number(robot["com_height"]),
        *(_limits(robot[name], count) for name in _JOINTS),
    )
    timestep, decimation, ticks = _number(entry["timestep"]), int(entry["decimation"]), int(entry["ticks"])
    if not (0.0 < timestep < 1.0 and 0 < decimation < MOST_TICKS and 0 < ticks < MOST_TICKS):
        raise ValueError(f"{ticks} ticks of {decimation} steps of {timestep} s are no run")
    return Standard(
        subject,
        Goal(_finite(goal["position"], 3), _number(goal["radius"]), _floor(goal.get("floor"))),
        timestep,
        decimation,
        ticks,
        _number(entry["slip_limit"]),
        _number(entry["com_rms_limit"]),
        tuple(_read_move(move) for move in entry["moves"]),
        _number(entry.get("scuff_limit", SCUFF_LIMIT)),
    )


def _read_move(entry: dict[str, Any]) -> Move:
    """One planned move."""
    target = None if entry["target"] is None else _finite(entry["target"], 3)
    return Move(Limb.from_label(entry["limb"]), _number(entry["start"]), _number(entry["end"]), target)


def _floor(entry: list[float | None] | None) -> tuple[float, float]:
    """The heights of a goal's floor, where null is infinite; older runs have none."""
    low, high = entry or (None, None)
    return -np.inf if low is None else _number(low), np.inf if high is None else _number(high)


def _number(value: Any) -> float:
    """A finite number."""
    return float(_finite([value], 1)[0])


def _finite(values: list[float], count: int) -> np.ndarray:
    """(count,) float, all finite."""
    array = np.array(values, float)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise ValueError(f"{values} are not {count} finite numbers")
    return array


def _limits(values: list[float | None], count: int) -> np.ndarray:
    """(count,) float; null stands for infinite."""
    array = np.array([np.inf if value is None else value for value in values], float)
    if array.shape != (count,) or np.isnan(array).any():
        raise ValueError(f"{values} are not {count} limits")
    return array
