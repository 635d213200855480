"""The worlds that the experiments run on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from toolkit.errors import InputError
from toolkit.world.generators import KINDS as GENERATORS
from toolkit.world.loader import load_world
from toolkit.world.scaling import Fit, fitted
from toolkit.world.world import World

WORLDS = Path(__file__).resolve().parent.parent / "worlds"
AUTHORED_TRIALS = 5  # seeds of a world that has nothing random


@dataclass(frozen=True)
class Kind:
    """A kind of world to test on.

    Attributes:
        generator: name in `toolkit.world.generators.KINDS`; "" for a file in worlds/.
        options: of the generator.
        random: whether a seed makes another world; else it only seeds the planner.
        ranges: of options that the seed draws, uniformly.
        few: whether `AUTHORED_TRIALS` seeds are enough, although a seed makes another world.
    """

    generator: str = ""
    options: dict[str, float] = field(default_factory=dict)
    random: bool = False
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    few: bool = False


KINDS = {
    "rubble_field": Kind("rubble_field", random=True),
    "rubble_corridor": Kind("rubble_corridor", random=True),
    "wide_gap": Kind("gap", {"width": 0.5}),
    "steep_slope_1m": Kind("slope", {"length": 1.0}),
    "steep_slope_2m": Kind("slope", {"length": 2.0}),
    "steep_slope_3m": Kind("slope", {"length": 3.0}),
}

DRAWN = {
    "rubble_field": KINDS["rubble_field"],
    "rubble_corridor": KINDS["rubble_corridor"],
    "any_slope": Kind("slope", random=True, ranges={"angle": (-18.0, 18.0), "length": (1.0, 3.0)}),
    "any_steep_slope": Kind("slope", random=True, ranges={"angle": (28.0, 32.0), "length": (1.5, 3.0)}),
    "any_stairs": Kind("stairs", random=True, ranges={"step_height": (0.06, 0.14), "tread": (0.28, 0.4)}),
    "any_stones": Kind("stepping_stones", random=True, ranges={"stone": (0.33, 0.4), "gap": (0.04, 0.08)}),
    "any_gap": Kind("gap", random=True, ranges={"width": (0.3, 0.55)}),
}
"""Kinds of which every seed makes another world."""

_FRICTION_ANGLE = 26.565  # deg; of the friction 0.5 that slopes have
SCALED = {
    "rubble_field": KINDS["rubble_field"],
    "rubble_corridor": KINDS["rubble_corridor"],
    "generated_stairs": Kind("stairs"),
    "generated_stones": Kind("stepping_stones", random=True, few=True),
    "generated_mesh": Kind("mesh_patches", random=True, few=True),
    "wide_gap": KINDS["wide_gap"],
    "resting_slope": Kind("slope", {"angle": _FRICTION_ANGLE - 3.0}),
    "rubble_field_20": Kind("rubble_field", {"tilt": 20.0}, random=True, few=True),
    "rubble_corridor_20": Kind("rubble_corridor", {"tilt": 20.0}, random=True, few=True),
}
"""Kinds for any robot, to the scale of its legs; tiles are as its ankles follow, or up to 20 deg as the paper's."""


@dataclass(frozen=True)
class Case:
    """One world and one seed.

    Attributes:
        kind: a key of `KINDS`, `DRAWN` or `SCALED`, or the name of a file in worlds/ without its ending.
        seed: of the world where it is random, and of everything that the run draws.
        options: of the generator, beyond those of the kind.
        fit: what the terrain has to be like for the robot; files in worlds/ stay as they are.
    """

    kind: str
    seed: int
    options: tuple[tuple[str, float], ...] = ()
    fit: Fit = Fit()  # noqa: B008

    @property
    def name(self) -> str:
        """Unique within an experiment."""
        options = "".join(f"-{name}{value:g}" for name, value in self.options)
        return f"{self.kind}{options}-{self.seed:04d}"

    def mjcf(self) -> str:
        """The world as MJCF text."""
        kind = kind_of(self.kind)
        if not kind.generator:
            return (WORLDS / f"{self.kind}.xml").read_text(encoding="utf-8")
        rng = np.random.default_rng(self.seed)
        drawn = {name: float(rng.uniform(*ends)) for name, ends in kind.ranges.items()}
        given = {**kind.options, **drawn, **dict(self.options)}
        return fitted(GENERATORS[kind.generator], rng, self.fit, given)

    def world(self) -> World:
        """The world, loaded."""
        return load_world(WORLDS / f"{self.name}.xml", mjcf=self.mjcf())


def kind_of(name: str) -> Kind:
    """The kind of a name.

    Raises:
        InputError: there is none.
    """
    known = {**KINDS, **DRAWN, **SCALED}
    if name in known:
        return known[name]
    files = sorted(path.stem for path in WORLDS.glob("*.xml"))
    if name not in files:
        raise InputError(f"--kinds {name}: choose from {', '.join(dict.fromkeys([*known, *files]))}")
    return Kind()


def make_cases(kinds: Sequence[str], trials: int, seed_offset: int, fit: Fit | None = None) -> list[Case]:
    """Cases of several kinds: `trials` seeds of a random one, `AUTHORED_TRIALS` at most where few are enough."""
    cases = []
    for kind in kinds:
        many = kind_of(kind).random and not kind_of(kind).few
        count = trials if many else min(trials, AUTHORED_TRIALS)
        cases += [Case(kind, seed_offset + index, fit=fit or Fit()) for index in range(count)]
    return cases
