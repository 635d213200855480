"""LinkClearance: accelerations that keep the robot's links from touching each other."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.control.clearance import RATE, Clearance, least_acceleration, nearest
from toolkit.control.dynamics import RobotDynamics
from toolkit.robot.model import RobotModel

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
SAFE = 0.002  # m; distance that links keep, or half of their distance in the home posture where that is less
ROOM = 0.015  # m; distance beyond it at which they are noticed, or a part of that at home: what rests near is not
MAX_PAIRS = 6  # most pairs of links at a time, those that approach their limit fastest
_ROOM_SHARE = 0.3  # of a pair's distance at home


class LinkClearance(Clearance):
    """Bounds on the accelerations at which links part; those that touch in the home posture are never kept apart."""

    def __init__(self, robot: RobotModel, dynamics: RobotDynamics):
        """Prepare for the controller's model of the robot, whose posture each update takes."""
        super().__init__(MAX_PAIRS, dynamics.nv)
        scale = robot.scale
        self._data = dynamics.data
        self._safe, self._rate = scale.length * SAFE, RATE / scale.time
        self._model = model = copy.copy(dynamics.model)
        model.geom_gap[:] = 0.0
        model.geom_margin[:] = scale.length * (SAFE + ROOM)
        model.body_margin[:] = scale.length * (SAFE + ROOM)
        self._home = np.full((model.nbody, model.nbody), np.inf)
        self._set_home(robot.home)
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
        rows = near[nearest(bodies[near] @ [model.nbody, 1], distance[near])]
        self._take([self._bound(row, bodies[row], float(safe[row]), qvel) for row in rows.tolist()])

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
