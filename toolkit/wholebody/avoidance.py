"""Velocity dampers that keep all links clear of the world and of each other during inverse kinematics.

For a pair of geoms at distance d with normal n (from the first to the second) at point p the damper demands, per tick,

    n . (J2(p) - J1(p)) dq >= -v dt,    v = (d - d_safe) / tau

so that a distance shrinks ever more slowly towards d_safe, and grows where it is smaller. What comes near an arm is
noticed earlier, and may come nearer as fast as a steady braking can still stop: `v = sqrt(2 a (d - d_safe))`. The
displacements dq are those of the joints between a geom and its root, whose own motion is taken from the last tick. Arms
keep clear of the world as seen from the base, and get out of the way of legs, whose motion is taken from the last tick
too. All other links keep clear as seen from a standing foot, so that the base turns and leans for them. The last links
of the feet, and of palms that reach, are left to the paths of these limbs.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel
from toolkit.robot.scale import Scale
from toolkit.wholebody.collision import body_pair

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
        firm: m; wanted distances beyond this are comfort: what is missing of them counts as the same share of this one,
            and a damper weighs less the more of it there is, so that comfort gives way to what is about to touch.
    """

    safe_world: float
    safe_self: float
    room: float
    time: float
    weight: float
    braking: float = 0.0
    firm: float = np.inf

    def speed(self, distance: float, safe: float) -> float:
        """Speed in m/s at which a pair may come nearer, negative where it has to part.

        Args:
            distance: Of the pair, in m.
            safe: Its wanted distance in m.
        """
        room = distance - safe
        if room > 0.0:
            return float(np.sqrt(2.0 * self.braking * room)) if self.braking else room / self.time
        firm = min(safe, self.firm)
        return (firm * room / safe if distance > 0.0 else distance - firm) / self.time

    def share(self, distance: float) -> float:
        """Share of the weight that a damper has at a distance in m."""
        return min(self.firm / distance, 1.0) ** 2 if distance > 0.0 else 1.0

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
_BELOW = 0.8  # least vertical part of the normal to what is below a link, as the ground is
_SAFE_SHARE = 0.5  # of a pair's distance at home, where it is safe at no more than that


class _Pair(NamedTuple):
    """Two geoms near each other: their distance in m, the normal from the first to the second, and a point between."""

    first: int
    second: int
    distance: float
    normal: np.ndarray
    point: np.ndarray


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
        model.geom_gap[:] = 0.0
        model.geom_margin[:] = np.where(self.static, 0.0, np.where(self.arm, self.arms.notice, self.others.notice))
        model.body_margin[:] = 0.0
        np.maximum.at(model.body_margin, model.geom_bodyid, model.geom_margin)  # where collisions are looked for at all
        self.box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        self.box_pairs = _box_pairs(model, self.static)
        self.jacobians = [np.zeros((3, model.nv)) for _ in range(3)]
        self.at_home, self.height = self._distances(robot.home), np.zeros(model.nbody)
        self._set_heights()

    def dampers(
        self, qpos: np.ndarray, drift: np.ndarray, tick: float, reaching: set[Limb], standing: Limb | None
    ) -> Dampers:
        """The dampers of one tick.

        Args:
            qpos: (7 + n,) present state.
            drift: (6 + n,) displacement in the last tick, as MuJoCo's qvel times the tick.
            tick: s.
            reaching: Palms that approach, hold or leave a contact; their hands may touch the world.
            standing: A foot that stands; None where there is none.
        """
        self._place(qpos)
        stand = self.base if standing is None else self.body[standing]
        found = []
        for pair in self._near(reaching):
            damper, at_home = self._damper(pair), self._home_distance(pair)
            wanted = damper.safe_world if self._of_world(pair) else damper.safe_self
            safe = min(wanted, _SAFE_SHARE * at_home)
            if at_home > 0.0 and pair.distance < safe + damper.room:
                rate, known = self._rate(pair, self.base if damper is self.arms else stand, drift)
                if damper is self.arms:  # arms get out of the way of legs, never the other way round
                    known += float(rate[self.legs] @ drift[6:][self.legs])
                    rate[self.legs] = 0.0
                found.append(
                    (
                        -rate,
                        damper.speed(pair.distance, safe) * tick + known,
                        damper.weight * damper.share(pair.distance),
                    )
                )
        matrix = np.array([row for row, _, _ in found]).reshape(len(found), len(drift) - 6)
        bound, weight = np.array([bound for _, bound, _ in found]), np.array([weight for _, _, weight in found])
        size = np.maximum(np.linalg.norm(matrix, axis=1), 1e-9)
        kept = np.argsort((bound - matrix @ drift[6:]) / size, kind="stable")[:MAX_ROWS]
        return Dampers(matrix[kept], bound[kept], weight[kept])

    def _damper(self, pair: _Pair) -> Damper:
        return self.arms if self.arm[pair.first] or self.arm[pair.second] else self.others

    def _of_world(self, pair: _Pair) -> bool:
        return bool(self.static[pair.first] or self.static[pair.second])

    def _home_distance(self, pair: _Pair) -> float:
        """Distance in m of a pair's links at home, or of a link from the ground below; -inf where links touch."""
        if self._of_world(pair):
            if abs(pair.normal[2]) < _BELOW:
                return np.inf
            link = pair.second if self.static[pair.first] else pair.first
            return float(self.height[self.model.geom_bodyid[link]])
        at_home = self.at_home.get(body_pair(self.model, pair.first, pair.second), np.inf)
        return at_home if at_home > 0.0 else -np.inf

    def _rate(self, pair: _Pair, root: int, drift: np.ndarray) -> tuple[np.ndarray, float]:
        """(n,) derivative of a pair's distance by the joints beyond a root, and what the root's own motion adds."""
        model, (before, after, rooted) = self.model, self.jacobians
        rate, known = np.zeros(model.nv), 0.0
        for geom, jacobian, sign in ((pair.first, before, -1.0), (pair.second, after, 1.0)):
            if not self.static[geom]:
                mujoco.mj_jac(model, self.data, jacobian, None, pair.point, int(model.geom_bodyid[geom]))
                rate += (sign * pair.normal) @ jacobian
        if self._of_world(pair):  # two links move as one with any root
            mujoco.mj_jac(model, self.data, rooted, None, pair.point, root)
            carried = pair.normal @ rooted if self.static[pair.first] else -pair.normal @ rooted
            rate, known = rate - carried, float(carried @ drift)
        return rate[6:], known

    def _place(self, qpos: np.ndarray) -> None:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)

    def _near(self, reaching: set[Limb]) -> Iterator[_Pair]:
        """Pairs of geoms within their notice, without those whose distance is left to the paths of limbs."""
        contact, free = self.data.contact, self.static.copy()
        for limb in reaching.union(FEET):
            free |= self.of[limb]
        geoms, distances = contact.geom, contact.dist
        rows = np.flatnonzero(~(self._left(geoms[:, 0], geoms[:, 1], free) | self.box[geoms].all(1)))
        seen: set[tuple[int, int]] = set()
        for index in rows[np.argsort(distances[rows])].tolist():
            first, second = geoms[index].tolist()
            pair = _Pair(first, second, float(distances[index]), contact.frame[index, :3], contact.pos[index])
            if (first, second) not in seen and pair.distance < self._damper(pair).notice:
                seen.add((first, second))
                yield pair
        yield from self._near_boxes(free)

    def _left(self, first: np.ndarray, second: np.ndarray, free: np.ndarray) -> np.ndarray:
        """(k,) bool; which pairs of geoms are of the world and a link that is free to touch it."""
        return (self.static[first] | self.static[second]) & free[first] & free[second]

    def _near_boxes(self, free: np.ndarray) -> Iterator[_Pair]:
        """The same for pairs of boxes; MuJoCo's collision function finds those apart only if two faces are opposite."""
        model, data, ends = self.model, self.data, np.zeros(6)
        first, second = self.box_pairs.T
        notice = np.where(self.arm[first] | self.arm[second], self.arms.notice, self.others.notice)
        apart = np.linalg.norm(data.geom_xpos[first] - data.geom_xpos[second], axis=1)
        near = apart < notice + model.geom_rbound[first] + model.geom_rbound[second]
        near &= ~self._left(first, second, free)
        for row in np.flatnonzero(near).tolist():
            a, b = int(first[row]), int(second[row])
            distance = mujoco.mj_geomDistance(model, data, a, b, float(notice[row]), ends)
            if distance < notice[row] and abs(distance) > 1e-9:
                yield _Pair(a, b, distance, (ends[3:] - ends[:3]) / distance, 0.5 * (ends[:3] + ends[3:]))

    def _distances(self, qpos: np.ndarray) -> dict[tuple[int, int], float]:
        """Least distances in m between bodies of the robot that are near each other in a posture."""
        self._place(qpos)
        apart: dict[tuple[int, int], float] = {}
        for pair in self._near(set()):
            if not self._of_world(pair):
                bodies = body_pair(self.model, pair.first, pair.second)
                apart[bodies] = min(apart.get(bodies, np.inf), pair.distance)
        return apart

    def _set_heights(self) -> None:
        """Heights of all links above the soles in the posture at which they are placed."""
        model, data = self.model, self.data
        self.height[:] = np.inf
        for geom in np.flatnonzero(~self.static).tolist():
            upward, body = data.geom_xmat[geom].reshape(3, 3)[2], int(model.geom_bodyid[geom])
            lowest = data.geom_xpos[geom, 2] + upward @ model.geom_aabb[geom, :3]
            lowest -= np.abs(upward) @ model.geom_aabb[geom, 3:]
            self.height[body] = max(min(self.height[body], lowest), 0.0)


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
