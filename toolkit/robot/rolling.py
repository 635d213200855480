"""Soles that roll: legs without ankle roll stand on a line, about which nothing holds them."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.chain import joints_to
from toolkit.robot.mend import geom_spheres

JOINTS = 5  # of a leg without ankle roll
SINK = 0.003  # m; how deep another part of the foot may reach below its line
LEAST = 0.2  # rad; what a sole has to roll by, so that the CoM can sway from one foot to the other
_MOST = 0.6  # rad; no sole rolls farther
_STEP = 0.005  # rad; resolution of the range


def sole_rolls(model: mujoco.MjModel, limb: Limb) -> bool:
    """Whether a limb is a foot whose leg has only five joints: it cannot be turned about the sole's x axis."""
    return limb in FEET and len(joints_to(model, int(model.site_bodyid[model.site(limb.label).id]))) == JOINTS


def rolling_range(model: mujoco.MjModel, limb: Limb) -> tuple[float, float]:
    """How far a sole may roll about its x axis before another part of the foot reaches below it, rad.

    The sign is that of an ankle's roll: positive where the leg leans to the left, and the foot's left side goes down.

    Raises:
        RobotError: Another part of the foot reaches below the patch, or the foot lies flat, so that it cannot roll.
    """
    centres, radii = _spheres(model, limb)
    angles = np.arange(-_MOST, _MOST + _STEP / 2, _STEP)
    heights = -np.sin(angles)[:, None] * centres[:, 1] + np.cos(angles)[:, None] * centres[:, 2] - radii
    free = heights.min(1) > -SINK
    middle = len(angles) // 2
    if not free[middle]:
        raise RobotError(f"{limb.label}: the foot reaches below its patch; move the patch to where it touches")
    low, high = middle, middle
    while low > 0 and free[low - 1]:
        low -= 1
    while high < len(angles) - 1 and free[high + 1]:
        high += 1
    least, found = angles[low], angles[high]
    if found - least < LEAST:
        raise RobotError(
            f"{limb.label}: the leg has no ankle roll, so its foot has to roll on the ground, but on the x axis of its "
            f"patch it rolls by {np.degrees(found - least):.0f}° only (at least {np.degrees(LEAST):.0f}°); "
            "put the patch on the edge or the line of the foot that stays on the ground, or unlock the ankle"
        )
    return float(least), float(found)


def _spheres(model: mujoco.MjModel, limb: Limb) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 3) m in the sole's frame and radii (n,) m of spheres whose hull holds the colliding foot."""
    site = model.site(limb.label).id
    body = int(model.site_bodyid[site])
    sole = Pose.from_quaternion(model.site_pos[site], model.site_quat[site])
    centres, radii = [], []
    for geom in np.flatnonzero(model.geom_bodyid == body).tolist():
        if not model.geom_contype[geom] | model.geom_conaffinity[geom]:
            continue
        points, radius = geom_spheres(model, geom)
        centres.append(sole.inverse() @ points)
        radii.append(np.full(len(points), radius))
    if not centres:
        return np.zeros((1, 3)), np.zeros(1)
    return np.concatenate(centres), np.concatenate(radii)
