"""Random worlds whose answer is known: a way leads to the goal, or none does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toolkit.world.authoring import WorldText
from validation.map_families import FAMILIES, Axis
from validation.map_worlds import TIMING, anywhere

WIDTH = 1.6  # m; of the ground
_BEFORE, _AFTER = 0.9, 1.2  # m; ground before the first obstacle, from the start on, and after the last one
_BETWEEN = (0.8, 1.4)  # m; ground between two obstacles
_DEEP, _TALL = 1.0, 2.2  # m; thickness of the ground, and height of walls


class _Course:
    """A straight course of obstacles between two pieces of ground."""

    def __init__(self, rng: np.random.Generator):
        self._rng, self._parts = rng, list[tuple[tuple[float, ...], tuple[float, ...]]]()
        self._x, self._z = -0.8, 0.0
        self.ground(0.8 + _BEFORE)

    def ground(self, length: float, width: float = WIDTH) -> None:
        """Level ground."""
        self._box((length, width, _DEEP), (self._x + length / 2, 0.0, self._z - _DEEP / 2))
        self._x += length

    def _box(self, size: tuple[float, ...], centre: tuple[float, ...]) -> None:
        self._parts.append((size, centre))

    def gap(self, width: float) -> None:
        """A gap in the ground."""
        self._x += width

    def ledge(self, height: float) -> None:
        """A step, downwards where negative."""
        self._z += height

    def beam(self, width: float) -> None:
        """A narrow piece of ground."""
        self.ground(self._rng.uniform(0.5, 1.5), width)

    def bar(self, height: float) -> None:
        """A bar across the ground."""
        self._box((0.05, WIDTH, height), (self._x, 0.0, self._z + height / 2))

    def slot(self, width: float) -> None:
        """An opening in a wall, anywhere across the ground; 0: none."""
        depth = self._rng.uniform(0.05, 1.5)
        beyond = WIDTH / 2 + self._rng.uniform(0.0, 0.5)
        middle = self._rng.uniform(-1.0, 1.0) * max(WIDTH / 2 - width / 2 - 0.1, 0.0)
        for low, high in ((-beyond, middle - width / 2), (middle + width / 2, beyond)):
            centre = (self._x + depth / 2, (low + high) / 2, self._z + _TALL / 2)
            self._box((depth, high - low, _TALL), centre)
        self.ground(depth)

    def ceiling(self, height: float) -> None:
        """A ceiling over the ground."""
        length, thickness = self._rng.uniform(0.3, 1.5), self._rng.uniform(0.1, 0.5)
        across = WIDTH + self._rng.uniform(0.0, 1.0)
        self._box((length, across, thickness), (self._x + length / 2, 0.0, self._z + height + thickness / 2))
        self.ground(length)

    def text(self, name: str) -> str:
        """The world, moved and turned, as MJCF text."""
        self.ground(_AFTER)
        goal = (self._x - 0.7, 0.0, self._z)
        lowest = min(centre[2] - size[2] / 2 for size, centre in self._parts)
        world = WorldText(name, "obstacles in a row", float(self._rng.uniform(0.5, 0.9)), TIMING, goal, abyss=lowest)
        for index, (size, centre) in enumerate(self._parts):
            world.box(f"part_{index}", size, centre)
        return anywhere(world.render(), self._rng)


_Kind = tuple[Callable[[_Course, float], None], float, float]

_EASY: dict[str, _Kind] = {
    "gap": (_Course.gap, 0.05, 0.85),
    "ledge": (_Course.ledge, -0.42, 0.42),
    "slot": (_Course.slot, 0.5, 1.0),
    "ceiling": (_Course.ceiling, 1.5, 1.8),
    "bar": (_Course.bar, 0.05, 0.3),
    "beam": (_Course.beam, 0.16, 0.6),
}
"""Obstacles that can be passed, with their smallest and largest sizes in m."""
_HARD: dict[str, _Kind] = {
    "gap": (_Course.gap, 1.6, 2.5),
    "rise": (_Course.ledge, 0.8, 1.4),
    "drop": (_Course.ledge, -1.4, -0.8),
    "wall": (_Course.slot, 0.0, 0.0),
    "slot": (_Course.slot, 0.12, 0.22),
    "ceiling": (_Course.ceiling, 0.6, 1.0),
}
"""Obstacles that cannot be passed."""


def passable(rng: np.random.Generator) -> tuple[str, str]:
    """What a world is, and the world as MJCF text: of a family of the map, or a row of obstacles; there is a way."""
    if rng.random() < 0.5:
        name = str(rng.choice(list(FAMILIES)))
        family = FAMILIES[name]
        values = {axis.name: _between(rng, axis) for axis in family.axes}
        told = ", ".join(f"{key} {value:.3g}" for key, value in values.items())
        return f"{name}: {told}", anywhere(family.maker(rng, **values), rng)
    course, told = _Course(rng), []
    for _ in range(rng.integers(1, 4)):
        told.append(_add(course, _EASY, rng))
        course.ground(rng.uniform(*_BETWEEN))
    return ", ".join(told), course.text("passable")


def impassable(rng: np.random.Generator) -> tuple[str, str]:
    """What keeps a robot from the goal in a world, and the world as MJCF text: obstacles in a row, one impassable."""
    course, at = _Course(rng), int(rng.integers(0, 3))
    told = ""
    for index in range(int(rng.integers(at + 1, 4))):
        found = _add(course, _HARD if index == at else _EASY, rng)
        told = found if index == at else told
        course.ground(rng.uniform(*_BETWEEN))
    return told, course.text("impassable")


def _add(course: _Course, kinds: dict[str, _Kind], rng: np.random.Generator) -> str:
    """Add a random obstacle to a course; returns what it is."""
    name = str(rng.choice(list(kinds)))
    add, least, largest = kinds[name]
    size = float(rng.uniform(least, largest))
    add(course, size)
    return f"{name} {size:.2f} m"


def _between(rng: np.random.Generator, axis: Axis) -> float:
    """A value between the ends of an axis."""
    low, high = sorted((axis.easy, axis.hard))
    return float(rng.uniform(low, high))
