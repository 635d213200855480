"""ArmClearance: accelerations that keep the arms off the world."""

from __future__ import annotations

from collections.abc import Collection

import mujoco
import numpy as np

from toolkit.control.link_clearance import MAX_ACCELERATION, RATE, least_acceleration
from toolkit.geometry.limb import Limb
from toolkit.robot.arm_distance import ArmDistances
from toolkit.robot.model import RobotModel

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
SAFE = 0.01  # m; distance that arms keep
ROOM = 0.05  # m; distance beyond it at which the world is noticed
MAX_PAIRS = 4  # most pairs of a link and a part of the world at a time, those that approach their limit fastest


class ArmClearance:
    """Bounds on the accelerations at which arms approach the world as the controller knows it.

    Plans keep arms clear by a few centimetres, and by as much trunk and arms stray from them where the body moves fast.
    The bounds are those of `LinkClearance`.

    Attributes:
        count: Number of pairs that are near.
        rows: (MAX_PAIRS, nv) Jacobians J of their distances; the first `count` rows count.
        lower: (MAX_PAIRS,) m/s^2; least accelerations.
    """

    def __init__(self, robot: RobotModel, scene: mujoco.MjModel):
        """Prepare for a robot and its scene."""
        scale = robot.scale
        self._safe, self._rate = scale.length * SAFE, RATE / scale.time
        self._distances = ArmDistances(robot, scene, scale.length * (SAFE + ROOM))
        self.count, self.rows, self.lower = 0, np.zeros((MAX_PAIRS, scene.nv)), np.zeros(MAX_PAIRS)

    def update(self, qpos: np.ndarray, qvel: np.ndarray, reaching: Collection[Limb]) -> None:
        """Evaluate at a state (7 + n,), (6 + n,); arms whose palms are `reaching` may touch the world."""
        found = self._distances.near(qpos, reaching)
        self.count = 0
        if not len(found.geoms):
            return
        order = np.argsort(found.distance, kind="stable")
        _, first = np.unique(found.geoms[order], axis=0, return_index=True)  # the nearest points of each pair
        bounds = []
        for row in order[np.sort(first)].tolist():
            rate = self._distances.rate(int(found.geoms[row, 1]), found.normal[row], found.point[row])
            room = float(found.distance[row]) - self._safe
            bounds.append((rate, least_acceleration(room, float(rate @ qvel), self._rate)))
        bounds.sort(key=lambda pair: -pair[1])
        self.count = min(len(bounds), MAX_PAIRS)
        for row, (rate, lower) in enumerate(bounds[: self.count]):
            self.rows[row], self.lower[row] = rate, min(lower, MAX_ACCELERATION)
