"""Where a camera stands: beside the way that a robot goes, and on the side from which the world hides least."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.report.meshes import SHOWN_GROUPS, static_bodies

ANGLES = (65.0, 110.0, 150.0, 25.0)  # degrees from the heading to the camera, by preference; on either side


def ahead_of(way: np.ndarray) -> tuple[np.ndarray, float]:
    """Unit vector (2,) from the first to the last point of a way (k, 3) m seen from above, and their distance in m.

    The vector is along x where the way ends where it began.
    """
    ahead = way[-1, :2] - way[0, :2]
    length = float(np.linalg.norm(ahead))
    return (ahead / length if length > 0.1 else np.array([1.0, 0.0])), length


def best_direction(
    model: mujoco.MjModel,
    targets: np.ndarray,
    pivots: np.ndarray,
    heading: float,
    distance: float,
    elevations: tuple[float, ...],
) -> np.ndarray:
    """(3,) unit vector; direction from the pivots to the camera from which the static geoms hide the fewest targets.

    Args:
        model: Compiled scene.
        targets: (k, 3) m; points that should be visible.
        pivots: (k, 3) or (3,) m; the camera looks at a pivot when a target should be visible.
        heading: rad; direction in which the robot walks.
        distance: m; from pivot to camera.
        elevations: Degrees above the horizon; among equals the first is preferred.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    directions = []
    for elevation in np.radians(elevations):
        for angle in np.radians(ANGLES):
            for azimuth in (heading - angle, heading + angle):
                flat = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
                directions.append(np.array([*flat, np.sin(elevation)]))
    pairs = list(zip(targets, np.broadcast_to(pivots, targets.shape), strict=True))
    hidden = [sum(_is_hidden(model, data, x, pivot + distance * way) for x, pivot in pairs) for way in directions]
    return directions[int(np.argmin(hidden))]


def _is_hidden(model: mujoco.MjModel, data: mujoco.MjData, target: np.ndarray, camera: np.ndarray) -> bool:
    """Whether a visible static geom is between two points (3,) m; `data` holds the geoms' poses."""
    static = static_bodies(model)[model.geom_bodyid]
    groups = np.isin(np.arange(mujoco.mjNGROUP), list(SHOWN_GROUPS)).astype(np.uint8)
    hit, origin = np.zeros(1, np.int32), np.array(target, float)
    remaining = float(np.linalg.norm(camera - target))
    way = (camera - target) / max(remaining, 1e-9)
    while remaining > 0:
        distance = mujoco.mj_ray(model, data, origin, way, groups, True, -1, hit)
        if distance < 0 or distance >= remaining:
            return False
        if static[hit[0]]:
            return True
        origin, remaining = origin + (distance + 1e-4) * way, remaining - distance - 1e-4  # continue behind the robot
    return False
