"""The range of a knee that keeps a least flexion."""

from __future__ import annotations

import mujoco

from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel


def knee_range(robot: RobotModel, foot: Limb, min_angle: float) -> tuple[int, float, float]:
    """Range of a knee that keeps away from the stretched leg.

    Args:
        robot: the robot.
        foot: whose leg.
        min_angle: rad; least flexion; 0 is straight.

    Returns:
        Index into `robot.joint_names`, lower and upper limit of the joint in rad.
    """
    joint = int(robot.joints_to(foot)[3])  # after the three of the hip, as every leg that was loaded has it
    model = robot.mujoco_model
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(model, data)
    lower, upper = float(robot.lower[joint]), float(robot.upper[joint])
    missing = min_angle - robot.legs[foot].ranges["knee"][0]  # how far the joint's straight end is from enough flexion
    if data.xaxis[joint + 1] @ data.xmat[1].reshape(3, 3)[:, 1] > 0.0:  # flexing is positive; joint 0 is the free one
        return joint, min(max(lower, lower + missing), upper), upper
    return joint, lower, max(min(upper, upper - missing), lower)
