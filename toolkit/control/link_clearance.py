"""LinkClearance: accelerations that keep the robot's links from touching each other."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.control.dynamics import RobotDynamics
from toolkit.robot.model import RobotModel

# Lengths, rates and accelerations are those of a body of the usual size (`toolkit.robot.scale`).
SAFE = 0.002  # m; distance that links keep, or half of their distance in the home posture where that is less
ROOM = 0.015  # m; distance beyond it at which they are noticed, or a part of that at home: what rests near is not
RATE = 25.0  # 1/s; speed at which links may approach each other, per m of distance
MAX_ACCELERATION = 100.0  # m/s^2; most that is asked of two links
MAX_PAIRS = 6  # most pairs of links at a time, those that approach their limit fastest
_ROOM_SHARE = 0.3  # of a pair's distance at home


class LinkClearance:
    """Bounds on the accelerations at which pairs of links part.

    With d the distance of two links beyond the one that they keep, and r the rate, `d'' >= -r^2 d - 2 r d'` keeps
    d >= 0 once `d' >= -r d` holds (a barrier of second order), with `d'' = J qdd` at the nearest points; what their
    motion along the surfaces adds is left out. Links that touch in the home posture are never kept apart.

    Attributes:
        count: Number of pairs that are near.
        rows: (MAX_PAIRS, nv) Jacobians J of their distances; the first `count` rows count.
        lower: (MAX_PAIRS,) m/s^2; least accelerations.
    """

    def __init__(self, robot: RobotModel, dynamics: RobotDynamics):
        """Prepare for the controller's model of the robot, whose posture each update takes."""
        scale = robot.scale
        self._data = dynamics.data
        self._safe, self._rate = scale.length * SAFE, RATE / scale.time
        self._most = MAX_ACCELERATION
        self._model = model = copy.copy(dynamics.model)
        model.geom_gap[:] = 0.0
        model.geom_margin[:] = scale.length * (SAFE + ROOM)
        model.body_margin[:] = scale.length * (SAFE + ROOM)
        self._home = np.full((model.nbody, model.nbody), np.inf)
        self._set_home(robot.home)
        self.count, self.rows, self.lower = 0, np.zeros((MAX_PAIRS, model.nv)), np.zeros(MAX_PAIRS)
        self._jacobian = np.zeros((2, 3, model.nv))

    def update(self, qvel: np.ndarray) -> None:
        """Evaluate at the posture of the dynamics and velocities (6 + n,)."""
        model, data = self._model, self._data
        self.count = 0
        mujoco.mj_collision(model, data)
        if not data.ncon:
            return
        bodies, distance = model.geom_bodyid[data.contact.geom], data.contact.dist
        at_home = self._home[bodies[:, 0], bodies[:, 1]]
        safe = np.minimum(self._safe, 0.5 * at_home)
        room = np.minimum(ROOM / SAFE * self._safe, _ROOM_SHARE * at_home)
        near = np.flatnonzero((distance < safe + room) & (at_home > 0.0))
        if not len(near):
            return
        near = near[np.argsort(distance[near], kind="stable")]
        _, first = np.unique(bodies[near] @ [model.nbody, 1], return_index=True)  # the nearest points of each pair
        found = [self._bound(row, bodies[row], float(safe[row]), qvel) for row in near[np.sort(first)].tolist()]
        found.sort(key=lambda pair: -pair[1])
        self.count = min(len(found), MAX_PAIRS)
        for row, (jacobian, lower) in enumerate(found[: self.count]):
            self.rows[row], self.lower[row] = jacobian, min(lower, self._most)

    def _bound(self, contact: int, bodies: np.ndarray, safe: float, qvel: np.ndarray) -> tuple[np.ndarray, float]:
        """The Jacobian (nv,) of a pair's distance, and the least acceleration of it in m/s^2."""
        data, (first, second) = self._data, self._jacobian
        for part, body in ((first, bodies[0]), (second, bodies[1])):
            mujoco.mj_jac(self._model, data, part, None, data.contact.pos[contact], int(body))
        row = data.contact.frame[contact, :3] @ (second - first)
        room = float(data.contact.dist[contact]) - safe
        return row, least_acceleration(room, float(row @ qvel), self._rate)

    def _set_home(self, home: np.ndarray) -> None:
        """Least distances of pairs of links that are near each other in the home posture."""
        model, data = self._model, mujoco.MjData(self._model)
        data.qpos[:] = home
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        first, second = model.geom_bodyid[data.contact.geom].T
        for a, b in ((first, second), (second, first)):
            np.minimum.at(self._home, (a, b), data.contact.dist)


def least_acceleration(room: float, speed: float, rate: float) -> float:
    """Least acceleration in m/s^2 of a distance with so much `room` in m, which grows at a speed in m/s.

    The rate in 1/s is r of `LinkClearance`.
    """
    return -rate * (rate * room + 2.0 * speed)
