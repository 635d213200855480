"""Worlds of the map to the scale of a robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from toolkit.world.loader import load_world
from toolkit.world.world import World
from validation.map_families import Cell

_LENGTHS = {"body": ("pos",), "geom": ("pos", "size"), "site": ("pos", "size"), "light": ("pos",), "hfield": ("size",)}
_DRAWN = {"statistic": ("center", "extent")}  # where pictures are taken from


def scaled(mjcf: str, factor: float) -> str:
    """A world with all its lengths times a factor; angles, friction and times stay.

    Knows what worlds of the map have: bodies without defaults of lengths, primitives, meshes and height fields.
    """
    root = ET.fromstring(mjcf, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    for name, attributes in {**_LENGTHS, **_DRAWN}.items():
        for element in root.iter(name):
            for attribute in attributes:
                text = element.get(attribute)
                if text is not None:
                    element.set(attribute, _times(text, factor))
    for mesh in root.iter("mesh"):
        mesh.set("scale", _times(mesh.get("scale", "1 1 1"), factor))
    return ET.tostring(root, encoding="unicode")


def mjcf_of(cell: Cell, factor: float) -> str:
    """The world of a cell to a scale, as MJCF text."""
    return cell.mjcf() if factor == 1.0 else scaled(cell.mjcf(), factor)


def world_of(cell: Cell, factor: float) -> World:
    """The same, loaded."""
    return load_world(f"{cell.name}.xml", mjcf=mjcf_of(cell, factor))


def _times(text: str, factor: float) -> str:
    return " ".join(repr(value) for value in (np.array(text.split(), float) * factor).tolist())
