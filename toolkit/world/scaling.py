"""Terrain in proportion to a robot: a generated world, larger or smaller by the length of the robot's legs."""

from __future__ import annotations

import inspect
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.geometry.limb import FEET
from toolkit.robot.model import RobotModel
from toolkit.world.authoring import numbers

_ANKLE_MARGIN = 0.1  # rad; ankles stay so far inside their range on the steepest tile
_ROOM = 0.05  # m; least room of a sole on its tile, along its longer side, for legs of the usual length
_TIMES = ("shift", "swing")  # options of generators that are times
_EDGES = ("tile", "stone")  # options of generators that are edges of what a single sole stands on
_LENGTHS = {
    "statistic": ("center", "extent"),
    "light": ("pos",),
    "geom": ("pos", "size"),
    "site": ("pos", "size"),
    "body": ("pos",),
    "mesh": ("vertex",),
    "hfield": ("size",),
}


@dataclass(frozen=True)
class Fit:
    """What terrain has to be like for a robot.

    Attributes:
        factor: Lengths, as a multiple of the generators'.
        tilt: Largest roll and pitch of a tile that the ankles follow, deg.
        edge: Least edge of a tile that holds a sole, m.
    """

    factor: float = 1.0
    tilt: float = 90.0
    edge: float = 0.0

    @classmethod
    def of(cls, robot: RobotModel) -> Fit:
        """The fit to a robot; one of the usual size gets the usual worlds."""
        legs = [robot.legs[foot] for foot in FEET]
        ends = [abs(end) for leg in legs for role in ("ankle_roll", "ankle_pitch") for end in leg.ranges[role]]
        tilt = float(np.floor(np.degrees(max(min(ends) - _ANKLE_MARGIN, 0.0))))
        soles = robot.half_sizes[list(FEET)]
        factor = robot.scale.length
        return cls(factor, tilt, round(float(2.0 * soles.max() + factor * _ROOM), 3))


def fitted(generator: Callable[..., str], rng: np.random.Generator, fit: Fit, given: Mapping[str, float]) -> str:
    """A world of a generator that fits a robot, as MJCF text.

    All lengths are multiplied by the fit's factor. Times are multiplied by its root, as those of a pendulum are. Tiles
    are no steeper than the robot's ankles follow, and large enough for its soles.

    Args:
        generator: One of `toolkit.world.generators.KINDS`.
        rng: Source of everything random.
        fit: The fit to the robot.
        given: Options of the generator. Times and tilts among them stay as they are; lengths are those before the
            world is scaled.

    Raises:
        ValueError: The options make no world.
    """
    options: dict[str, float] = dict(given)
    for name, usual in _defaults(generator).items():
        if name in _TIMES and name not in given:
            options[name] = round(usual * float(np.sqrt(fit.factor)), 3)
        if name == "tilt" and name not in given:
            options[name] = min(usual, fit.tilt)
        if name in _EDGES and name not in given:
            options[name] = max(usual, round(fit.edge / fit.factor, 3))
    return scaled(generator(rng, **options), fit.factor)


def _defaults(generator: Callable[..., str]) -> dict[str, float]:
    parameters = inspect.signature(generator).parameters.values()
    return {item.name: item.default for item in parameters if item.kind is inspect.Parameter.KEYWORD_ONLY}


def scaled(mjcf: str, factor: float) -> str:
    """A generated world with all its lengths multiplied by a factor; angles, times and friction stay."""
    if factor == 1.0:
        return mjcf
    root = ElementTree.fromstring(mjcf)
    for element in root.iter():
        for name in _LENGTHS.get(element.tag, ()):
            if element.get(name) is not None:
                element.set(name, numbers(factor * np.array(element.get(name, "").split(), float)))
    return ElementTree.tostring(root, encoding="unicode") + "\n"
