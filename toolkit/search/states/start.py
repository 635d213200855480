"""The stance in which the robot starts."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.contacts.projection import Projector, shifts
from toolkit.contacts.stance import Contact, Stance
from toolkit.errors import PlanningError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.world.world import World

_BELOW, _ABOVE = 0.3, 0.15  # m below and above the start site between which the ground is looked for, as by worlds
# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_SEARCH, _STEP = 0.16, 0.02  # m; farthest from its place that a foot may start, and the grid's step


def _home_feet(robot: RobotModel) -> dict[Limb, np.ndarray]:
    """(3,) x m, y m, yaw rad of each sole in the home posture, seen from between the feet."""
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(robot.mujoco_model, data)
    feet = {}
    for limb in FEET:
        site = data.site(robot.limbs[limb].site)
        rotation = site.xmat.reshape(3, 3)
        feet[limb] = np.array([*site.xpos[:2], np.arctan2(rotation[1, 0], rotation[0, 0])])
    return feet


def place_feet(robot: RobotModel, world: World, projector: Projector) -> list[Stance]:
    """Stances at the start, both feet at their home distance or as near to it as the ground allows; best first.

    Raises:
        PlanningError: A foot finds no room.
    """
    scale = robot.scale.length
    spread = shifts(scale * _SEARCH, scale * _STEP)
    start = world.start
    places: dict[Limb, list[Contact]] = {}
    for limb, foot in _home_feet(robot).items():
        at = (start @ Pose.from_yaw(np.array([foot[0], foot[1], 0.0]), foot[2])).position
        yaw = start.yaw + foot[2]
        offsets = spread * [1.0, limb.outward]
        c, s = np.cos(start.yaw), np.sin(start.yaw)
        xy = at[:2] + offsets @ np.array([[c, s], [-s, c]])
        pose = np.column_stack([xy, np.full(len(xy), yaw)])
        z = start.position[2]
        soles = projector.project_soles(limb, pose, z - _BELOW, z + _ABOVE, shift=False)
        found = np.flatnonzero(soles.found)
        if not len(found):
            raise PlanningError(
                f"{world.path}: no room for the {limb.label.replace('_', ' ')} near the start "
                f"({at[0]:.3g}, {at[1]:.3g}, {z:.3g}): no surface within {_BELOW:g} m below holds a whole sole; "
                "move the site 'start', or make the surface larger"
            )
        places[limb] = [
            Contact(
                limb,
                Pose(soles.rotation[row], soles.position[row]),
                float(projector.table.friction[soles.surface[row]]),
                int(soles.surface[row]),
                float(projector.bearing[soles.surface[row]]),
            )
            for row in found[:12]
        ]
    left, right = (places[limb] for limb in FEET)
    pairs = [(i + j, i, j) for i in range(len(left)) for j in range(len(right))]
    return [Stance((left[i], right[j])) for _, i, j in sorted(pairs)]
