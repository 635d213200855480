"""The quasi-static baseline: the same search without dynamics, but with static balance all along (paper, Sec. VII).

Every transition needs a CoM that is balanced on the contacts that stay and reaches what is touched, at take-off (the
old contacts) and at touch-down (the new ones). Between both it may move slowly, since the CoMs balanced on the same
contacts are a convex set. Only distance and the number of transitions cost.

A foot within its friction angle bears the weight below any CoM above its patch, and two such feet bear it below any CoM
above a point between the patches. The linear program of `toolkit.centroidal.balance` judges anything else, for example
a palm that has to hold a foot on a slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolkit.centroidal.balance import statically_balanced
from toolkit.centroidal.problem import Margins
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import rotation_about_z, steepness
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search.moves.legs import legs_of, reach
from toolkit.search.moves.limits import margins
from toolkit.search.planner import ContactPlanner
from toolkit.search.planner_config import PlannerConfig
from toolkit.world.world import World

_FRICTION = 0.9  # part of the friction coefficients that may be used
_PATCH = 0.5  # part of a sole's half extents in which the centre of pressure may be
_DROPS = (0.0, 0.06, 0.12, 0.18)  # parts of its height by which the CoM may be lower than at home
_KEPT = 20_000  # linear programs that are remembered
_PARTS = np.array([0.0, 0.5, 1.0])  # parts of the way from the support's middle to its point nearest to the other foot


class QuasiStaticEvaluator(TransitionEvaluator):
    """Judges by static balance at take-off and touch-down, with the kinematic limits of the search."""

    rejection = "no statically balanced posture at take-off or touch-down"

    def __init__(self, robot: RobotModel):
        self._robot, self._legs = robot, legs_of(robot, margins(robot))
        self._programs: dict[bytes, np.ndarray | None] = {}

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """Judge transitions; see `TransitionEvaluator`. The objective is 0."""
        n = len(transitions)
        feasible, end = np.zeros(n, bool), np.tile(np.asarray(com, float), (n, 1))
        take_off: dict[Limb, bool] = {}
        for index, transition in enumerate(transitions):
            support, limb = transition.during_swing(stance), transition.limb
            if limb not in take_off:
                take_off[limb] = self._balanced(support, stance) is not None
            if take_off[limb]:
                place = self._balanced(support, transition.apply(stance))
                if place is not None:
                    feasible[index], end[index] = True, place
        return TransitionBatch(feasible, np.zeros(n), end, np.zeros((n, 3)))

    def _balanced(self, support: Sequence[Contact], touched: Stance) -> np.ndarray | None:
        """(3,) m; a CoM balanced on `support` in reach of all contacts of `touched`; None where there is none."""
        feet = [contact for contact in support if contact.limb.is_foot]
        if all(self._holds(contact) for contact in feet):
            for x, y in self._above(feet, touched):
                for drop in _DROPS:
                    height = min(contact.pose.position[2] for contact in touched.contacts[:2])
                    place = np.array([x, y, height + (1.0 - drop) * self._robot.com_height])
                    if self._reaches(place, touched):
                        return place
        if all(contact.limb.is_foot for contact in support):
            return None  # a foot beyond its friction angle holds nothing without palms
        place = self._program(support)
        return place if place is not None and self._reaches(place, touched) else None

    def _holds(self, contact: Contact) -> bool:
        """Whether the surface is within its friction angle."""
        return bool(steepness(contact.pose.normal[2]) <= _FRICTION * contact.friction)

    def _above(self, feet: list[Contact], touched: Stance) -> np.ndarray:
        """(k, 2) m; points above the support, from its middle towards the middle of the stance."""
        centres = np.array([contact.pose.position[:2] for contact in feet])
        middle, target = centres.mean(0), touched.mean_feet.position[:2]
        if len(feet) == 2:
            return np.stack([middle, centres[0], centres[1]])
        pose, bearing = feet[0].pose, self._robot.limbs[feet[0].limb].borne(feet[0].bearing)
        axes = pose.rotation[:2, :2]  # of the patch, seen from above
        inner = np.clip(np.linalg.solve(axes, target - middle), -_PATCH * bearing, _PATCH * bearing)
        return middle + _PARTS[:, None] * (axes @ inner)

    def _reaches(self, com: np.ndarray, stance: Stance) -> bool:
        """Whether legs and arms reach every contact of a stance with this CoM."""
        yaw, place = stance.mean_feet.yaw, tuple(com)
        for contact in stance.contacts:
            pose = contact.pose
            if contact.limb.is_foot:
                if reach(self._legs, int(contact.limb), place, yaw, pose.position, pose.rotation)[0]:
                    return False
            else:
                arm = self._robot.arms[contact.limb]
                shoulder = com + rotation_about_z(yaw) @ arm.shoulder_in_com
                if not arm.min_reach <= np.linalg.norm(pose.position - shoulder) <= arm.max_reach:
                    return False
        return True

    def _program(self, support: Sequence[Contact]) -> np.ndarray | None:
        """(3,) m; best CoM of the linear program for contacts, remembered."""
        key = b"".join(
            np.round([contact.limb, *contact.pose.position, *contact.pose.rotation[:, 0]], 4).tobytes()
            for contact in support
        )
        if key not in self._programs:
            if len(self._programs) >= _KEPT:
                self._programs.clear()
            result = statically_balanced(self._robot, support, margins=Margins(friction=_FRICTION))
            self._programs[key] = result.com if result.balanced else None
        return self._programs[key]


def quasi_static_planner(robot: RobotModel, world: World, config: PlannerConfig | None = None) -> ContactPlanner:
    """The baseline planner; without walls for palms it leaves out ground beyond its friction angle at once.

    Of the settings `config`, the weights of dynamics, time, steepness and heading do not count.
    """
    config = config or PlannerConfig()
    palms = config.palms and bool(robot.arms) and _walls_in_reach(robot, world)
    config = replace(
        config,
        cost=replace(config.cost, dynamics=0.0, time=0.0, pace=0.0, steep=0.0, heading=0.0),
        rest_friction=None if palms else _FRICTION,
        one_timing=True,
    )
    return ContactPlanner(robot, world, QuasiStaticEvaluator(robot), config)


def _walls_in_reach(robot: RobotModel, world: World) -> bool:
    """Whether a corner of a palm surface is at waist height above ground no farther away than an arm reaches."""
    ground = [surface.rings[0] for surface in world.surfaces if surface.serves_foot]
    lower, upper = np.array([points.min(0) for points in ground]), np.array([points.max(0) for points in ground])
    reach = 1.5 * max(arm.max_reach for arm in robot.arms.values())
    for surface in world.surfaces:
        if surface.serves_palm:
            points = surface.rings[0][:, None]
            near = ((points >= lower - reach) & (points <= upper + reach))[..., :2].all(-1)
            if (near & (points[..., 2] - upper[:, 2] > 0.6 * robot.com_height)).any():
                return True
    return False
