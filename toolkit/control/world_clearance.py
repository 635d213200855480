"""WorldClearance: accelerations that keep links off the world."""

from __future__ import annotations

from collections.abc import Collection

import mujoco
import numpy as np

from toolkit.control.clearance import RATE, Clearance, least_acceleration, nearest
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel
from toolkit.robot.world_distance import WorldDistances, above_ankles

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
SAFE_ARM, SAFE = 0.01, 0.003  # m; distances that links of arms keep, and other links, which have less room
ROOM = 0.05  # m; distance beyond it at which the world is noticed
HASTE = 2.0  # factor on the rate of links other than arms, which pass edges closely as planned
MAX_PAIRS = 6  # most pairs of a link and a part of the world at a time, those that approach their limit fastest


class WorldClearance(Clearance):
    """Bounds on the accelerations at which links above the ankles approach the world as the controller knows it.

    Plans keep links clear by a few centimetres, and by as much arms and legs stray from them where the body moves fast.
    """

    def __init__(self, robot: RobotModel, scene: mujoco.MjModel):
        """Prepare for a robot and its scene."""
        super().__init__(MAX_PAIRS, scene.nv)
        scale, links = robot.scale, above_ankles(robot, scene)
        self._distances = WorldDistances(robot, scene, scale.length * (SAFE_ARM + ROOM), links)
        of_arm = self._distances.side >= 0
        self._safe = scale.length * np.where(of_arm, SAFE_ARM, SAFE)
        self._rate = RATE / scale.time * np.where(of_arm, 1.0, HASTE)
        self._first = [scene.ngeom, 1]  # makes one number of a pair

    def update(self, qpos: np.ndarray, qvel: np.ndarray, reaching: Collection[Limb]) -> None:
        """Evaluate at a state (7 + n,), (6 + n,); arms whose palms are `reaching` may touch the world."""
        found = self._distances.near(qpos, reaching)
        self.count = 0
        if not len(found.geoms):
            return
        bounds = []
        for row in nearest(found.geoms @ self._first, found.distance):
            geom = int(found.geoms[row, 1])
            rate = self._distances.rate(geom, found.normal[row], found.point[row])
            room = float(found.distance[row] - self._safe[geom])
            bounds.append((rate, least_acceleration(room, float(rate @ qvel), float(self._rate[geom]))))
        self._take(bounds)
