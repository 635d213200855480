"""Generators of terrain without anything random: stairs, a gap, a slope."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.world.authoring import THICKNESS, WorldText


def stairs(
    rng: np.random.Generator,
    *,
    steps: int = 4,
    step_height: float = 0.12,
    tread: float = 0.32,
    width: float = 1.2,
    friction: float = 0.7,
    shift: float = 0.4,
    swing: float = 0.6,
) -> str:
    """A flight of stairs upwards to a landing.

    Args:
        rng: Not used.
        steps: Number of steps, the landing included.
        step_height: Height of a step, m; negative for stairs downwards.
        tread: Depth of a step, m.
        width: Width of the stairs, m.
        friction: Sliding coefficient.
        shift: Time of a shift, s.
        swing: Time of a swing, s.
    """
    del rng
    begin = 0.45
    end = begin + (steps - 1) * tread
    top = steps * step_height
    world = WorldText(
        "stairs",
        f"{steps} steps of {step_height:g} m, treads of {tread:g} m",
        friction,
        (shift, swing),
        (end + 0.65, 0.0, top),
        abyss=min(0.0, top) - 0.1,
    )
    base = min(0.0, top) - 0.1
    edges = [-0.8, *(begin + tread * np.arange(steps)), end + 1.4]
    for index, (left, right) in enumerate(zip(edges, edges[1:], strict=False)):
        height = index * step_height
        name = "floor" if index == 0 else f"step_{index}" if index < steps else "landing"
        world.box(name, (right - left, width, height - base), ((left + right) / 2, 0.0, (height + base) / 2))
    return world.render()


def gap(
    rng: np.random.Generator, *, width: float = 0.5, friction: float = 0.5, shift: float = 0.6, swing: float = 0.8
) -> str:
    """Two platforms with a gap between them.

    Args:
        rng: Not used.
        width: Width of the gap, m.
        friction: Sliding coefficient.
        shift: Time of a shift, s.
        swing: Time of a swing, s.
    """
    del rng
    edge = 0.6
    world = WorldText(
        "gap", f"two platforms, {width:g} m apart", friction, (shift, swing), (edge + width + 0.7, 0.0, 0.0)
    )
    world.platform("platform_start", (-0.6, edge), 1.2)
    world.platform("platform_goal", (edge + width, edge + width + 1.3), 1.2)
    return world.render()


def slope(
    rng: np.random.Generator,
    *,
    length: float = 3.0,
    angle: float = 30.0,
    width: float = 1.0,
    friction: float = 0.5,
    shift: float = 0.0,
    swing: float = 0.0,
) -> str:
    """A slope downwards, level above and below.

    Args:
        rng: Not used.
        length: Length along the slope, m.
        angle: Angle of the slope, deg; negative for a slope upwards.
        width: Width of the slope, m.
        friction: Sliding coefficient.
        shift: Time of a shift, s; 0 as the swing is: the planner chooses both.
        swing: Time of a swing, s.
    """
    del rng
    edge, tilt = 0.4, np.radians(angle)
    top, run = length * np.sin(tilt), length * np.cos(tilt)
    world = WorldText(
        "slope",
        f"a slope of {angle:g} degrees, {length:g} m long, level above and below",
        friction,
        (shift, swing) if shift or swing else None,
        (edge + run + 1.0, 0.0, 0.0),
        start=(0.0, 0.0, top),
        abyss=min(0.0, top) - THICKNESS - 0.01,
    )
    world.platform("platform_start", (-0.8, edge), width, top)
    turn = Rotation.from_euler("y", angle, degrees=True)
    world.tile("slope", (length, width), (edge + run / 2, 0.0, top / 2), material="slope", rotation=turn)
    world.platform("platform_goal", (edge + run, edge + run + 2.0), width)
    return world.render()
