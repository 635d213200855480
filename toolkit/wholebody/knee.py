"""Which joint of a leg is the knee, and where it is straight."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel


def knee_range(robot: RobotModel, foot: Limb, min_angle: float) -> tuple[int, float, float] | None:
    """Range of a knee that keeps a least flexion away from the stretched leg.

    The knee is the joint that changes the distance from hip to sole the most in the home posture; the leg is straight
    where hip, knee and ankle are in line.

    Args:
        robot: the robot; home posture with bent knees.
        foot: whose leg.
        min_angle: rad; least flexion.

    Returns:
        Index into `robot.joint_names`, lower and upper limit in rad; None for a leg without a knee to speak of.
    """
    model = robot.mujoco_model
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(model, data)
    site = data.site(robot.limbs[foot].site).xpos
    chain = robot.joints_to(foot) + 1  # in the model, whose joint 0 is the free one
    if len(chain) < 3:
        return None
    hip = data.xanchor[chain[0]]
    along = (site - hip) / np.linalg.norm(site - hip)
    effect = np.array([np.cross(data.xaxis[joint], site - data.xanchor[joint]) @ along for joint in chain[:-1]])
    index = int(np.argmax(np.abs(effect)))
    if index == 0 or abs(effect[index]) < 0.02:  # m/rad; a straight home posture shows no knee
        return None
    knee, ankle = chain[index], chain[index + 1]
    thigh, shin = data.xanchor[knee] - hip, data.xanchor[ankle] - data.xanchor[knee]
    axis = data.xaxis[knee]
    flexion = np.arctan2(np.cross(thigh, shin) @ axis, thigh @ shin - (thigh @ axis) * (shin @ axis))
    straight = float(data.qpos[model.jnt_qposadr[knee]] - flexion)
    joint = int(knee) - 1
    lower, upper = float(robot.lower[joint]), float(robot.upper[joint])
    if effect[index] < 0.0:  # flexing is positive: it brings the sole closer
        return joint, min(max(lower, straight + min_angle), upper), upper
    return joint, lower, max(min(upper, straight - min_angle), lower)
