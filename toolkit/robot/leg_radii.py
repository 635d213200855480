"""How thick the legs of a robot are, from the geoms along them."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel


def leg_radii(robot: RobotModel) -> np.ndarray:
    """(2,) m; radius of thighs and shins: half the thinner side of the thickest long geom there, of the thinner leg."""
    return np.min([_radii(robot, limb) for limb in FEET], axis=0)


def _radii(robot: RobotModel, limb: Limb) -> np.ndarray:
    """(2,) m; radius of a leg's thigh and shin, 0 where nothing there collides."""
    model, leg = robot.mujoco_model, robot.legs[limb]
    body = model.body(robot.limbs[limb].body).id
    joints: list[int] = []
    while body > 0:
        first = int(model.body_jntadr[body])
        own = range(first, first + int(model.body_jntnum[body]))
        joints = [joint for joint in own if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE] + joints
        body = int(model.body_parentid[body])
    radius = np.zeros(2)
    for link, (joint, length) in enumerate(((joints[2], leg.thigh), (joints[3], leg.shin))):  # see `leg_geometry`
        for geom in np.flatnonzero(model.geom_bodyid == model.jnt_bodyid[joint]).tolist():
            half = np.sort(model.geom_aabb[geom, 3:])
            if (model.geom_contype[geom] or model.geom_conaffinity[geom]) and half[2] > 0.25 * length:
                radius[link] = max(radius[link], float(half[0]))
    return radius
