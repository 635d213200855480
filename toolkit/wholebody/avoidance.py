"""Velocity dampers that keep free arms off the world and off the body during inverse kinematics.

For a pair of geoms at distance d with normal n (from the first to the second) at point p the damper demands, per tick,

    n . (J2(p) - J1(p)) dq >= -(d - d_safe) dt / tau

so that a distance shrinks ever more slowly towards d_safe, and grows where it is smaller. The legs are determined by
the feet and the CoM; only the final collision check covers them.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from toolkit.geometry.limb import PALMS, Limb
from toolkit.robot.model import RobotModel
from toolkit.wholebody.collision import body_pair

NOTICE = 0.12  # m; larger distances are ignored
SAFE_WORLD, SAFE_SELF = 0.06, 0.012  # m; wanted distance of an arm from the world and from the rest of the robot
TIME = 0.15  # s; tau above: much longer than a tick, shorter than a swing
MAX_ROWS = 16  # most dampers at a time, of the nearest pairs: each costs solver time, and few are active


class ArmAvoidance:
    """Distances of the arms in the composed scene, tick after tick."""

    def __init__(self, robot: RobotModel, scene: mujoco.MjModel):
        """Prepare a copy of the scene, robot and world in one model."""
        self.model = copy.copy(scene)
        self.data = mujoco.MjData(self.model)
        self.static = self.model.body_weldid[self.model.geom_bodyid] == 0
        self.arm_of = robot.in_arms(self.model)[self.model.geom_bodyid]
        hands = {limb: self.model.body(robot.limbs[limb].body).id for limb in PALMS if limb in robot.limbs}
        self.hand = {limb: self.model.geom_bodyid == body for limb, body in hands.items()}
        self.model.geom_margin[:] = 0.0
        self.model.geom_gap[:] = 0.0
        self.model.geom_margin[self.arm_of >= 0] = NOTICE
        self.box = self.model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        solid = self.box & ((self.model.geom_contype != 0) | (self.model.geom_conaffinity != 0))
        self.boxes, self.arm_boxes = np.flatnonzero(solid), np.flatnonzero(solid & (self.arm_of >= 0))
        self.near = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        self.resting = self._pairs_below(robot.home, SAFE_SELF)

    def rows(self, qpos: np.ndarray, drift: np.ndarray, tick: float, reaching: set[Limb]) -> tuple:
        """A (k, n) and b (k,) of the dampers `A dq <= b` over the joint displacements of one tick.

        Args:
            qpos: (7 + n,) present state.
            drift: (6,) displacement of the base in the last tick, as MuJoCo's qvel times the tick.
            tick: s.
            reaching: Palms that approach, hold or leave a contact; their hands may touch the world.
        """
        model, data = self.model, self.data
        self._place(qpos)
        found = []
        for first, second, distance, normal, point in self._contacts():
            if self._ignored(first, second, reaching):
                continue
            world = self.static[first] or self.static[second]
            safe = SAFE_WORLD if world else SAFE_SELF
            found.append((distance - safe, first, second, normal, point))
        found.sort(key=lambda item: item[0])
        found = found[:MAX_ROWS]
        matrix, bound = np.zeros((len(found), model.nv - 6)), np.zeros(len(found))
        before, after = self.near
        for row, (room, first, second, normal, point) in enumerate(found):
            mujoco.mj_jac(model, data, before, None, point, model.geom_bodyid[first])
            mujoco.mj_jac(model, data, after, None, point, model.geom_bodyid[second])
            rate = normal @ (after - before)
            matrix[row] = -rate[6:]
            bound[row] = room * tick / TIME + rate[:6] @ drift
        return matrix, bound

    def _place(self, qpos: np.ndarray) -> None:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)

    def _contacts(self):
        """Pairs of geoms within `NOTICE`: both geoms, their distance, the normal from first to second, and a point."""
        contact = self.data.contact
        nearest: dict[tuple[int, int], int] = {}
        for index, (first, second) in enumerate(contact.geom.tolist()):
            if self.box[first] and self.box[second]:
                continue
            kept = nearest.get((first, second))
            if kept is None or contact.dist[index] < contact.dist[kept]:
                nearest[first, second] = index
        for (first, second), index in nearest.items():
            yield first, second, float(contact.dist[index]), contact.frame[index, :3], contact.pos[index]
        yield from self._box_pairs()

    def _box_pairs(self):
        """The same for pairs of boxes; MuJoCo's collision function finds those apart only if two faces are opposite."""
        model, data = self.model, self.data
        others, ends = self.boxes, np.zeros(6)
        for arm in self.arm_boxes:
            apart = np.linalg.norm(data.geom_xpos[others] - data.geom_xpos[arm], axis=1)
            near = apart < NOTICE + model.geom_rbound[others] + model.geom_rbound[arm]
            for other in others[near & (self.arm_of[others] != self.arm_of[arm])].tolist():
                distance = mujoco.mj_geomDistance(model, data, int(arm), other, NOTICE, ends)
                if distance < NOTICE and abs(distance) > 1e-9:
                    yield int(arm), other, distance, (ends[3:] - ends[:3]) / distance, 0.5 * (ends[:3] + ends[3:])

    def _ignored(self, first: int, second: int, reaching: set[Limb]) -> bool:
        if self.arm_of[first] < 0 and self.arm_of[second] < 0:
            return True
        if body_pair(self.model, first, second) in self.resting:
            return True
        world = self.static[first] or self.static[second]
        return world and any(self.hand[limb][first] or self.hand[limb][second] for limb in reaching)

    def _pairs_below(self, qpos: np.ndarray, distance: float) -> set[tuple[int, int]]:
        """Pairs of the robot's bodies, mostly neighbours, that are nearer than a distance (m) in a posture."""
        self._place(qpos)
        return {
            body_pair(self.model, first, second)
            for first, second, apart, _, _ in self._contacts()
            if apart < distance and not (self.static[first] or self.static[second])
        }
