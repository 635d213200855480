"""Nominal: the planned centroidal motion with a rest at its end, as the states and wrenches that replans keep to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.centroidal.problem import GRAVITY, CentroidalMotion, CentroidalProblem
from toolkit.control.sampled_plan import Reference, Swing
from toolkit.robot.scale import USUAL, Scale
from toolkit.wholebody.motion_dynamics import planned_wrench

HORIZON = 1.6  # s for a body of the usual size (`toolkit.robot.scale`); how far a replan looks ahead
REST = 0.2  # s for the same; steps of the rest


@dataclass(frozen=True)
class Nominal:
    """A planned motion in M steps, ending with a rest as long as a horizon. SI units, world frame.

    Attributes:
        problem: The problem of these steps, with the contacts.
        times: (M + 1,) s.
        com, velocity, acceleration: (M + 1, 3), (M + 1, 3) and (M, 3).
        spin, wrench_spin: Each (M + 1, 3) m^2/s; angular momentum about the CoM per mass, of the postures and of the
            wrenches (the optimiser's).
        wrench: (M, 4, 6) about the centre of the patch in the contact frame, in weights and weights times 1 m.
        share: (M, 2) shares of the feet in the load.
        landing: (M, 4) index of the swing that made the contact; -1 for those of the start.
        swings: The planned moves.
        scale: The robot's size.
    """

    problem: CentroidalProblem
    times: np.ndarray
    com: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    wrench_spin: np.ndarray
    acceleration: np.ndarray
    wrench: np.ndarray
    share: np.ndarray
    landing: np.ndarray
    swings: tuple[Swing, ...]
    scale: Scale

    @property
    def horizon(self) -> float:
        """How far a replan looks ahead, in s."""
        return self.scale.time * HORIZON

    @classmethod
    def of(cls, motion: CentroidalMotion, reference: Reference, scale: Scale = USUAL) -> Nominal:
        """The grid of a planned motion, with the moves and the postures' angular momentum of its reference."""
        rested, swings = _rested(motion, scale.time), reference.swings
        problem, mass = rested.problem, rested.problem.mass
        weight = mass * float(np.linalg.norm(GRAVITY))
        moving = problem.times[:-1] < motion.problem.times[-1] - 1e-9
        load = np.where(problem.active[:, :2], np.maximum(rested.force[:, :2, 2], 0.0), 0.0)
        middle = (problem.times[:-1] + problem.times[1:]) / 2
        landing = np.full((problem.steps, 4), -1)
        for index, swing in enumerate(swings):
            landing[middle > swing.end, swing.limb] = index
        acceleration = rested.force.sum(1) / mass + GRAVITY
        return cls(
            problem=problem,
            times=problem.times,
            com=rested.com,
            velocity=rested.linear_momentum / mass,
            spin=np.column_stack(
                [np.interp(problem.times, reference.times, part) / mass for part in reference.angular_momentum.T]
            ),
            wrench_spin=rested.angular_momentum / mass,
            acceleration=np.where(moving[:, None], acceleration, 0.0),
            wrench=planned_wrench(rested) / weight,
            share=load / np.maximum(load.sum(1, keepdims=True), 1e-9),
            landing=landing,
            swings=swings,
            scale=scale,
        )


def _rested(motion: CentroidalMotion, pace: float) -> CentroidalMotion:
    """The same motion with a rest at its end; the pace is the factor on times."""
    problem, room = motion.solved, motion.solved.room
    rest = int(np.ceil(HORIZON / REST)) + 1
    step = np.append(np.arange(problem.steps), np.full(rest, problem.steps - 1))
    zero = np.zeros((rest, 3))
    longer = replace(
        problem,
        dt=np.append(problem.dt, np.full(rest, pace * REST)),
        active=problem.active[step],
        position=problem.position[step],
        rotation=problem.rotation[step],
        friction=problem.friction[step],
        half_size=problem.half_size[step],
        yaw=np.append(problem.yaw, np.full(rest, problem.yaw[-1])),
        lean=None if problem.lean is None else problem.lean[step],
        room=None if room is None else replace(room, sink=np.append(room.sink, np.full(rest, room.sink[-1]))),
    )
    return replace(
        motion,
        problem=longer,
        kept=None,
        landed=None,
        com=np.concatenate([motion.com, np.tile(motion.com[-1], (rest, 1))]),
        linear_momentum=np.concatenate([motion.linear_momentum, zero]),
        angular_momentum=np.concatenate([motion.angular_momentum, zero]),
        force=motion.force[step],
        cop=motion.cop[step],
        yaw_torque=motion.yaw_torque[step],
    )
