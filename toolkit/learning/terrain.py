"""Random worlds of every kind for collections, with random ways through them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.geometry.pose import Pose
from toolkit.learning.collect_config import CollectConfig
from toolkit.world import generators, regular
from toolkit.world.authoring import WorldText
from toolkit.world.loader import load_world
from toolkit.world.scaling import scaled
from toolkit.world.world import Goal, World

TILE = 0.4  # m; edge of the square tiles
DISTANCE = (0.45, 0.8)  # m; range of a wall's distance from the start at the height of its middle
BEARING = 45.0  # deg; largest angle of a wall before or behind the robot's side
_TURNED = 25.0  # deg; deviation of the heading at the start
_BACK = 0.3  # share of ways from the goal to the start
_SHORT = 0.3  # share of ways that end before the goal
_ASIDE = 0.12  # m; deviation of such an end to the side


def tiles_and_walls(
    rng: np.random.Generator, walls: int, tilt: float = 20.0, rise: float = 0.05, friction: float = 0.5
) -> str:
    """MJCF text of 3 x 3 tiles with up to two walls (paper, Sec. VI, Fig. 3); the start is on the middle tile.

    Roll and pitch of tiles and the lean of walls stay within `tilt` degrees, and heights of tiles within `rise` m.
    """
    towards = rng.uniform(-np.pi, np.pi)
    goal = (1.2 * TILE * np.cos(towards), 1.2 * TILE * np.sin(towards), 0.0)
    world = WorldText("training", "tilted tiles and walls", friction, (1.0, 1.0), goal, (0.0, 0.0, 0.05))
    for row in range(3):
        for column in range(3):
            turn = Rotation.from_euler("xy", rng.uniform(-tilt, tilt, 2), degrees=True)
            height = 0.0 if row == column == 1 else rng.uniform(-rise, rise)
            top = ((row - 1) * TILE, (column - 1) * TILE, height)
            world.tile(f"tile_{row}_{column}", (TILE, TILE), top, rotation=turn)
    first = rng.choice([-1.0, 1.0])
    for number, side in enumerate((first, -first)[:walls]):
        bearing = side * np.radians(90.0 + rng.uniform(-BEARING, BEARING))
        lean = np.radians(rng.uniform(-tilt, tilt))
        # z of the panel points back at the robot and leans up or down.
        turn = Rotation.from_euler("ZY", [bearing, lean - np.pi / 2])
        centre = rng.uniform(*DISTANCE) * np.array([np.cos(bearing), np.sin(bearing), 0.0]) + [0.0, 0.0, 1.1]
        world.tile(f"wall_{number}", (1.4, 1.8), centre, material="panel", rotation=turn)
    return world.render()


def passage(rng: np.random.Generator, friction: float) -> str:
    """MJCF text of level ground between two even walls that stand at random distances."""
    length, goal = rng.uniform(1.5, 3.0), (rng.uniform(0.8, 2.0), 0.0, 0.0)
    world = WorldText("passage", "level ground between walls", friction, (0.6, 0.8), goal)
    world.platform("ground", (-0.8, length), 1.6)
    for side, name in ((1.0, "left"), (-1.0, "right")):
        turn = Rotation.from_euler("x", side * (90.0 + rng.uniform(-10.0, 10.0)), degrees=True)
        centre = (length / 2 - 0.4, side * rng.uniform(*DISTANCE), 1.0)
        world.tile(f"wall_{name}", (length + 0.8, 1.2), centre, material="panel", rotation=turn)
    return world.render()


def level(rng: np.random.Generator, friction: float) -> str:
    """MJCF text of level ground, with the goal in a random direction."""
    distance, bearing = rng.uniform(0.5, 3.0), rng.uniform(-np.pi, np.pi)
    goal = (distance * np.cos(bearing), distance * np.sin(bearing), 0.0)
    world = WorldText("level", "level ground", friction, (0.6, 0.8), goal)
    world.platform("ground", (-4.0, 4.0), 8.0)
    return world.render()


def ledge(rng: np.random.Generator, friction: float) -> str:
    """MJCF text of level ground with one step up or down across it."""
    height = rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.4)
    world = WorldText("ledge", "a step across level ground", friction, (0.6, 0.8), (1.4, 0.0, height), abyss=-1.0)
    edge = rng.uniform(0.35, 0.7)
    world.box("before", (edge + 0.8, 1.6, 1.0), ((edge - 0.8) / 2, 0.0, -0.5))
    world.box("after", (2.2 - edge, 1.6, 1.0), ((2.2 + edge) / 2, 0.0, height - 0.5))
    return world.render()


def beam(rng: np.random.Generator, friction: float) -> str:
    """MJCF text of a beam between two platforms, about as wide as one foot or two."""
    length, width = rng.uniform(0.6, 1.8), rng.uniform(0.17, 0.45)
    end = 0.35 + length
    world = WorldText("beam", "a beam between platforms", friction, (0.6, 0.8), (end + 0.4, 0.0, 0.0))
    world.platform("before", (-0.6, 0.35), 1.2)
    world.platform("beam", (0.35, end), width)
    world.platform("after", (end, end + 1.0), 1.2)
    return world.render()


Maker = Callable[[np.random.Generator, CollectConfig, float], str]
WALLED: dict[str, Maker] = {
    "corridor": lambda rng, config, friction: generators.rubble_corridor(
        rng,
        rows=int(rng.integers(2, 6)),
        wall=rng.uniform(0.5, 0.8),
        wall_tilt=rng.uniform(0.0, 20.0),
        friction=friction,
        tilt=rng.uniform(*config.tilt),
        rise=rng.uniform(*config.rise),
    ),
    "tiles": lambda rng, config, friction: tiles_and_walls(
        rng, 1 + int(rng.random() < 0.7), rng.uniform(*config.tilt), rng.uniform(*config.rise), friction
    ),
    "passage": lambda rng, config, friction: passage(rng, friction),
}
"""Kinds of worlds with walls in reach."""
OPEN: dict[str, Maker] = {
    "field": lambda rng, config, friction: generators.rubble_field(
        rng,
        rows=int(rng.integers(1, 6)),
        tilt=rng.uniform(*config.tilt),
        rise=rng.uniform(*config.rise),
        friction=friction,
    ),
    "stones": lambda rng, config, friction: generators.stepping_stones(
        rng,
        rows=int(rng.integers(2, 6)),
        stone=rng.uniform(0.25, 0.4),
        gap=rng.uniform(0.02, 0.25),
        tilt=rng.uniform(0.0, 15.0),
        rise=rng.uniform(*config.rise),
        friction=friction,
    ),
    "stairs": lambda rng, config, friction: regular.stairs(
        rng,
        steps=int(rng.integers(2, 6)),
        step_height=rng.choice([-1.0, 1.0]) * rng.uniform(0.04, 0.25),
        tread=rng.uniform(0.28, 0.4),
        friction=friction,
    ),
    "gap": lambda rng, config, friction: regular.gap(rng, width=rng.uniform(0.05, 0.6), friction=friction),
    "slope": lambda rng, config, friction: regular.slope(
        rng,
        length=rng.uniform(0.8, 2.5),
        angle=rng.choice([-1.0, 1.0]) * rng.uniform(3.0, 0.8 * np.degrees(np.arctan(friction))),
        friction=friction,
    ),
    "ledge": lambda rng, config, friction: ledge(rng, friction),
    "beam": lambda rng, config, friction: beam(rng, friction),
    "level": lambda rng, config, friction: level(rng, friction),
}
"""Kinds of worlds without walls in reach."""
STEEP = "steep slope"
"""The kind of world in which no foot can rest; it is crossed fast."""


def steep_descent(rng: np.random.Generator, friction: float, scale: float = 1.0) -> World:
    """A slope downwards that is about as steep as friction allows, or steeper; lengths are multiplied by `scale`."""
    angle = np.degrees(np.arctan(friction)) * rng.uniform(0.8, 1.25)
    text = regular.slope(rng, length=rng.uniform(0.6, 3.0), angle=min(angle, 35.0), width=1.2, friction=friction)
    return load_world("training.xml", mjcf=scaled(text, scale))


def random_world(
    rng: np.random.Generator, config: CollectConfig, kind: str, friction: float, scale: float = 1.0
) -> World:
    """A world of one of the kinds `WALLED` and `OPEN`, with a random way through it and lengths times `scale`."""
    world = load_world("training.xml", mjcf=scaled((WALLED | OPEN)[kind](rng, config, friction), scale))
    start, goal = world.start.position, world.goal.position
    yaw = np.radians(_TURNED) * rng.normal()
    if rng.random() < _BACK:
        start, goal, yaw = goal, start, yaw + np.arctan2(*(start - goal)[1::-1])
    if rng.random() < _SHORT:
        aside = np.array([start[1] - goal[1], goal[0] - start[0], 0.0]) / np.linalg.norm(goal - start)
        goal = start + rng.uniform(0.3, 1.0) * (goal - start) + scale * _ASIDE * rng.normal() * aside
    return replace(world, start=Pose.from_yaw(start, yaw), goal=Goal(goal, world.goal.radius))
