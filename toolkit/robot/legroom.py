"""Room of the legs: with the feet turned towards each other, and where one leg passes the other."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.geometry.heading import wrapped
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import yaw_of
from toolkit.robot.chain import bodies_above
from toolkit.robot.model import RobotModel

_DEPTH = 0.005  # share of the length of a leg; as deep in each other, no lean of the body brings legs apart
_PASSING = 0.01  # m for a body of the usual size (`toolkit.robot.scale`); wanted distance of legs that pass each other
_SHARE = 0.5  # of their distance at home, if that is less
_LIFT = 0.2  # part of half the length of a leg by which a passing foot is lifted
_FINER = 0.01  # m for a body of the usual size; steps in which widths are tried
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
    data = _standing(robot, width, turn, 0.0)
    if data is None:
        return False
    leg = next(iter(robot.legs.values()))
    return _apart(robot, data, 0.0) < -_DEPTH * (leg.thigh + leg.shin)


def passing_gap(robot: RobotModel) -> float:
    """Gap in m between the soles, side by side and one of them lifted, at which the legs are clear of each other.

    It is no more than the gap at home, where legs may be as near as they are, and zero for legs that are always clear
    or do not reach such a posture.
    """
    sole, home, length = 2.0 * float(robot.half_sizes[FEET[0]][1]), robot.stance_width, robot.scale.length
    lift = 0.5 * max(leg.thigh + leg.shin for leg in robot.legs.values()) * _LIFT
    at_home, lifted = (_standing(robot, home, 0.0, height) for height in (0.0, lift))
    if at_home is None or lifted is None:
        return 0.0
    wanted = min(length * _PASSING, _SHARE * _apart(robot, at_home, length * _PASSING / _SHARE))
    gap = max(home - sole, 0.0)
    for width in np.arange(home, sole - 1e-9, -length * _FINER):
        data = _standing(robot, float(width), 0.0, lift)
        if data is None or _apart(robot, data, length * _PASSING) < wanted:
            break
        gap = max(float(width) - sole, 0.0)
    return gap


def _standing(robot: RobotModel, width: float, turn: float, lift: float) -> mujoco.MjData | None:
    """The posture with the base as at home and the feet on both sides of it, turned towards each other.

    They are `width` m apart, turned by `turn` rad in all, and the right one is `lift` m higher. None where the joints
    do not reach it.
    """
    from scipy.optimize import least_squares  # here, since every run imports this module

    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    joints = np.concatenate([robot.joints_to(foot) + 1 for foot in FEET])  # joint 0 is the free one
    address = model.jnt_qposadr[joints]
    low, high = model.jnt_range[joints].T
    sites = [model.site(robot.limbs[foot].site).id for foot in FEET]
    data.qpos[:] = robot.home

    def off(angles: np.ndarray) -> np.ndarray:
        data.qpos[address] = angles
        mujoco.mj_kinematics(model, data)
        parts = []
        for site, sign, height in zip(sites, (1.0, -1.0), (0.0, lift), strict=True):
            rotation = data.site_xmat[site].reshape(3, 3)
            heading = wrapped(yaw_of(rotation) + sign * turn / 2.0)
            place = data.site_xpos[site] - [0.0, sign * width / 2.0, height]
            parts += [place / width, rotation[:2, 2], [heading]]
        return np.concatenate(parts)

    start = np.clip(data.qpos[address], low + 1e-6, high - 1e-6)
    found = least_squares(off, start, bounds=(low, high))
    if found.cost > _REACHED:
        return None
    off(found.x)
    return data


def _apart(robot: RobotModel, data: mujoco.MjData, most: float) -> float:
    """Distance in m between the legs above the feet, negative where they are in each other; `most` where it is more."""
    model = copy.copy(robot.mujoco_model)
    model.geom_margin[:] = most
    model.body_margin[:] = most
    mujoco.mj_collision(model, data)
    joints = [robot.joints_to(foot) + 1 for foot in FEET]
    left, right = (_links(model, int(legs[0]), int(legs[-1])) for legs in joints)
    bodies = model.geom_bodyid[data.contact.geom]
    pairs = (set(pair) for pair in bodies.tolist())
    between = np.array([bool(pair & left and pair & right) for pair in pairs], bool)
    return min(float(data.contact.dist[between].min(initial=most)), most)


def _links(model: mujoco.MjModel, first: int, last: int) -> set[int]:
    """Bodies of a leg from its first joint on, without the foot that its last joint moves."""
    root, foot = (int(model.jnt_bodyid[joint]) for joint in (first, last))
    above = {body: set(bodies_above(model, body)) for body in range(1, model.nbody)}
    return {body for body, chain in above.items() if root in chain and foot not in chain}
