"""Families of worlds that the map sweeps, and their cells."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from scipy.stats import qmc

from toolkit.world.loader import load_world
from toolkit.world.world import World
from validation import map_worlds
from validation.map_courses import course
from validation.map_worlds import BELOW, FRICTION

QUICK = 66  # worlds of a quick sweep
SEEDS = 3  # of each value of a whole sweep

_EVEN, _DRAWN = 21, 30  # values of a family with one parameter, and with two
_DIGITS = 4  # of a parameter, after the point
_REST = float(np.degrees(np.arctan(FRICTION))) - BELOW  # deg; steepest slope that is surely rested on


@dataclass(frozen=True)
class Axis:
    """A parameter of a family.

    Attributes:
        name: As the maker of the worlds calls it.
        label: For pictures, with the unit.
        easy, hard: Ends of the sweep.
    """

    name: str
    label: str
    easy: float
    hard: float


def along(axes: Sequence[Axis], values: Sequence[float]) -> tuple[float, ...]:
    """How hard values are, axis by axis: more is harder."""
    return tuple(value if axis.easy < axis.hard else -value for axis, value in zip(axes, values, strict=True))


@dataclass(frozen=True)
class Family:
    """Worlds that differ in one or two parameters.

    Attributes:
        name: Names cells and files.
        axes: Parameters.
        maker: The world as MJCF text, from a generator and the values of the parameters.
        count: Number of values; one axis is swept evenly, two are drawn with low discrepancy (Halton's sequence).
        hardness: Numbers of which each is greater where a world is harder, from the values; None for those of the axes.
    """

    name: str
    axes: tuple[Axis, ...]
    maker: Callable[..., str]
    count: int = _EVEN
    hardness: Callable[[Sequence[float]], tuple[float, ...]] | None = None

    def values(self) -> list[tuple[float, ...]]:
        """Values of the whole sweep."""
        if len(self.axes) == 1:
            axis = self.axes[0]
            return [(round(float(value), _DIGITS),) for value in np.linspace(axis.easy, axis.hard, self.count)]
        sequence = qmc.Halton(len(self.axes), scramble=False)
        sequence.fast_forward(1)  # the first point is the corner
        ends = np.array([[axis.easy, axis.hard] for axis in self.axes])
        points = ends[:, 0] + sequence.random(self.count) * (ends[:, 1] - ends[:, 0])
        return [tuple(round(float(value), _DIGITS) for value in point) for point in points]

    def hard(self, values: Sequence[float]) -> tuple[float, ...]:
        """How hard values are (see `hardness`)."""
        return along(self.axes, values) if self.hardness is None else self.hardness(values)


@dataclass(frozen=True)
class Cell:
    """One world of a family and one seed, which decides what is random in it, its place, and the planner's draws.

    Attributes:
        family: A key of `FAMILIES`.
        values: Of the family's parameters.
        seed: Of everything that is drawn.
    """

    family: str
    values: tuple[float, ...]
    seed: int

    @property
    def name(self) -> str:
        """Unique; can name a file."""
        return "-".join([self.family, *(f"{value:g}" for value in self.values), str(self.seed)])

    def mjcf(self) -> str:
        """The world, moved and turned, as MJCF text."""
        family = FAMILIES[self.family]
        ground, place = np.random.default_rng([zlib.crc32(self.name.encode()), self.seed]).spawn(2)
        options = {axis.name: value for axis, value in zip(family.axes, self.values, strict=True)}
        return map_worlds.anywhere(family.maker(ground, **options), place)

    def world(self) -> World:
        """The world, loaded."""
        return load_world(f"{self.name}.xml", mjcf=self.mjcf())


def cells_of(names: Sequence[str], *, quick: bool, seeds: int | None = None, first: int = 0) -> list[Cell]:
    """Cells of some families, which take turns; those of a quick sweep are among those of the whole one.

    Every value comes once before any comes with another seed, and the first ones lie far apart (the hardest, the
    easiest, ...), so that a sweep that is not over yet shows the whole range.

    Args:
        names: Of families.
        quick: Whether to take `QUICK` worlds in all.
        seeds: Seeds of each value; None for `SEEDS`, and for one in a quick sweep.
        first: The first seed.
    """
    seeds = (1 if quick else SEEDS) if seeds is None else seeds
    sweeps = []
    for name in names:
        values = FAMILIES[name].values()
        if quick:
            values = _some(FAMILIES[name], values, max(1, QUICK // (len(names) * seeds)))
        sweeps.append(_spread(values) if len(FAMILIES[name].axes) == 1 else values)
    turns = [
        [(name, each) for name, each in zip(names, turn, strict=True) if each is not None]
        for turn in zip_longest(*sweeps)
    ]
    return [Cell(name, each, first + seed) for seed in range(seeds) for turn in turns for name, each in turn]


def _spread(values: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Evenly spaced values, the last one first, in an order in which each is as far as possible from those before."""
    order = [len(values) - 1]
    while len(order) < len(values):
        left = (index for index in range(len(values)) if index not in order)
        order.append(max(left, key=lambda index: min(abs(index - other) for other in order)))
    return [values[index] for index in order]


def _some(family: Family, values: list[tuple[float, ...]], count: int) -> list[tuple[float, ...]]:
    """So many of a family's values: evenly spread where they are, else the first draws, which are spread as well."""
    count = min(count, len(values))
    if len(family.axes) > 1:
        return values[:count]
    return [values[int((index + 0.5) * len(values) / count)] for index in range(count)]


_STONES = (Axis("gap", "between stones [m]", 0.05, 0.25), Axis("stone", "stone [m]", 0.4, 0.24))
_RUBBLE = (Axis("tilt", "roll and pitch up to [deg]", 0.0, 25.0), Axis("friction", "friction", 0.9, 0.35))


def _angle(easy: float, hard: float) -> tuple[Axis]:
    return (Axis("angle", "angle [deg]", easy, hard),)


def _height(easy: float, hard: float) -> tuple[Axis]:
    return (Axis("height", "height [m]", easy, hard),)


def _width(easy: float, hard: float) -> tuple[Axis]:
    return (Axis("width", "width [m]", easy, hard),)


def _steep_and_long(values: Sequence[float]) -> tuple[float, ...]:
    """A slope is harder if it is steeper and not shorter."""
    return values[0], map_worlds.slope_length(values[0])


FAMILIES: dict[str, Family] = {
    family.name: family
    for family in (
        Family("gap", _width(0.05, 0.5), map_worlds.gap),
        Family("slope_down", _angle(5.0, 32.0), map_worlds.slope_down, 28, _steep_and_long),
        Family("slope_up", _angle(2.0, _REST), map_worlds.slope_up),
        Family("slope_across", _angle(2.0, _REST), map_worlds.slope_across),
        Family("stairs_up", _height(0.05, 0.25), map_worlds.stairs_up),
        Family("stairs_down", _height(0.05, 0.25), map_worlds.stairs_down),
        Family("step_up", _height(0.02, 0.4), map_worlds.step_up, 20),
        Family("step_down", _height(0.02, 0.4), map_worlds.step_down, 20),
        Family("stones_level", _STONES, map_worlds.stones, _DRAWN),
        Family("stones_uneven", _STONES, map_worlds.uneven_stones, _DRAWN),
        Family("beam", _width(0.5, 0.18), map_worlds.beam),
        Family("bar", _height(0.05, 0.3), map_worlds.bar),
        Family("ceiling", _height(1.8, 1.5), map_worlds.ceiling),
        Family("door", _width(1.0, 0.5), map_worlds.door),
        Family("slot", _width(1.0, 0.5), map_worlds.slot),
        Family("turn", _angle(0.0, 180.0), map_worlds.turn),
        Family("rubble_field", _RUBBLE, map_worlds.rubble_field, _DRAWN),
        Family("rubble_corridor", _RUBBLE, map_worlds.rubble_corridor, _DRAWN),
        Family("mesh_ground", _height(0.0, 0.08), map_worlds.mesh_ground),
        Family("field_ground", _height(0.0, 0.08), map_worlds.field_ground),
        Family("hills", _height(0.0, 0.12), map_worlds.hills),
        Family("course", (Axis("turn", "turns of [deg]", 0.0, 90.0),), course),
    )
}
