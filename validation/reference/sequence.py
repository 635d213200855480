"""A program for Ipopt: the numbers that the toolkit's own solver gets, through CasADi's pieces."""

from __future__ import annotations

import time
from dataclasses import replace

import casadi as ca
import numpy as np

from toolkit.centroidal.program import Program
from toolkit.centroidal.sequence import motion_of
from toolkit.centroidal.stages.steps import STATE, WRENCH
from validation.reference.assembly import Assembly, Block
from validation.reference.pieces import pieces

NAMES = "contact", "leg", "torque", "distance", "height", "final", "bound"
"""Pieces of the toolkit's blocks, in their order."""
IPOPT = {"max_iter": 300, "tol": 1e-6, "constr_viol_tol": 1e-8, "bound_relax_factor": 0.0}
"""Settings. With a larger tolerance, slacks that should be zero are too large for the verdict on cones now and then."""
SILENT = {"print_level": 0, "sb": "yes"}


class Reference:
    """A program as blocks of CasADi's pieces.

    Args:
        program: The program, as the toolkit makes it.
        pyramid: Whether friction is the pyramid of `pieces`.

    Attributes:
        assembly: The blocks.
        equal: (rows,) bool; rows that are zero. The others are not negative.
        offset: (N + 1,) first variable of each stage.
    """

    def __init__(self, program: Program, pyramid: bool = False):
        self.program, layout = program, program.layout
        self.offset = np.concatenate([[0], np.cumsum(layout.size)[:-1]])
        self._pieces = pieces(layout.moving, pyramid)
        self._blocks: list[Block] = []
        self._rows = 0
        self._equal: list[np.ndarray] = []
        p, n = program.problem, program.problem.steps
        for name, block in zip(NAMES, program.blocks, strict=True):
            if name == "bound" and block.variables.shape[1] > 1:
                name = f"bound{block.variables.shape[1]}"
            self._add(name, self.offset[block.stage][:, None] + block.variables, block.parameters)
        prices = program.prices
        single = (self.offset[prices.stage] + prices.variable)[:, None]
        self._add("price", single, np.stack([prices.linear, prices.quadratic, prices.wanted], 1))
        given = np.concatenate([p.com, p.com_velocity, p.angular_momentum / p.mass, np.zeros(layout.states - 9)])
        self._add(f"fixed{layout.states}", np.arange(layout.states)[None], given[None], equal=True)
        if p.final_at_rest:
            self._add("fixed3", self.offset[-1:, None] + np.arange(3, 6), np.zeros((1, 3)), equal=True)
        self._add_steps()
        if layout.moving:
            now = self.offset[:-1, None] + program.steps.source
            after = self.offset[1:, None] + np.arange(STATE, layout.states)
            self._add("carry", np.concatenate([now, after], 1), np.zeros((n, 0)), equal=True)
        self.assembly = Assembly(self._blocks, int(layout.size.sum()), self._rows)
        self.equal = np.concatenate(self._equal)

    def _add(self, name: str, variables: np.ndarray, parameters: np.ndarray, *, equal: bool = False) -> None:
        """Enter a piece with rows of its own."""
        piece, n = self._pieces[name], len(variables)
        rows = self._rows + np.arange(n * piece.rows).reshape(n, piece.rows)
        self._rows += rows.size
        self._equal.append(np.full(rows.size, equal))
        self._blocks.append(Block(piece, variables, rows, parameters))

    def _add_steps(self) -> None:
        """Dynamics and momentum objective."""
        steps, layout = self.program.steps, self.program.layout
        count = np.diff(steps.first)
        for contacts in range(1, 5):
            step = np.flatnonzero(count == contacts)
            if not len(step):
                continue
            at = steps.first[step][:, None] + np.arange(contacts)
            now, after = (self.offset[knot][:, None] + np.arange(STATE) for knot in (step, step + 1))
            first = self.offset[step][:, None]
            wrench = (first + steps.wrench[at])[..., None] + np.arange(WRENCH)
            variables = [now, wrench.reshape(len(step), -1), after]
            pose = [steps.rotation[at].reshape(len(step), contacts, 9), steps.position[at]]
            if layout.moving:
                moves = steps.pair[at] >= 0
                pose.append(moves[..., None].astype(float))
                pair = (first + np.where(moves, steps.pair[at], STATE))[..., None] + np.arange(2)
                variables.append(pair.reshape(len(step), -1))
            parameters = [steps.dt[step, None], np.concatenate(pose, 2).reshape(len(step), -1)]
            parameters += [np.sqrt(steps.weights[step]), steps.height[step, None], steps.turning[step]]
            self._add(f"stage{contacts}", np.concatenate(variables, 1), np.concatenate(parameters, 1), equal=True)

    def flat(self, y: np.ndarray) -> np.ndarray:
        """The variables of the stages (N + 1, m) in one vector."""
        return np.concatenate([row[:size] for row, size in zip(y, self.program.layout.size, strict=True)])

    def stages(self, x: np.ndarray) -> np.ndarray:
        """The variables (N + 1, m) of the stages, of one vector."""
        size = self.program.layout.size
        y = np.zeros((len(size), int(size.max())))
        for row, first, count in zip(y, self.offset, size, strict=True):
            row[:count] = x[first : first + count]
        return y


def solve(program: Program, guess: np.ndarray, pyramid: bool = False):
    """Solve a program with Ipopt from a guess (N + 1, m), with the cone or the pyramid of friction.

    Returns:
        The motion with its verdict, as `toolkit.centroidal.sequence.optimise` gives it.
    """
    began = time.perf_counter()
    reference = Reference(program, pyramid)
    functions = reference.assembly.functions()
    nlp = functions.pop("nlp")
    unused = dict.fromkeys(("print_time", "calc_lam_x", "calc_lam_p", "calc_f", "calc_g"), False)
    solver = ca.nlpsol("sequence", "ipopt", nlp, {"cache": functions, "ipopt": IPOPT | SILENT, **unused})
    upper = np.where(reference.equal, 0.0, np.inf)
    result = solver(x0=reference.flat(guess), p=reference.assembly.parameters, lbg=np.zeros(len(upper)), ubg=upper)
    stats = solver.stats()
    status = "converged" if stats["success"] else f"Ipopt: {stats['return_status']}"
    motion = motion_of(program, reference.stages(np.array(result["x"]).ravel()), status)
    return replace(motion, iterations=int(stats["iter_count"]), seconds=time.perf_counter() - began)
