"""Velocity dampers that keep all links clear of the world and of each other during inverse kinematics.

For a pair of geoms at distance d with normal n (from the first to the second) at point p the damper demands, per tick,

    n . (J2(p) - J1(p)) dq >= -v dt,    v = (d - d_safe) / tau

so that a distance shrinks ever more slowly towards d_safe, and grows where it is smaller. What comes near an arm is
noticed earlier, and may come nearer as fast as a steady braking can still stop: `v = sqrt(2 a (d - d_safe))`. The
displacements dq are those of the joints between a geom and its root, whose own motion is taken from the last tick. Arms
keep clear of the world as seen from the base, and get out of the way of legs, whose motion is taken from the last tick
too. All other links keep clear as seen from a standing foot, so that the base turns and leans for them. The last links
of the feet, and of palms at a surface, are left to the paths of these limbs.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel
from toolkit.robot.near_pairs import NearPairs, near_boxes, reach_of, set_notice
from toolkit.robot.scale import Scale

MAX_ROWS = 24  # most dampers at a time, of the pairs nearest to their bound: each costs solver time, and few are active


@dataclass(frozen=True)
class Damper:
    """How a kind of pair is kept apart, with the numbers for a body of the usual size (`toolkit.robot.scale`).

    Attributes:
        safe_world, safe_self: m; wanted distance from the world and from the rest of the robot.
        room: m; what a pair has beyond the wanted distance when it is noticed.
        time: s; tau above: longer than a tick, shorter than a swing.
        weight: Per squared m by which a pair comes nearer in a tick than it may.
        braking: m/s^2; a above, 0 for the first law at all distances.
        firm: m; wanted distances beyond this are comfort: what is missing of them counts as the same share of this one.
            Weights go with the inverse square of the distance, so that a link between others finds the middle.
    """

    safe_world: float
    safe_self: float
    room: float
    time: float
    weight: float
    braking: float = 0.0
    firm: float = np.inf

    def speed(self, distance: np.ndarray, safe: np.ndarray) -> np.ndarray:
        """(k,) m/s; speeds at which pairs may come nearer, negative where they have to part.

        Args:
            distance: (k,) m; of the pairs.
            safe: (k,) m; their wanted distances, greater than 0.
        """
        room, firm = distance - safe, np.minimum(safe, self.firm)
        away = np.sqrt(2.0 * self.braking * np.maximum(room, 0.0)) if self.braking else room / self.time
        near = np.where(distance > 0.0, firm * room / safe, distance - firm) / self.time
        return np.where(room > 0.0, away, near)

    def share(self, distance: np.ndarray) -> np.ndarray:
        """(k,) shares of the weight that dampers have at distances (k,) m."""
        if np.isinf(self.firm):
            return np.ones(len(distance))
        return (self.firm / np.maximum(distance, self.firm / _PRESSED)) ** 2

    def scaled(self, scale: Scale) -> Damper:
        """The damper for a body of another size."""
        return Damper(
            safe_world=scale.length * self.safe_world,
            safe_self=scale.length * self.safe_self,
            room=scale.length * self.room,
            time=scale.time * self.time,
            weight=self.weight / scale.length**2,
            braking=self.braking,
            firm=scale.length * self.firm,
        )

    @property
    def notice(self) -> float:
        """The largest distance in m at which any pair is noticed."""
        return max(self.safe_world, self.safe_self) + self.room


ARM = Damper(safe_world=0.06, safe_self=0.012, room=0.12, time=0.15, weight=1e3, braking=10.0, firm=0.012)
"""Pairs with a link of an arm, which has much room and moves without need."""
BODY = Damper(safe_world=0.02, safe_self=0.01, room=0.04, time=0.05, weight=1e4)
"""Other pairs: legs have little room to spare; a foot strays by 1 cm from its path as it lifts off, its leg with it."""
FAR = replace(BODY, safe_world=0.035)
"""The same for motions that touched the world in execution."""
CLOSE = replace(BODY, safe_world=0.003, safe_self=0.003, room=0.015)
"""The same for motions that are too fast to keep more than clear."""
_PRESSED = 3.0  # at a distance of `firm` over this and less, weights are this squared
_BELOW = 0.8  # least vertical part of the normal to what is below a link, as the ground is
_SAFE_SHARE = 0.5  # of a pair's distance at home, where it is safe at no more than that


class Dampers(NamedTuple):
    """Dampers `matrix dq <= bound` over the joint displacements of one tick.

    Attributes:
        matrix: (k, n).
        bound: (k,) m.
        weight: (k,) per squared m.
    """

    matrix: np.ndarray
    bound: np.ndarray
    weight: np.ndarray

    def joined(self, others: Dampers) -> Dampers:
        """These and others."""
        return Dampers(*(np.concatenate(each) for each in zip(self, others, strict=True)))


class Avoidance:
    """Distances between the links, and to the world, in the composed scene, tick after tick."""

    def __init__(self, robot: RobotModel, scene: mujoco.MjModel, others: Damper = BODY):
        """Prepare a copy of the scene, robot and world in one model; `others` is for pairs without a link of an arm."""
        self.arms, self.others = ARM.scaled(robot.scale), others.scaled(robot.scale)
        self.model = copy.copy(scene)
        self.data = mujoco.MjData(self.model)
        model = self.model
        self.static = model.body_weldid[model.geom_bodyid] == 0
        self.arm = robot.in_arms(model)[model.geom_bodyid] >= 0
        self.legs = robot.carrying(FEET)
        self.body = {limb: int(model.body(item.body).id) for limb, item in robot.limbs.items()}
        self.of = {limb: model.geom_bodyid == body for limb, body in self.body.items()}
        self.base = int(model.body(robot.base).id)
        set_notice(model, np.where(self.static, 0.0, np.where(self.arm, self.arms.notice, self.others.notice)))
        self.box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        self.box_pairs = _box_pairs(model, self.static)
        self.box_notice = self._notice(self.box_pairs)
        self.box_reach = reach_of(model, self.box_pairs, self.box_notice)
        self.at_home = np.full((model.nbody, model.nbody), np.inf)
        self._place(robot.home)
        self._set_distances()
        self.height = self._heights()

    def dampers(
        self, qpos: np.ndarray, drift: np.ndarray, tick: float, touching: set[Limb], standing: Limb | None
    ) -> Dampers:
        """The dampers of one tick.

        Args:
            qpos: (7 + n,) present state.
            drift: (6 + n,) displacement in the last tick, as MuJoCo's qvel times the tick.
            tick: s.
            touching: Palms that come to a contact, hold or leave one; their hands may touch the world.
            standing: A foot that stands; None where there is none.
        """
        self._place(qpos)
        pairs = self._near(touching)
        world, arms = self._of_world(pairs.geoms), self._of_arms(pairs.geoms)
        at_home = self._home_distance(pairs)
        safe, room = np.empty((2, len(arms)))
        for damper, mine in ((self.arms, arms), (self.others, ~arms)):
            safe[mine] = np.where(world[mine], damper.safe_world, damper.safe_self)
            room[mine] = damper.room
        safe = np.minimum(safe, _SAFE_SHARE * at_home)
        near = (at_home > 0.0) & (pairs.distance < safe + room)
        pairs, arms, safe = pairs.of(near), arms[near], safe[near]
        stand = self.base if standing is None else self.body[standing]
        rate, bound = self._rates(pairs, np.where(arms, self.base, stand), drift)
        legs = np.flatnonzero(self.legs)
        bound[arms] += rate[np.ix_(arms, legs)] @ drift[6:][legs]  # arms get out of the way of legs,
        rate[np.ix_(arms, legs)] = 0.0  # never the other way round
        weight, slack = np.empty(len(arms)), bound + rate @ drift[6:]
        for damper, mine in ((self.arms, arms), (self.others, ~arms)):
            distance, wanted = pairs.distance[mine], safe[mine]
            bound[mine] += damper.speed(distance, wanted) * tick
            slack[mine] += damper.speed(distance, np.minimum(wanted, damper.firm)) * tick  # comfort crowds nothing out
            weight[mine] = damper.weight * damper.share(distance)
        kept = np.argsort(slack / np.maximum(np.linalg.norm(rate, axis=1), 1e-9), kind="stable")[:MAX_ROWS]
        return Dampers(-rate[kept], bound[kept], weight[kept])

    def _of_arms(self, geoms: np.ndarray) -> np.ndarray:
        """(k,) bool; which pairs (k, 2) of geoms have a link of an arm."""
        return np.any(self.arm[geoms], axis=1)

    def _of_world(self, geoms: np.ndarray) -> np.ndarray:
        """(k,) bool; which pairs (k, 2) of geoms have one of the world."""
        return np.any(self.static[geoms], axis=1)

    def _home_distance(self, pairs: NearPairs) -> np.ndarray:
        """(k,) m; distances of pairs' links at home, or of links from the ground below; -inf where links touch."""
        bodies, static = self.model.geom_bodyid[pairs.geoms], self.static[pairs.geoms]
        at_home = self.at_home[bodies[:, 0], bodies[:, 1]]
        above = self.height[np.where(static[:, 0], bodies[:, 1], bodies[:, 0])]
        from_world = np.where(np.abs(pairs.normal[:, 2]) < _BELOW, np.inf, above)
        return np.where(static.any(1), from_world, np.where(at_home > 0.0, at_home, -np.inf))

    def _rates(self, pairs: NearPairs, roots: np.ndarray, drift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k, n) derivatives of distances by the joints beyond roots (k,), and (k,) m that the roots' motion adds."""
        model, data = self.model, self.data
        bodies = np.column_stack([model.geom_bodyid[pairs.geoms], roots])
        jacobian = np.empty((*bodies.shape, 3, model.nv))
        for row, (each, point) in enumerate(zip(bodies.tolist(), pairs.point, strict=True)):
            for column, body in enumerate(each):
                mujoco.mj_jac(model, data, jacobian[row, column], None, point, body)
        before, after, rooted = np.einsum("ki,kcij->ckj", pairs.normal, jacobian)
        static = self.static[pairs.geoms]  # two links move as one with any root
        carried = (static[:, :1] * 1.0 - static[:, 1:]) * rooted
        return (after - before - carried)[:, 6:], carried @ drift

    def _place(self, qpos: np.ndarray) -> None:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)

    def _near(self, touching: set[Limb]) -> NearPairs:
        """Pairs of geoms within their notice, without those whose distance is left to the paths of limbs."""
        contact, free = self.data.contact, self.static.copy()
        for limb in touching.union(FEET):
            free |= self.of[limb]
        geoms, distance = contact.geom, contact.dist
        noticed = distance < self._notice(geoms)
        rows = np.flatnonzero(noticed & ~(self._left(geoms, free) | self.box[geoms].all(1)))
        rows = rows[np.argsort(distance[rows])]
        _, first = np.unique(geoms[rows] @ [self.model.ngeom, 1], return_index=True)  # the nearest points of each pair
        rows = rows[np.sort(first)]
        found = NearPairs(geoms[rows], distance[rows], contact.frame[rows, :3], contact.pos[rows])
        kept = ~self._left(self.box_pairs, free)
        boxes = self.box_pairs[kept], self.box_reach[kept], self.box_notice[kept]
        return found.joined(near_boxes(self.model, self.data, *boxes))

    def _notice(self, geoms: np.ndarray) -> np.ndarray:
        """(k,) m; distances at which pairs (k, 2) of geoms are noticed."""
        return np.where(self._of_arms(geoms), self.arms.notice, self.others.notice)

    def _left(self, geoms: np.ndarray, free: np.ndarray) -> np.ndarray:
        """(k,) bool; which pairs (k, 2) of geoms are of the world and a link that is free to touch it."""
        return self._of_world(geoms) & free[geoms].all(1)

    def _set_distances(self) -> None:
        """Least distances between bodies of the robot that are near each other in the posture as it is placed."""
        pairs = self._near(set())
        pairs = pairs.of(~self._of_world(pairs.geoms))
        first, second = self.model.geom_bodyid[pairs.geoms].T
        for a, b in ((first, second), (second, first)):
            np.minimum.at(self.at_home, (a, b), pairs.distance)

    def _heights(self) -> np.ndarray:
        """(nbody,) m; heights of all links above the soles in the posture as it is placed."""
        model, data, height = self.model, self.data, np.full(self.model.nbody, np.inf)
        for geom in np.flatnonzero(~self.static).tolist():
            upward, body = data.geom_xmat[geom].reshape(3, 3)[2], int(model.geom_bodyid[geom])
            lowest = data.geom_xpos[geom, 2] + upward @ model.geom_aabb[geom, :3]
            lowest -= np.abs(upward) @ model.geom_aabb[geom, 3:]
            height[body] = max(min(height[body], lowest), 0.0)
        return height


def _box_pairs(model: mujoco.MjModel, static: np.ndarray) -> np.ndarray:
    """(k, 2) int; pairs of boxes, one of them of the robot, between which MuJoCo looks for collisions."""
    first, second = model.geom_contype, model.geom_conaffinity
    boxes = np.flatnonzero(((first | second) != 0) & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX))
    own = boxes[~static[boxes]]
    a, b = (grid.ravel() for grid in np.meshgrid(own, boxes, indexing="ij"))
    kept = (static[b] | (a < b)) & ((first[a] & second[b] | first[b] & second[a]) != 0)
    a, b = a[kept], b[kept]
    weld = model.body_weldid[model.geom_bodyid]
    above = model.body_weldid[model.body_parentid[weld]]
    joined = (weld[a] == weld[b]) | (~static[b] & ((above[a] == weld[b]) | (above[b] == weld[a])))
    bodies = np.sort([model.geom_bodyid[a], model.geom_bodyid[b]], axis=0).astype(np.int64)
    joined |= np.isin((bodies[0] << 16) + bodies[1], model.exclude_signature)
    return np.column_stack([a, b])[~joined]
