"""Kinds of random worlds that a data set of motions goes through, with the ranges that their options are drawn from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from toolkit.world.authoring import WorldText
from toolkit.world.generators import KINDS as GENERATORS

FRICTION, SHIFT, SWING = (0.5, 0.8), (0.3, 0.7), (0.6, 0.9)
"""Ranges of the friction and of the times of a shift and a swing in s, in every kind."""


@dataclass(frozen=True)
class Kind:
    """A kind of random worlds.

    Attributes:
        make: The world as MJCF text, from a generator of random numbers and the options.
        numbers: Range of each option that is a number.
        counts: Least and greatest value of each option that is a count.
        mirrored: Option whose sign is drawn as well, so that what leads up leads down too; "" for none.
    """

    make: Callable[..., str]
    numbers: dict[str, tuple[float, float]]
    counts: dict[str, tuple[int, int]] = field(default_factory=dict)
    mirrored: str = ""


def flat(
    rng: np.random.Generator, *, distance: float, bearing: float, friction: float, shift: float, swing: float
) -> str:
    """Level ground, with the goal `distance` m away, at a `bearing` in degrees from the robot's heading."""
    del rng
    way = np.radians(bearing)
    goal = (distance * float(np.cos(way)), distance * float(np.sin(way)), 0.0)
    world = WorldText("flat", f"level ground, the goal {distance:.2f} m away", friction, (shift, swing), goal)
    world.platform("ground", (-5.0, 5.0), 10.0)
    return world.render()


_RUBBLE = {"tilt": (4.0, 20.0), "rise": (0.01, 0.05)}
KINDS = {
    "flat": Kind(flat, {"distance": (1.0, 4.0), "bearing": (-60.0, 60.0)}),
    "rubble_field": Kind(GENERATORS["rubble_field"], _RUBBLE, {"rows": (2, 6)}),
    "rubble_corridor": Kind(
        GENERATORS["rubble_corridor"], _RUBBLE | {"wall": (0.6, 0.75), "wall_tilt": (0.0, 20.0)}, {"rows": (2, 6)}
    ),
    "stepping_stones": Kind(
        GENERATORS["stepping_stones"],
        {"stone": (0.32, 0.4), "gap": (0.02, 0.1), "tilt": (0.0, 14.0), "rise": (0.0, 0.04)},
        {"rows": (3, 6)},
    ),
    "stairs": Kind(
        GENERATORS["stairs"], {"step_height": (0.04, 0.14), "tread": (0.28, 0.4)}, {"steps": (2, 6)}, "step_height"
    ),
    "gap": Kind(GENERATORS["gap"], {"width": (0.1, 0.55)}),
    "slope": Kind(GENERATORS["slope"], {"length": (1.0, 3.0), "angle": (3.0, 18.0)}, {}, "angle"),
    "mesh_patches": Kind(GENERATORS["mesh_patches"], {"tilt": (0.0, 12.0), "rise": (0.0, 0.03)}, {"rows": (4, 9)}),
}


def random_world(name: str, rng: np.random.Generator) -> tuple[str, dict[str, float]]:
    """A random world of one of the `KINDS`: its MJCF text, and the options that were drawn."""
    kind = KINDS[name]
    ranges = kind.numbers | {"friction": FRICTION, "shift": SHIFT, "swing": SWING}
    options: dict[str, float] = {option: round(float(rng.uniform(*ends)), 4) for option, ends in ranges.items()}
    options |= {option: int(rng.integers(low, high + 1)) for option, (low, high) in kind.counts.items()}
    if kind.mirrored and rng.random() < 0.5:
        options[kind.mirrored] *= -1.0
    return kind.make(rng, **options), options
