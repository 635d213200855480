"""Whether the legs of a robot have room to stand with the feet turned towards each other."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.geometry.heading import wrapped
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import yaw_of
from toolkit.robot.chain import bodies_above
from toolkit.robot.model import RobotModel

_DEPTH = 0.005  # share of the length of a leg; as deep in each other, no lean of the body brings legs apart
_REACHED = 1e-4  # least squares of a posture whose soles are where they should be


def legs_touch(robot: RobotModel, width: float, turn: float) -> bool:
    """Whether a robot cannot stand with its feet side by side and turned inwards, since its legs are in each other.

    The legs are those above the feet. The base stands as in the home posture, midway between the feet. A posture that
    the joints do not reach is left to others to judge.

    Args:
        robot: The robot.
        width: Distance in m across between the soles.
        turn: Angle in rad by which the feet are turned towards each other.
    """
    from scipy.optimize import least_squares  # here, since every run imports this module

    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    joints = [robot.joints_to(foot) + 1 for foot in FEET]  # joint 0 is the free one
    address = model.jnt_qposadr[np.concatenate(joints)]
    low, high = model.jnt_range[np.concatenate(joints)].T
    sites = [model.site(robot.limbs[foot].site).id for foot in FEET]
    data.qpos[:] = robot.home

    def off(angles: np.ndarray) -> np.ndarray:
        data.qpos[address] = angles
        mujoco.mj_kinematics(model, data)
        parts = []
        for site, sign in zip(sites, (1.0, -1.0), strict=True):
            rotation = data.site_xmat[site].reshape(3, 3)
            heading = wrapped(yaw_of(rotation) + sign * turn / 2.0)
            parts += [(data.site_xpos[site] - [0.0, sign * width / 2.0, 0.0]) / width, rotation[:2, 2], [heading]]
        return np.concatenate(parts)

    start = np.clip(data.qpos[address], low + 1e-6, high - 1e-6)
    found = least_squares(off, start, bounds=(low, high))
    if found.cost > _REACHED:
        return False
    off(found.x)
    mujoco.mj_collision(model, data)
    left, right = (_links(model, int(legs[0]), int(legs[-1])) for legs in joints)
    leg = next(iter(robot.legs.values()))
    deep = data.contact.dist < -_DEPTH * (leg.thigh + leg.shin)
    pairs = (set(pair) for pair in model.geom_bodyid[data.contact.geom[deep]].tolist())
    return any(pair & left and pair & right for pair in pairs)


def _links(model: mujoco.MjModel, first: int, last: int) -> set[int]:
    """Bodies of a leg from its first joint on, without the foot that its last joint moves."""
    root, foot = (int(model.jnt_bodyid[joint]) for joint in (first, last))
    above = {body: set(bodies_above(model, body)) for body in range(1, model.nbody)}
    return {body for body, chain in above.items() if root in chain and foot not in chain}
