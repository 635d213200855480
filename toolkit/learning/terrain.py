"""Terrain to collect transitions on: tilted tiles around the start and walls within reach of the palms."""

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


def random_terrain(rng: np.random.Generator, config: TerrainConfig) -> str:
    """MJCF text of a terrain whose start is on the middle tile, heading along x."""
    world = WorldText("training", "tilted tiles and walls", 0.5, (1.0, 1.0), (0.0, 0.0, 0.05), (20.0, 0.0, 0.0))
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
