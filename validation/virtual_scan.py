"""A scan of a world as a sensor above it would make it: a mesh with noise and holes."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial import KDTree

from toolkit.scanning.samples import Scan
from toolkit.world.source import RAY_GROUPS
from toolkit.world.world import World

_LONGEST_RISE = 0.1  # m; a mesh is torn where neighbouring rays meet ground at heights further apart


def virtual_scan(
    world: World, rng: np.random.Generator, *, spacing: float = 0.015, noise: float = 0.02, holes: float = 0.05
) -> Scan:
    """Scan a world from above.

    Rays fall on a grid and are joined to a mesh. Every vertex is moved in a random direction, and round holes are cut.

    Args:
        world: The world; its geoms are what the rays meet.
        rng: Source of noise and holes.
        spacing: Distance of the rays, m.
        noise: Standard deviation of the noise along each axis, m.
        holes: Share of the vertices that is lost in round holes of 3 to 8 cm radius.
    """
    model = world.mujoco_model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    colliding = (model.geom_contype | model.geom_conaffinity) != 0
    reach = model.geom_rbound[colliding][:, None]
    low, high = (data.geom_xpos[colliding] - reach).min(axis=0), (data.geom_xpos[colliding] + reach).max(axis=0)
    x, y = (np.arange(low[axis], high[axis] + spacing, spacing) for axis in range(2))
    points = np.empty((len(x), len(y), 3))
    met = np.zeros((len(x), len(y)), bool)
    down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    for i, along in enumerate(x):
        for j, across in enumerate(y):
            origin = np.array([along, across, high[2] + 1.0])
            depth = mujoco.mj_ray(model, data, origin, down, RAY_GROUPS, 1, -1, geom)
            met[i, j] = depth >= 0.0
            points[i, j] = origin + depth * down
    kept = met & ~_holes(points, met, rng, holes)
    a, b, c, d = (np.s_[:-1, :-1], np.s_[1:, :-1], np.s_[1:, 1:], np.s_[:-1, 1:])
    number = np.arange(kept.size).reshape(kept.shape)
    triangles = []
    for corners in ((a, b, c), (a, c, d)):
        height = np.stack([points[corner][..., 2] for corner in corners])
        whole = np.logical_and.reduce([kept[corner] for corner in corners])
        whole &= height.max(axis=0) - height.min(axis=0) < _LONGEST_RISE
        triangles.append(np.stack([number[corner][whole] for corner in corners], axis=-1))
    used, index = np.unique(np.concatenate(triangles), return_inverse=True)
    vertices = points.reshape(-1, 3)[used]
    return Scan(vertices + rng.normal(0.0, noise, vertices.shape), index.reshape(-1, 3))


def _holes(points: np.ndarray, met: np.ndarray, rng: np.random.Generator, share: float) -> np.ndarray:
    """Whether grid points (nx, ny) lie in holes that are about `share` of those that were met."""
    lost = np.zeros(met.shape, bool)
    flat, places = lost.reshape(-1), np.flatnonzero(met)
    tree = KDTree(points.reshape(-1, 3)[places][:, :2])
    while flat[places].mean() < share:
        centre = points.reshape(-1, 3)[rng.choice(places), :2]
        flat[places[tree.query_ball_point(centre, rng.uniform(0.03, 0.08))]] = True
    return lost
