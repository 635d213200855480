"""Nominal: the planned centroidal motion on the grid of the replans, with the body's limits linearised about it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.centroidal.body import BodyMargins, knot_contacts, swing_ankles
from toolkit.centroidal.problem import GRAVITY, CentroidalMotion, CentroidalProblem
from toolkit.control.sampled_plan import Reference, Swing
from toolkit.geometry.limb import FEET, PALMS
from toolkit.geometry.pose import rotation_about_z
from toolkit.physics.leg import PLANNED, TORQUE_ROLES, leg_clearances, leg_posture, leg_torques
from toolkit.robot.model import RobotModel
from toolkit.wholebody.motion_dynamics import planned_wrench

HORIZON = 1.6  # s; how far a replan looks ahead
DIFFERENCE = 1e-5  # m; step of the CoM for gradients of clearances
MAX_DT = 0.1  # s; longest step of the grid: a swing has a few of them
BODY = BodyMargins(length=0.007, ankle=0.05, hip=0.025, height=0.01, torque=0.92)
"""Margins kept inside the body's limits. They are smaller than the plan's, so that a correction has some room."""


@dataclass(frozen=True)
class BodyRows:
    """Clearances of K limits of legs and arms, to first order in the CoM, in order of knots.

    Attributes:
        knot, limb: Each (K,); the knot, and the limb whose contact counts, or -1 for a leg in the air.
        clearance: (K,) m or rad at the plan less the margins; at least 0.
        gradient: (K, 3) with respect to the CoM relative to the contact.
    """

    knot: np.ndarray
    limb: np.ndarray
    clearance: np.ndarray
    gradient: np.ndarray


@dataclass(frozen=True)
class Nominal:
    """A planned motion in M steps, ending with a rest as long as a horizon. SI units, world frame.

    Attributes:
        mass: Mass in kg.
        times: (M + 1,) s.
        com, velocity, acceleration: (M + 1, 3), (M + 1, 3) and (M, 3).
        spin, wrench_spin: Each (M + 1, 3) m^2/s; angular momentum about the CoM per mass, of the postures and of the
            wrenches (the optimiser's).
        active, position, rotation, friction: Contacts (M, 4), (M, 4, 3), (M, 4, 3, 3) and (M, 4).
        wrench: (M, 4, 6) about the centre of the patch in the contact frame, in weights and weights times 1 m.
        share: (M, 2) shares of the feet in the load.
        landing: (M, 4) index of the swing that made the contact; -1 for those of the start.
        torque: (M, 2, 5, 6) torques of the legs' joints per unit of wrench over their limits.
        rows: Limits of the body.
        swings: The planned moves.
    """

    mass: float
    times: np.ndarray
    com: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    wrench_spin: np.ndarray
    acceleration: np.ndarray
    active: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    friction: np.ndarray
    wrench: np.ndarray
    share: np.ndarray
    landing: np.ndarray
    torque: np.ndarray
    rows: BodyRows
    swings: tuple[Swing, ...]

    @classmethod
    def of(cls, motion: CentroidalMotion, reference: Reference, robot: RobotModel) -> Nominal:
        """The grid of a planned motion, with the moves and the postures' angular momentum of its reference."""
        fine, swings = _refined(motion), reference.swings
        problem, mass = fine.problem, fine.problem.mass
        weight = mass * float(np.linalg.norm(GRAVITY))
        moving = problem.times[:-1] < motion.problem.times[-1] - 1e-9
        load = np.where(problem.active[:, :2], np.maximum(fine.force[:, :2, 2], 0.0), 0.0)
        middle = (problem.times[:-1] + problem.times[1:]) / 2
        landing = np.full((problem.steps, 4), -1)
        for index, swing in enumerate(swings):
            landing[middle > swing.end, swing.limb] = index
        acceleration = fine.force.sum(1) / mass + GRAVITY
        return cls(
            mass=mass,
            times=problem.times,
            com=fine.com,
            velocity=fine.linear_momentum / mass,
            spin=np.column_stack(
                [np.interp(problem.times, reference.times, part) / mass for part in reference.angular_momentum.T]
            ),
            wrench_spin=fine.angular_momentum / mass,
            acceleration=np.where(moving[:, None], acceleration, 0.0),
            active=problem.active,
            position=problem.position,
            rotation=problem.rotation,
            friction=problem.friction,
            wrench=planned_wrench(fine) / weight,
            share=load / np.maximum(load.sum(1, keepdims=True), 1e-9),
            landing=landing,
            torque=_torque_rows(fine, robot, weight),
            rows=_body_rows(fine, robot),
            swings=swings,
        )


def _refined(motion: CentroidalMotion) -> CentroidalMotion:
    """The same motion on a finer grid, with a rest at its end."""
    problem = motion.solved
    count = np.maximum(np.ceil(problem.dt / MAX_DT - 1e-9).astype(int), 1)
    step = np.repeat(np.arange(problem.steps), count)
    dt = (problem.dt / count)[step]
    start = np.concatenate([[0.0], np.cumsum(dt)])[:-1]
    inside = (start - problem.times[step])[:, None]
    acceleration = (motion.force.sum(1) / problem.mass + GRAVITY)[step]
    momentum = motion.linear_momentum[step] + inside * problem.mass * acceleration
    com = motion.com[step] + inside * (motion.linear_momentum[step] / problem.mass + 0.5 * inside * acceleration)
    share = inside / problem.dt[step, None]
    spin = (1.0 - share) * motion.angular_momentum[step] + share * motion.angular_momentum[step + 1]
    rest = int(np.ceil(HORIZON / MAX_DT)) + 1
    step = np.append(step, np.full(rest, problem.steps - 1))
    zero = np.zeros((rest + 1, 3))
    fine: CentroidalProblem = replace(
        problem,
        dt=np.append(dt, np.full(rest, MAX_DT)),
        active=problem.active[step],
        position=problem.position[step],
        rotation=problem.rotation[step],
        friction=problem.friction[step],
        yaw=np.concatenate([np.interp(start, problem.times, problem.yaw), np.full(rest + 1, problem.yaw[-1])]),
    )
    return replace(
        motion,
        problem=fine,
        kept=None,
        landed=None,
        com=np.concatenate([com, np.tile(motion.com[-1], (rest + 1, 1))]),
        linear_momentum=np.concatenate([momentum, zero]),
        angular_momentum=np.concatenate([spin, zero]),
        force=motion.force[step],
        cop=motion.cop[step],
        yaw_torque=motion.yaw_torque[step],
    )


def _torque_rows(motion: CentroidalMotion, robot: RobotModel, weight: float) -> np.ndarray:
    """Torques (M, 2, 5, 6) of each stance leg's joints over their limits, per unit wrench in the contact frame."""
    problem = motion.problem
    rows = np.zeros((problem.steps, 2, len(TORQUE_ROLES), 6))
    middle, yaw = (motion.com[:-1] + motion.com[1:]) / 2, (problem.yaw[:-1] + problem.yaw[1:]) / 2
    for limb in FEET:
        leg = robot.legs[limb]
        step = np.flatnonzero(problem.active[:, limb])
        sole, rotation = problem.position[step, limb], problem.rotation[step, limb]
        posture = leg_posture(leg, middle[step], yaw[step], sole, rotation)
        for axis in range(6):
            force, moment = np.zeros((2, len(step), 3))
            (force if axis < 3 else moment)[:] = weight * rotation[:, :, axis % 3]
            torques = leg_torques(posture, sole, rotation, force, moment)
            for row, role in enumerate(TORQUE_ROLES):
                rows[step, limb, row, axis] = torques[role] / leg.torques[role]
    return rows


def _body_rows(motion: CentroidalMotion, robot: RobotModel) -> BodyRows:
    """Limits of legs and arms at the knots where they apply."""
    problem = motion.problem
    knots, limbs, positions, rotations = knot_contacts(problem)
    base = rotation_about_z(problem.yaw)
    tables = []

    def enter(at: np.ndarray, limb: int, clearances) -> None:
        """Enter clearances at knots, and their gradients by central differences."""
        value = clearances(motion.com[at])
        slopes = []
        for axis in range(3):
            step = np.zeros(3)
            step[axis] = DIFFERENCE
            slopes.append((clearances(motion.com[at] + step) - clearances(motion.com[at] - step)) / (2 * DIFFERENCE))
        count = value.shape[1]
        gradient = np.stack(slopes, -1).reshape(-1, 3)
        tables.append((np.repeat(at, count), np.full(len(at) * count, limb), value.ravel(), gradient))

    in_air, delays, feet, ankles, _ = swing_ankles(problem)
    swing_knots, swing_limbs, tips = (each[delays == 0.0] for each in (in_air, feet, ankles))
    for limb in FEET:
        leg, here = robot.legs[limb], limbs == limb
        at, position, rotation = knots[here], positions[here], rotations[here]

        def stance(com, leg=leg, at=at, position=position, rotation=rotation):
            found = leg_clearances(leg, leg_posture(leg, com, problem.yaw[at], position, rotation), BODY)
            return np.stack([found[limit.name] for limit in PLANNED], -1)

        enter(at, limb, stance)
        here = swing_limbs == limb
        at, tip = swing_knots[here], tips[here]

        def swing(com, leg=leg, at=at, tip=tip):
            length = np.linalg.norm(com + base[at] @ leg.hip_in_com - tip, axis=-1)
            return (leg.max_length - BODY.length - length)[:, None]

        enter(at, -1, swing)
    for limb in PALMS:
        here = limbs == limb
        if not here.any():
            continue
        arm, at, position = robot.arms[limb], knots[here], positions[here]

        def palm(com, arm=arm, at=at, position=position):
            length = np.linalg.norm(com + base[at] @ arm.shoulder_in_com - position, axis=-1)
            return np.minimum(length - arm.min_reach, arm.max_reach - length)[:, None] - BODY.length

        enter(at, limb, palm)
    knot, limb, clearance, gradient = (np.concatenate(column) for column in zip(*tables, strict=True))
    order = np.argsort(knot, kind="stable")
    return BodyRows(knot[order], limb[order], np.maximum(clearance[order], 0.0), gradient[order])
