"""Arms that give way before they are at a wall.

Before a narrow way the face in front of an arm pushes it back, and keeps it out for good. Where the base will carry the
arm a little later, the same wall is deepest in it from the side, and its normal leads in. A second pass of the inverse
kinematics knows from the first one where the base will be.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel
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
        self._model = model = copy.copy(scene)
        self._data = mujoco.MjData(model)
        self._static = model.body_weldid[model.geom_bodyid] == 0
        self._side = robot.in_arms(model)[model.geom_bodyid]
        neither = ~self._static & (self._side < 0)
        model.geom_contype[neither] = model.geom_conaffinity[neither] = 0
        model.geom_gap[:] = 0.0
        model.geom_margin[:] = np.where(self._side < 0, 0.0, self._damper.safe_world)
        model.body_margin[:] = 0.0
        np.maximum.at(model.body_margin, model.geom_bodyid, model.geom_margin)
        self.touch = any((self._near(each, set())[1] < 0.0).any() for each in qpos)

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
            pairs, distance, normal, point = self._near(np.concatenate([base, angles]), reaching)
            if len(pairs):
                mujoco.mj_comPos(self._model, self._data)
            for pair, apart, along, at in zip(pairs.tolist(), distance.tolist(), normal, point, strict=True):
                if apart < deepest.get(tuple(pair), (np.inf,))[0]:
                    deepest[tuple(pair)] = apart, self._rate(pair, along, at)
        distance = np.array([apart for apart, _ in deepest.values()])
        rate = np.array([row for _, row in deepest.values()]).reshape(-1, len(angles))
        bound = self._damper.speed(distance, np.full(len(distance), self._damper.safe_world)) * tick
        return Dampers(-rate, bound, self._damper.weight * self._damper.share(distance))

    def _near(self, qpos: np.ndarray, reaching: set[Limb]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Pairs (k, 2) of a geom of the world and one of an arm; distances (k,), normals (k, 3) out, points (k, 3)."""
        model, data = self._model, self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        geoms, contact = data.contact.geom, data.contact
        of_world = self._static[geoms]
        rows = np.flatnonzero((of_world[:, 0] != of_world[:, 1]) & (contact.dist < self._damper.safe_world))
        second = of_world[rows, 1]  # the normal leads from the first geom to the second
        pairs = np.where(second[:, None], geoms[rows][:, ::-1], geoms[rows])
        kept = ~np.isin(self._side[pairs[:, 1]], list(reaching))
        rows, pairs, second = rows[kept], pairs[kept], second[kept]
        normal = np.where(second, -1.0, 1.0)[:, None] * contact.frame[rows, :3]
        return pairs, contact.dist[rows], normal, contact.pos[rows]

    def _rate(self, pair: list[int], normal: np.ndarray, point: np.ndarray) -> np.ndarray:
        """(n,) derivative of a distance by the joints."""
        jacobian = np.empty((3, self._model.nv))
        mujoco.mj_jac(self._model, self._data, jacobian, None, point, int(self._model.geom_bodyid[pair[1]]))
        return (normal @ jacobian)[6:]
