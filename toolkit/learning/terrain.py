"""Terrain to collect transitions on: tilted tiles and walls within reach of the palms, and slopes to run down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.world.authoring import WorldText


@dataclass(frozen=True)
class TerrainConfig:
    """Ranges of one terrain (paper, Sec. VI and Fig. 3).

    Attributes:
        tilt: deg; roll and pitch of tiles, and the lean of a wall lie within this.
        rise: m; heights of tiles lie within this.
        tile: m; edge of the square tiles, of which there are 3 x 3.
        walls: 1 or 2; the second one on the other side.
        distance: m; range of a wall's distance from the start at the height of its middle.
        bearing: deg; a wall stands at most so far before or behind the robot's side.
    """

    tilt: float = 20.0
    rise: float = 0.05
    tile: float = 0.4
    walls: int = 2
    distance: tuple[float, float] = (0.45, 0.8)
    bearing: float = 45.0


@dataclass(frozen=True)
class SlopeConfig:
    """Ranges of a slope with level ground above and below it.

    Attributes:
        angle: deg; range.
        length: m; range.
        width: m.
    """

    angle: tuple[float, float] = (5.0, 35.0)
    length: tuple[float, float] = (0.8, 3.0)
    width: float = 1.2


def random_slope(rng: np.random.Generator, config: SlopeConfig) -> str:
    """MJCF text of a slope that descends along x; the start is anywhere on it or shortly above it."""
    angle, length = np.radians(rng.uniform(*config.angle)), rng.uniform(*config.length)
    along = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    down = rng.uniform(-0.4, 0.8 * length)  # from the upper edge to the start
    start = down * along if down > 0.0 else np.array([down, 0.0, 0.0])
    end = length * along
    world = WorldText("training", "a slope", 0.5, (0.05, 0.35), (20.0, 0.0, 0.0), tuple(start), abyss=None)
    world.platform("above", (-1.5, 0.0), config.width)
    world.tile("slope", (length, config.width), end / 2, material="slope", rotation=Rotation.from_euler("y", angle))
    world.platform("below", (end[0], end[0] + 3.0), config.width, end[2])
    return world.render()


def random_terrain(rng: np.random.Generator, config: TerrainConfig) -> str:
    """MJCF text of a terrain whose start is on the middle tile, heading along x."""
    world = WorldText("training", "tilted tiles and walls", 0.5, (1.0, 1.0), (20.0, 0.0, 0.0), (0.0, 0.0, 0.05))
    for row in range(3):
        for column in range(3):
            turn = Rotation.from_euler("xy", rng.uniform(-config.tilt, config.tilt, 2), degrees=True)
            height = 0.0 if row == column == 1 else rng.uniform(-config.rise, config.rise)
            top = ((row - 1) * config.tile, (column - 1) * config.tile, height)
            world.tile(f"tile_{row}_{column}", (config.tile, config.tile), top, rotation=turn)
    first = rng.choice([-1.0, 1.0])
    for number, side in enumerate((first, -first)[: config.walls]):
        bearing = side * np.radians(90.0 + rng.uniform(-config.bearing, config.bearing))
        lean = np.radians(rng.uniform(-config.tilt, config.tilt))
        # z of the panel looks back at the robot and leans up or down.
        turn = Rotation.from_euler("ZY", [bearing, lean - np.pi / 2])
        centre = rng.uniform(*config.distance) * np.array([np.cos(bearing), np.sin(bearing), 0.0]) + [0.0, 0.0, 1.1]
        world.tile(f"wall_{number}", (1.4, 1.8), centre, material="panel", rotation=turn)
    return world.render()
