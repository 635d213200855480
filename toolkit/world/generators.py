"""Seeded generators of terrain: each returns a world as MJCF text.

The numbers are those of the paper: tiles of 0.4 m whose roll and pitch are drawn independently, so that the whole
tilt of a tile can exceed both.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.world.authoring import WorldText
from toolkit.world.mesh_patches import mesh_patches
from toolkit.world.regular import gap, slope, stairs


def rubble_field(
    rng: np.random.Generator,
    *,
    rows: int = 4,
    columns: int = 3,
    tile: float = 0.4,
    tilt: float = 20.0,
    rise: float = 0.05,
    friction: float = 0.5,
    shift: float = 0.6,
    swing: float = 0.8,
) -> str:
    """Tilted tiles between two platforms; the goal is 3.42 m from the start if there are four rows.

    Args:
        rng: Source of the tilts and heights.
        rows: Tiles along x.
        columns: Tiles along y.
        tile: Edge of a tile, m.
        tilt: Largest roll and largest pitch, drawn independently, deg.
        rise: Largest height above or below the mean, m.
        friction: Sliding coefficient.
        shift: Time of a shift, s.
        swing: Time of a swing, s.
    """
    begin = 0.85
    end = begin + rows * tile
    world = WorldText(
        "rubble_field",
        f"{rows} x {columns} tiles of {tile:g} m, roll and pitch within {tilt:g} degrees, between two platforms",
        friction,
        (shift, swing),
        (end + 0.97, 0.0, 0.0),
    )
    world.platform("platform_start", (-0.6, begin), columns * tile)
    _tiles(world, rng, begin, rows, columns, (tile, tile), tilt, rise)
    world.platform("platform_goal", (end, end + 1.5), columns * tile)
    return world.render()


def rubble_corridor(
    rng: np.random.Generator,
    *,
    rows: int = 5,
    columns: int = 3,
    tilt: float = 20.0,
    rise: float = 0.05,
    wall: float = 0.7,
    wall_tilt: float = 20.0,
    friction: float = 0.5,
    shift: float = 0.6,
    swing: float = 0.8,
) -> str:
    """Tilted tiles of 0.4 x 0.3 m between walls up to z = 1.5 m; a wall has tilted panels of 0.4 m every 0.5 m.

    Args:
        rng: Source of the tilts and heights.
        rows: Tiles along x.
        columns: Tiles along y.
        tilt: Largest roll and largest pitch of a tile, deg.
        rise: Largest height of a tile above or below the mean, m.
        wall: Distance of the panels' centres from the middle, m.
        wall_tilt: Largest turn of a panel about x and about z, deg.
        friction: Sliding coefficient.
        shift: Time of a shift, s.
        swing: Time of a swing, s.
    """
    begin, (length, width) = 0.6, (0.4, 0.3)
    end = begin + rows * length
    world = WorldText(
        "rubble_corridor",
        f"{rows} x {columns} tiles of {length:g} x {width:g} m between walls of tilted panels",
        friction,
        (shift, swing),
        (end + 0.6, 0.0, 0.0),
    )
    world.platform("platform_start", (-0.6, begin), columns * width)
    _tiles(world, rng, begin, rows, columns, (length, width), tilt, rise)
    world.platform("platform_goal", (end, end + 1.2), columns * width)
    for side, name in ((1.0, "left"), (-1.0, "right")):
        for column, x in enumerate(np.arange(begin - 0.5, end + 0.5 + 1e-9, 0.5)):
            for row, z in enumerate((0.3, 0.8, 1.3)):
                angles = rng.uniform(-wall_tilt, wall_tilt, 2)
                inwards = Rotation.from_euler("x", side * 90.0, degrees=True)
                turn = Rotation.from_euler("xz", angles, degrees=True) * inwards
                world.tile(
                    f"panel_{name}_{column}_{row}", (0.4, 0.4), (x, side * wall, z), material="panel", rotation=turn
                )
    return world.render()


def stepping_stones(
    rng: np.random.Generator,
    *,
    rows: int = 5,
    columns: int = 3,
    stone: float = 0.36,
    gap: float = 0.06,
    tilt: float = 12.0,
    rise: float = 0.03,
    friction: float = 0.7,
    shift: float = 0.6,
    swing: float = 0.8,
) -> str:
    """Stones with gaps between them, each tilted about a random level axis.

    Args:
        rng: Source of the tilts and heights.
        rows: Stones along x.
        columns: Stones along y.
        stone: Edge of a stone, m.
        gap: Distance between stones, m.
        tilt: Largest whole tilt of a stone, deg.
        rise: Largest height above or below the mean, m.
        friction: Sliding coefficient.
        shift: Time of a shift, s.
        swing: Time of a swing, s.
    """
    begin, pitch = 0.4, stone + gap
    end = begin + gap + rows * pitch
    world = WorldText(
        "stepping_stones",
        f"{rows} x {columns} stones of {stone:g} m, tilted up to {tilt:g} degrees, {gap:g} m apart",
        friction,
        (shift, swing),
        (end + 0.4, 0.0, 0.0),
    )
    width = columns * pitch - gap
    world.platform("platform_start", (-0.6, begin), width)
    for row in range(rows):
        for column in range(columns):
            bearing, angle = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(0.0, tilt))
            x, y = begin + gap + stone / 2 + row * pitch, (column - (columns - 1) / 2) * pitch
            centre = (x, y, rng.uniform(-rise, rise))
            turn = Rotation.from_rotvec(angle * np.array([np.cos(bearing), np.sin(bearing), 0.0]))
            world.tile(f"stone_{row}_{column}", (stone, stone), centre, rotation=turn)
    world.platform("platform_goal", (end, end + 1.0), width)
    return world.render()


def training(
    rng: np.random.Generator,
    *,
    tile: float = 0.4,
    tilt: float = 20.0,
    rise: float = 0.05,
    friction: float = 0.5,
    shift: float = 1.0,
    swing: float = 1.0,
    walls: int = 1,
) -> str:
    """Terrain for collecting transitions with 3 x 3 tilted tiles, the start on the middle one, and walls at the sides.

    A wall is 0.4 to 0.9 m from the start at a height of 1 m, up to 45 degrees before or behind the robot's side.

    Args:
        rng: Source of everything random.
        tile: Edge of a tile, m.
        tilt: Largest roll and pitch of a tile and largest lean of a wall, deg.
        rise: Largest height above or below the mean, m.
        friction: Sliding coefficient.
        shift: Time of a shift, s.
        swing: Time of a swing, s.
        walls: Number of walls; 1 for one side, 2 for both sides.
    """
    world = WorldText(
        "training", "3 x 3 tilted tiles and walls", friction, (shift, swing), (tile, 0.0, 0.05), start=(0.0, 0.0, 0.05)
    )
    for row in range(3):
        for column in range(3):
            middle = row == column == 1
            turn = Rotation.from_euler("xy", rng.uniform(-tilt, tilt, 2), degrees=True)
            top = ((row - 1) * tile, (column - 1) * tile, 0.0 if middle else rng.uniform(-rise, rise))
            world.tile(f"tile_{row}_{column}", (tile, tile), top, rotation=turn)
    first = rng.choice([-1.0, 1.0])
    for side in (first, -first)[:walls]:
        bearing = side * np.radians(90.0 + rng.uniform(-45.0, 45.0))
        distance, lean = rng.uniform(0.4, 0.9), rng.uniform(-tilt, tilt)
        # The z axis of the panel points back at the robot and leans up or down.
        turn = Rotation.from_euler("ZY", [bearing, np.radians(lean) - np.pi / 2])
        centre = distance * np.array([np.cos(bearing), np.sin(bearing), 0.0]) + [0.0, 0.0, 1.0]
        name = "wall" if side == first else "other_wall"
        world.tile(name, (2.0, 2.0), centre, material="panel", rotation=turn)
    return world.render()


KINDS: dict[str, Callable[..., str]] = {
    generator.__name__: generator
    for generator in (rubble_field, rubble_corridor, stepping_stones, stairs, gap, slope, mesh_patches, training)
}


def _tiles(
    world: WorldText,
    rng: np.random.Generator,
    begin: float,
    rows: int,
    columns: int,
    size: tuple[float, float],
    tilt: float,
    rise: float,
) -> None:
    """Add rows x columns tilted tiles from x = `begin` on, centred on y = 0."""
    for row in range(rows):
        for column in range(columns):
            turn = Rotation.from_euler("xy", rng.uniform(-tilt, tilt, 2), degrees=True)
            x, y = begin + (row + 0.5) * size[0], (column - (columns - 1) / 2) * size[1]
            world.tile(f"tile_{row}_{column}", size, (x, y, rng.uniform(-rise, rise)), rotation=turn)
