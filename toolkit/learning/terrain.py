"""Terrain for collections: tilted tiles with walls within reach of the palms, and slopes to run down."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.world.authoring import WorldText

TILE = 0.4  # m; edge of the square tiles
DISTANCE = (0.45, 0.8)  # m; range of a wall's distance from the start at the height of its middle
BEARING = 45.0  # deg; largest angle of a wall before or behind the robot's side
SLOPE_ANGLE = (5.0, 35.0)  # deg; range
SLOPE_LENGTH = (0.8, 3.0)  # m; range
SLOPE_WIDTH = 1.2  # m


def random_slope(rng: np.random.Generator) -> str:
    """MJCF text of a slope that descends along x between level ground; the start is on it or shortly above it."""
    angle, length = np.radians(rng.uniform(*SLOPE_ANGLE)), rng.uniform(*SLOPE_LENGTH)
    along = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    down = rng.uniform(-0.4, 0.8 * length)  # from the upper edge to the start
    start = down * along if down > 0.0 else np.array([down, 0.0, 0.0])
    end = length * along
    world = WorldText("training", "a slope", 0.5, (0.05, 0.35), (20.0, 0.0, 0.0), tuple(start), abyss=None)
    world.platform("above", (-1.5, 0.0), SLOPE_WIDTH)
    world.tile("slope", (length, SLOPE_WIDTH), end / 2, material="slope", rotation=Rotation.from_euler("y", angle))
    world.platform("below", (end[0], end[0] + 3.0), SLOPE_WIDTH, end[2])
    return world.render()


def random_terrain(rng: np.random.Generator, walls: int, tilt: float = 20.0, rise: float = 0.05) -> str:
    """MJCF text of 3 x 3 tiles with one or two walls (paper, Sec. VI, Fig. 3); the start is on the middle tile.

    Roll and pitch of tiles and the lean of walls stay within `tilt` degrees, and heights of tiles within `rise` m.
    """
    world = WorldText("training", "tilted tiles and walls", 0.5, (1.0, 1.0), (20.0, 0.0, 0.0), (0.0, 0.0, 0.05))
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
