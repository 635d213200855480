"""A generator of terrain that is one mesh: flat patches with rough seams between them."""

from __future__ import annotations

import numpy as np
import trimesh

from toolkit.world.authoring import WorldText

_CELLS = 3  # cells along the edge of a patch
_SEAM = 0.08  # m; width of the seam between patches
_DEPTH = 0.3  # m; depth of the block below the terrain


def mesh_patches(
    rng: np.random.Generator,
    *,
    rows: int = 8,
    columns: int = 3,
    patch: float = 0.4,
    tilt: float = 10.0,
    rise: float = 0.03,
    friction: float = 0.7,
    shift: float = 0.6,
    swing: float = 0.8,
) -> str:
    """One closed mesh of flat patches, each tilted about a level axis; the default size has about 1,000 triangles.

    The first and the last row of patches are level, for the start and the goal.

    Args:
        rng: Source of the tilts and heights.
        rows: Patches along x.
        columns: Patches along y.
        patch: Edge of a patch, m.
        tilt: Largest whole tilt of a patch, deg.
        rise: Largest height above or below the mean, m.
        friction: Sliding coefficient.
        shift: Time of a shift, s.
        swing: Time of a swing, s.
    """
    pitch = patch + _SEAM
    width = columns * pitch - _SEAM
    x, y = (
        (np.arange(count)[:, None] * pitch + np.linspace(0.0, patch, _CELLS + 1)).ravel() for count in (rows, columns)
    )
    height = np.zeros((len(x), len(y)))
    local = np.linspace(-patch / 2, patch / 2, _CELLS + 1)
    for row in range(1, rows - 1):
        for column in range(columns):
            bearing, angle = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(0.0, tilt))
            slope = np.tan(angle) * np.array([np.cos(bearing), np.sin(bearing)])
            block = rng.uniform(-rise, rise) + slope[0] * local[:, None] + slope[1] * local[None]
            first, second = row * (_CELLS + 1), column * (_CELLS + 1)
            height[first : first + _CELLS + 1, second : second + _CELLS + 1] = block
    mesh = closed_block(x - patch * 0.75, y - width / 2, height)
    world = WorldText(
        "mesh_patches",
        f"one mesh of {len(mesh.faces)} triangles: {rows} x {columns} flat patches of {patch:g} m",
        friction,
        (shift, swing),
        ((rows - 1) * pitch - patch * 0.25, 0.0, 0.0),
        abyss=-_DEPTH,
    )
    world.mesh("terrain", mesh.vertices, mesh.faces)
    return world.render()


def closed_block(x: np.ndarray, y: np.ndarray, height: np.ndarray) -> trimesh.Trimesh:
    """Closed mesh of a height grid (nx, ny) over x (nx,) and y (ny,) with sides and a bottom."""
    count = len(y)
    top = np.column_stack([np.repeat(x, count), np.tile(y, len(x)), height.ravel()])
    corner = (np.arange(len(x) - 1)[:, None] * count + np.arange(count - 1)).ravel()
    across = corner + count + 1
    faces = [np.column_stack([corner, corner + count, across]), np.column_stack([corner, across, corner + 1])]
    index = np.arange(len(x) * count).reshape(len(x), count)
    # The rim, counterclockwise seen from above, and its copy on the bottom.
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    bottom = top[rim] * [1.0, 1.0, 0.0] - [0.0, 0.0, _DEPTH]
    lower = len(top) + np.arange(len(rim))
    centre = len(top) + len(rim)
    following, under = np.roll(rim, -1), np.roll(lower, -1)
    sides = [np.column_stack([rim, lower, under]), np.column_stack([rim, under, following])]
    floor = np.column_stack([np.full(len(rim), centre), under, lower])
    vertices = np.concatenate([top, bottom, [[x.mean(), y.mean(), -_DEPTH]]])
    return trimesh.Trimesh(vertices, np.concatenate([*faces, *sides, floor]), process=False)
