"""PlanRows: the limits of the body along a whole plan, from which the programs of replans take theirs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.centroidal.body import BodyMargins
from toolkit.centroidal.layout import Layout
from toolkit.centroidal.problem import CentroidalProblem
from toolkit.centroidal.program import Program, Regularisers
from toolkit.centroidal.stages.blocks import Block
from toolkit.centroidal.stages.rows import DISTANCE_ROWS, LEG_ROWS, POSTURE, TORQUE_ROWS
from toolkit.centroidal.stages.steps import STATE
from toolkit.geometry.limb import FEET
from toolkit.replanning.situation import HorizonContacts
from toolkit.robot.model import RobotModel

BODY = BodyMargins(length=0.007, ankle=0.05, hip=0.025, height=0.01, torque=0.92)
"""Margins kept inside the body's limits, for a body of the usual size (`toolkit.robot.scale`).

They are smaller than the plan's, so that a correction has some room.
"""
# Among the parameters of the rows.
_LEG_ANKLE, _TORQUE_ANKLE, _TORQUE_SOLE = slice(3, 6), slice(4, 7), slice(1 + POSTURE, 4 + POSTURE)
_TANGENTS = 10  # first parameter of a distance that says how its tip follows displacements


@dataclass(frozen=True)
class PlanRows:
    """Limits of legs and arms for M steps.

    Attributes:
        legs: (M + 1, 2, p) parameters of each foot's leg at the knots.
        torques: (M, 2, p) parameters of each foot's leg in the steps.
        distances, heights: As in the plan's program.
        foot: (n,) foot whose displacement counts for a distance.
        lowest: (M + 1,) lowest foot.
    """

    legs: np.ndarray
    torques: np.ndarray
    distances: Block
    heights: Block
    foot: np.ndarray
    lowest: np.ndarray

    @classmethod
    def of(cls, problem: CentroidalProblem, robot: RobotModel) -> PlanRows:
        """The rows of a plan's problem. Feet in the air have the rows of the contacts that they will make."""
        planned = Program(problem, robot, BODY, Regularisers(), []).blocks
        standing = Program(_standing(problem), robot, BODY, Regularisers()).blocks
        legs, torques = (block.parameters.reshape(-1, 2, block.parameters.shape[1]) for block in standing[1:3])
        foot = (planned.distances.variables[:, 7] - STATE) // 2
        return cls(legs, torques, planned.distances, planned.heights, foot, problem.lowest_foot[1])

    def blocks(
        self, layout: Layout, first: int, dt: np.ndarray, contacts: HorizonContacts
    ) -> tuple[Block, Block, Block, Block]:
        """Limits of legs, torques, distances and heights in steps (N,) of `dt` s from a step of the plan on.

        They are those of the first step and of all knots but the first, which is given.
        """
        knots = slice(first + 1, first + len(dt) + 1)
        return (
            self._legs(layout, knots, contacts),
            self._torques(layout, first, dt, contacts),
            self._distances(layout, knots, contacts),
            self._heights(layout, knots),
        )

    def _legs(self, layout: Layout, knots: slice, contacts: HorizonContacts) -> Block:
        """Legs whose foot is in contact before or after a knot."""
        active = contacts.active[:, :2]
        near = active.copy()
        near[:-1] |= active[1:]
        step, foot = np.nonzero(near)
        parameters = self.legs[knots][step, foot]
        parameters[:, _LEG_ANKLE] += contacts.shift[np.where(active[step, foot], step, step + 1), foot]
        return Block.of(step + 1, layout.legs(step + 1, foot), parameters, LEG_ROWS)

    def _torques(self, layout: Layout, first: int, dt: np.ndarray, contacts: HorizonContacts) -> Block:
        """Joint torques of stance legs."""
        step, foot = np.nonzero(contacts.active[:, :2])
        parameters, shift = self.torques[first + step, foot], contacts.shift[step, foot]
        parameters[:, 0] = dt[step] / 2
        parameters[:, _TORQUE_ANKLE] += shift
        parameters[:, _TORQUE_SOLE] += shift
        return Block.of(step, layout.torques(step, foot), parameters, TORQUE_ROWS)

    def _distances(self, layout: Layout, knots: slice, contacts: HorizonContacts) -> Block:
        """Lengths of legs in the air and of arms."""
        table = self.distances
        rows = slice(*np.searchsorted(table.stage, [knots.start, knots.stop]))
        knot, foot, parameters = table.stage[rows] - knots.start + 1, self.foot[rows], table.parameters[rows]
        arm = ~parameters[:, _TANGENTS:].any(1)
        kept = (parameters[:, 0] == 0.0) & (arm | ~contacts.active[knot - 1, foot])
        parameters = parameters[kept] if layout.moving else parameters[kept, :_TANGENTS]
        return Block.of(knot[kept], layout.distances(knot[kept], foot[kept]), parameters, DISTANCE_ROWS)

    def _heights(self, layout: Layout, knots: slice) -> Block:
        """Least height of the CoM."""
        table = self.heights
        rows = slice(*np.searchsorted(table.stage, [knots.start, knots.stop]))
        at = table.stage[rows]
        parameters = table.parameters[rows] if layout.moving else table.parameters[rows, :2]
        return Block.of(at - knots.start + 1, layout.heights(at - knots.start + 1, self.lowest[at]), parameters, 1)


def _standing(problem: CentroidalProblem) -> CentroidalProblem:
    """The problem of feet that stand on their next contacts while they are in the air."""
    active, position, rotation = (each.copy() for each in (problem.active, problem.position, problem.rotation))
    for foot in FEET:
        on = np.flatnonzero(active[:, foot])
        following = on[np.minimum(np.searchsorted(on, np.arange(problem.steps)), len(on) - 1)]
        position[:, foot], rotation[:, foot] = position[following, foot], rotation[following, foot]
        active[:, foot] = True
    return replace(problem, active=active, position=position, rotation=rotation)
