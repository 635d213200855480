"""Arms that give way before they are at a wall.

Before a narrow way the face in front of an arm pushes it back, and keeps it out for good. Where the base will carry the
arm a little later, the same wall is deepest in it from the side, and its normal leads in. A second pass of the inverse
kinematics knows from the first one where the base will be.
"""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel
from toolkit.robot.world_distance import WorldDistances
from toolkit.wholebody.avoidance import Damper, Dampers

AHEAD = Damper(safe_world=0.03, safe_self=0.03, room=0.0, time=0.3, weight=1e3, firm=0.012)
"""How arms clear the world where they will be, for a body of the usual size (`toolkit.robot.scale`)."""
_LOOKS = (0.25, 0.5, 0.75, 1.0)  # s ahead, for a body of the usual size


class ArmsAhead:
    """The arms of a motion where the base will carry them.

    Attributes:
        touch: Whether an arm touches the world in the motion at all.
    """

    def __init__(self, robot: RobotModel, scene: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray):
        """Follow the base of a motion (T, 7 + n) in a scene, at a uniform grid of times (T,) in s."""
        self._damper, self._looks = AHEAD.scaled(robot.scale), robot.scale.time * np.array(_LOOKS)
        self._times, self._base = times, qpos[:, :7]
        self._distances = WorldDistances(robot, scene, self._damper.safe_world, robot.in_arms(scene) >= 0)
        self.touch = any((self._distances.near(each, ()).distance < 0.0).any() for each in qpos)

    def dampers(self, time: float, angles: np.ndarray, tick: float, reaching: set[Limb]) -> Dampers:
        """Dampers of the arms, at joint angles (n,), against what they meet soon after a time in s.

        Args:
            time: s.
            angles: (n,) rad; present joint angles.
            tick: s.
            reaching: Palms that approach, hold or leave a contact; their arms may meet the world.
        """
        deepest: dict[tuple[int, int], tuple[float, np.ndarray]] = {}
        for later in np.minimum(time + self._looks, self._times[-1]):
            base = self._base[np.searchsorted(self._times, later - 1e-9)]
            found = self._distances.near(np.concatenate([base, angles]), reaching)
            pairs, distance = found.geoms.tolist(), found.distance.tolist()
            for pair, apart, normal, point in zip(pairs, distance, found.normal, found.point, strict=True):
                if apart < deepest.get(tuple(pair), (np.inf,))[0]:
                    deepest[tuple(pair)] = apart, self._distances.rate(pair[1], normal, point)[6:]
        distance = np.array([apart for apart, _ in deepest.values()])
        rate = np.array([row for _, row in deepest.values()]).reshape(-1, len(angles))
        bound = self._damper.speed(distance, np.full(len(distance), self._damper.safe_world)) * tick
        return Dampers(-rate, bound, self._damper.weight * self._damper.share(distance))
