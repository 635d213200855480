"""Worlds to the scale of a robot: the sizes of random terrain are made for one length of leg."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import numpy as np

from toolkit.geometry.limb import FEET
from toolkit.robot.model import RobotModel
from toolkit.world.authoring import numbers

_LEG = 0.8  # m from hip to ankle; the sizes of the generators are made for it
_LENGTHS = ("pos", "size", "vertex", "center", "extent")  # attributes that hold lengths


def scale_of(robot: RobotModel) -> float:
    """Length of a robot's legs over that for which the sizes of random terrain are made."""
    leg = robot.legs[FEET[0]]
    return (leg.thigh + leg.shin) / _LEG


def steepest_tile(robot: RobotModel) -> float:
    """Largest roll in deg of ground on which the soles can lie flat while the legs are upright."""
    ranges = (robot.legs[foot].ranges["ankle_roll"] for foot in FEET)
    return math.degrees(min(abs(end) for bounds in ranges for end in bounds))


def scaled(mjcf: str, factor: float) -> str:
    """A generated world with all its lengths multiplied by a factor; angles, times and friction stay."""
    root = ElementTree.fromstring(mjcf, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)))
    for element in root.iter():
        for name in _LENGTHS:
            value = element.get(name)
            if value is not None:
                element.set(name, numbers(factor * np.array(value.split(), float)))
    return ElementTree.tostring(root, encoding="unicode")
