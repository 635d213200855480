"""Limits of the legs and arms along a centroidal motion, checked in NumPy.

Joint angles of the stance legs follow from the CoM in closed form, and joint torques from the wrench under the sole
(`toolkit.physics.leg`); the leg's own weight and inertia are left out. A foot in the air is assumed on a smooth path
between its two contacts, and its hip must stay within a leg's length of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from toolkit.centroidal.problem import CentroidalMotion, CentroidalProblem
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.physics.leg import PLANNED, TORQUE_ROLES, ReachMargins, leg_clearances, leg_posture, leg_torques
from toolkit.robot.model import RobotModel


@dataclass(frozen=True)
class BodyMargins(ReachMargins):
    """How far inside the body's limits a plan stays; the defaults are the limits themselves.

    Attributes:
        length: m; taken off both ends of the hip-ankle and shoulder-palm distances.
        ankle: rad; taken off both ends of ankle pitch and roll.
        hip: rad; taken off both ends of hip roll and pitch.
        height: m; added to the least CoM height.
        torque: Part of each leg joint's torque that may be used.
        most_torque: The same where nothing else helps, for optimisers; the rest is for the motion itself, and for
            corrections.
    """

    ankle: float = 0.0
    height: float = 0.0
    torque: float = 1.0
    most_torque: float = 1.0

    def scaled(self, factor: float) -> Self:
        """The same with its lengths multiplied by a factor."""
        return replace(self, length=factor * self.length, height=factor * self.height)


@dataclass(frozen=True)
class BodyResiduals:
    """By how much a motion exceeds the body's limits.

    Attributes:
        names: The K limits.
        table: (K, N + 1, 4) by limit, knot and limb in m or rad, torques as a part of the limit; negative or -inf where
            the limit is kept, inf where undefined. What happens during a step is entered at its first knot.
    """

    names: tuple[str, ...]
    table: np.ndarray

    @property
    def violation(self) -> dict[str, np.ndarray]:
        """Name of the limit -> (N + 1, 4), its part of the table."""
        return dict(zip(self.names, self.table, strict=True))

    @property
    def largest(self) -> float:
        """The largest violation of all, 0 where there is none; inf where undefined."""
        return float(self.table.max(initial=0.0))

    @property
    def worst(self) -> tuple[str, int, Limb]:
        """Name, knot and limb of the largest violation."""
        limit, knot, limb = np.unravel_index(int(np.argmax(self.table)), self.table.shape)
        return self.names[limit], int(knot), Limb(int(limb))


POSTURES = tuple(limit.name for limit in PLANNED)
TORQUES = tuple(f"{role.replace('_', ' ')} torque" for role in TORQUE_ROLES)
SWING_LEG, ARM, HEIGHT, ROOM = "swing leg length", "arm reach", "CoM height", "room of the body"
SHIN = "room of the shin"


def body_residuals(motion: CentroidalMotion, robot: RobotModel, margins: BodyMargins = BodyMargins()) -> BodyResiduals:
    """How far a motion, feasible or not, exceeds the limits of the robot's legs and arms less the margins."""
    p, n = motion.placed, motion.problem.steps
    world = *((ROOM,) if p.room is not None else ()), *((SHIN,) if p.lean is not None else ())
    names = *POSTURES, SWING_LEG, *TORQUES, ARM, HEIGHT, *world
    table = np.full((len(names), n + 1, 4), -np.inf)
    _enter_postures(table[: len(POSTURES)], p, motion, robot, margins)
    first = names.index(TORQUES[0])
    _enter_torques(table[first : first + len(TORQUES)], p, motion, robot, margins.torque)

    def enter(name: str, at: np.ndarray, limb: np.ndarray, value: np.ndarray) -> None:
        np.maximum.at(table[names.index(name)], (at, limb), value)

    knots, limbs, positions, _ = p.knot_contacts
    swing_knots, swing_delays, swing_limbs, swing_tips, _ = p.swing_ankles
    base = rotation_about_z(p.yaw)
    com = motion.com[swing_knots] + swing_delays[:, None] * motion.linear_momentum[swing_knots] / p.mass
    hips = np.array([robot.legs[limb].hip_in_com for limb in FEET])
    shortest, longest = np.array([[robot.legs[limb].min_length, robot.legs[limb].max_length] for limb in FEET]).T
    hip = com + (base[swing_knots] @ hips[swing_limbs, :, None])[..., 0]
    length = np.linalg.norm(hip - swing_tips, axis=-1)
    outside = np.maximum(shortest[swing_limbs] - length, length - longest[swing_limbs]) + margins.length
    enter(SWING_LEG, swing_knots, swing_limbs, outside)
    for limb, arm in robot.arms.items():
        here = np.flatnonzero(limbs == limb)
        if len(here):
            shoulder = motion.com[knots[here]] + base[knots[here]] @ arm.shoulder_in_com
            length = np.linalg.norm(shoulder - positions[here], axis=-1)
            outside = np.maximum(arm.min_reach - length, length - arm.max_reach) + margins.length
            enter(ARM, knots[here], limbs[here], outside)
    floor, foot = p.lowest_foot
    enter(HEIGHT, np.arange(n + 1), foot, floor + p.min_height + margins.height - motion.com[:, 2])
    if p.room is not None:
        enter(ROOM, p.room.knot, foot[p.room.knot], p.room.excess(motion.com))
    if p.lean is not None:
        _enter_leans(table[names.index(SHIN)], p, motion, robot, margins)
    table[np.isnan(table)] = np.inf
    return BodyResiduals(names, table)


def _enter_postures(
    table: np.ndarray, p: CentroidalProblem, motion: CentroidalMotion, robot: RobotModel, margins: BodyMargins
) -> None:
    """Enter by how much the postures of the legs in contact exceed their limits; nan if undefined."""
    knots, limbs, positions, rotations = p.knot_contacts
    for limb in FEET:
        here = limbs == limb
        at = knots[here]
        given = motion.com[at], p.yaw[at], positions[here], rotations[here]
        clearances = leg_clearances(robot.legs[limb], *given, margins)
        table[:, at, limb] = [-clearances[name] for name in POSTURES]


def _enter_leans(
    table: np.ndarray, p: CentroidalProblem, motion: CentroidalMotion, robot: RobotModel, margins: BodyMargins
) -> None:
    """Enter how far the shins of the legs in contact lean into what stands before their feet; nan if undefined."""
    knots, limbs, positions, rotations = p.knot_contacts
    for limb in FEET:
        here = np.flatnonzero((limbs == limb) & np.isfinite(p.knot_leans))
        at = knots[here]
        posture = leg_posture(robot.legs[limb], motion.com[at], p.yaw[at], positions[here], rotations[here])
        table[at, limb] = -posture.ankle_pitch - p.knot_leans[here] + margins.ankle


def _enter_torques(
    table: np.ndarray, p: CentroidalProblem, motion: CentroidalMotion, robot: RobotModel, part: float
) -> None:
    """Enter how far the torques of legs amid each step exceed `part` of their limits; nan if undefined."""
    feet = len(FEET)
    rotation, force = p.rotation[:, :feet], motion.force[:, :feet]
    arm = np.einsum("tlij,tlj->tli", rotation[..., :2], motion.cop[:, :feet])
    moment = np.cross(arm, force) + motion.yaw_torque[:, :feet, None] * rotation[..., 2]
    yaw = (p.yaw[:-1] + p.yaw[1:]) / 2
    middle = motion.com[:-1] + p.dt[:, None] / 2 * motion.linear_momentum[:-1] / p.mass
    for limb in FEET:
        leg, step = robot.legs[limb], np.flatnonzero(p.active[:, limb])
        wrench = rotation[step, limb], force[step, limb], moment[step, limb]
        torques = leg_torques(leg, middle[step], yaw[step], p.position[step, limb], *wrench)
        table[:, step, limb] = [np.abs(torques[role]) / leg.torques[role] - part for role in TORQUE_ROLES]


def rough_com(problem: CentroidalProblem) -> tuple[np.ndarray, np.ndarray]:
    """(N + 1, 3) m and m/s; a CoM at the knots that follows the mean of the feet, and its velocity after them."""
    p = problem
    com = p.mean_feet.copy()
    com[:, 2] += p.home_heights
    width = min(max(p.steps // 20, 3), 15)  # a wider window would leave the feet behind where the motion ends
    padded = np.concatenate([np.repeat(p.com[None], width, 0), com, np.repeat(com[-1:], width, 0)])
    window = np.hanning(2 * width + 3)[1:-1]
    com = np.stack([np.convolve(padded[:, i], window / window.sum(), "valid") for i in range(3)], 1)
    return com, np.vstack([np.diff(com, axis=0) / p.dt[:, None], np.zeros(3)])
