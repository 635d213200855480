"""Primal-dual interior-point method for centroidal problems, with Mehrotra's predictor and corrector.

Hessians are Gauss and Newton's, with convex curvature of the constraints where it is known, so that they are positive
definite at any point. Dynamics and rows need not hold at the start.

Reference: J. Nocedal, S. Wright, Numerical Optimization (2006), Sec. 14.2 and 19.3.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.stages import blocks, newton, rows
from toolkit.centroidal.stages import steps as dynamics
from toolkit.centroidal.stages.blocks import Block
from toolkit.centroidal.stages.newton import Sweep, allocate
from toolkit.compiled import compiled

SMALL = 1e-3
"""Objective below which accuracy is absolute."""
FLOOR = 1e-3
"""Weights; what friction is taken to hold at least under lateral forces, at the start.

It falls with the distance from a solution. Otherwise lightly loaded contacts could end with more than friction holds.
"""
GAP = 5.0
"""Complementarity of a row at the start of a motion that nothing is known of."""
REST_STIFFNESS = 1e5
"""Stiffness of the proximal term for the final rest; a multiplier makes the rest exact."""


class Blocks(NamedTuple):
    """The constraints of a program; see `rows` for each."""

    contacts: Block
    legs: Block
    torques: Block
    distances: Block
    heights: Block
    final: Block
    bounds: Block


class Prices(NamedTuple):
    """Prices of n single variables: linear * v + quadratic * (v - wanted)^2.

    Attributes:
        stage, variable: (n,) its stage and its number there.
        linear, quadratic, wanted: (n,).
    """

    stage: np.ndarray
    variable: np.ndarray
    linear: np.ndarray
    quadratic: np.ndarray
    wanted: np.ndarray

    @classmethod
    def joined(cls, parts: Iterable[Prices]) -> Prices:
        """All of these prices."""
        return cls(*(np.concatenate(part) for part in zip(*parts, strict=True)))


class Squares(NamedTuple):
    """Prices of n sums of k variables: weight * (factors . v - wanted)^2.

    Attributes:
        stage: (n,) their stage.
        variables, factors: (n, k) numbers of the variables there, and their factors.
        weight, wanted: (n,).
    """

    stage: np.ndarray
    variables: np.ndarray
    factors: np.ndarray
    weight: np.ndarray
    wanted: np.ndarray

    @classmethod
    def none(cls) -> Squares:
        """No prices."""
        return cls(np.zeros(0, np.int64), np.zeros((0, 1), np.int64), np.zeros((0, 1)), np.zeros(0), np.zeros(0))


class Work(NamedTuple):
    """Room for the model of an iteration, for T stages of at most m variables, n of them states.

    Attributes:
        hessian: (T, m, m); gradient: (T, m) of the objective; condensed: (T, m) with the rows'.
        following: (T - 1, n, m) derivative of the next state; defect: (T - 1, n).
        change: (T, m) Newton step.
        sweep: Factors of the Newton step.
    """

    hessian: np.ndarray
    gradient: np.ndarray
    condensed: np.ndarray
    following: np.ndarray
    defect: np.ndarray
    change: np.ndarray
    sweep: Sweep

    @classmethod
    def of(cls, stages: int, states: int, variables: int) -> Work:
        """Room for so many stages of at most so many variables."""
        t, n, m = stages, states, variables
        return cls(
            hessian=np.zeros((t, m, m)),
            gradient=np.zeros((t, m)),
            condensed=np.zeros((t, m)),
            following=np.zeros((t - 1, n, m)),
            defect=np.zeros((t - 1, n)),
            change=np.zeros((t, m)),
            sweep=allocate(t, n, m),
        )


class Options(NamedTuple):
    """Settings of the method.

    Attributes:
        at_rest: Whether the last velocity is zero.
        iterations: Most iterations.
        tolerance: Wanted accuracy of the objective, relative.
        feasible: Largest violation of dynamics, rows and rest.
        gap: Complementarity of a row at the start.
        least: Least slack of a row at the start; a tenth of it where the row bounds a single variable.
        small: Objective below which accuracy is absolute.
        linear: Whether the body's limits are kept to first order in the change from the start.
    """

    at_rest: bool
    iterations: int = 150
    tolerance: float = 1e-4
    feasible: float = 4e-7
    gap: float = GAP
    least: float = 0.1
    small: float = SMALL
    linear: bool = False


@compiled(reordered=True)
def evaluate(steps, prices, squares, all_blocks, size, y, floor, kept, work):
    """Fill the model at y; returns the objective. `floor` is explained in `rows.fill_contacts`.

    Where the rows of the body are `kept`, they are left as they are.
    """
    work.hessian[:] = 0.0
    work.gradient[:] = 0.0
    value = dynamics.linearise(steps, size, y, work.hessian, work.gradient, work.following, work.defect)
    value += rows.add_prices(prices, y, work.hessian, work.gradient)
    value += rows.add_squares(squares, y, work.hessian, work.gradient)
    value += rows.fill_contacts(all_blocks.contacts, y, floor, work.hessian, work.gradient)
    if kept:
        return value
    value += rows.fill_legs(all_blocks.legs, y, work.hessian, work.gradient)
    value += rows.fill_distances(all_blocks.distances, y, work.hessian, work.gradient)
    value += rows.fill_final(all_blocks.final, y, work.hessian, work.gradient)
    rows.fill_torques(all_blocks.torques, y)
    rows.fill_heights(all_blocks.heights, y)
    rows.fill_bounds(all_blocks.bounds, y)
    return value


@compiled(reordered=True)
def direction(all_blocks, size, goal, corrected, work):
    """Newton step towards complementarities of `goal`; also fills the changes of slacks and multipliers."""
    for t in range(work.gradient.shape[0]):
        for k in range(work.gradient.shape[1]):
            work.condensed[t, k] = work.gradient[t, k]
    for block in all_blocks:
        blocks.add_gradient(block, goal, corrected, work.condensed)
    newton.solve(size, work.following, work.defect, work.condensed, work.sweep, work.change)
    for block in all_blocks:
        blocks.set_changes(block, goal, corrected, work.change)


@compiled(reordered=True)
def longest_steps(all_blocks, keep):
    """Longest primal and dual steps, at most 1, that keep the part `1 - keep` of every slack and multiplier."""
    primal, dual = 1.0, 1.0
    for block in all_blocks:
        primal = min(primal, keep * blocks.longest(block.slack, block.slack_change))
        dual = min(dual, keep * blocks.longest(block.multiplier, block.multiplier_change))
    return primal, dual


@compiled(reordered=True)
def violations(all_blocks, y, rest, work):
    """Largest violation of dynamics, rows, and rest at the end if wanted, and what slacks that differ may cost.

    A slack that differs from a row that holds violates nothing.
    """
    worst, cost = 0.0, 0.0
    for t in range(work.defect.shape[0]):
        for k in range(work.defect.shape[1]):
            worst = max(worst, abs(work.defect[t, k]))
    if rest:
        for a in range(3):
            worst = max(worst, abs(y[-1, 3 + a]))
    for block in all_blocks:
        worst = max(worst, blocks.largest_violation(block))
        cost += blocks.mismatch(block)
    return worst, cost


@compiled(kept=True, reordered=True, allocates=True)
def minimise(steps, prices, squares, all_blocks, size, y, work, options):
    """Minimise from the motion y (T, m), which is overwritten but for its first state.

    Args:
        steps: Dynamics and momentum objective (`Steps`) of T - 1 steps.
        prices: `Prices` of single variables.
        squares: `Squares` of sums of variables.
        all_blocks: `Blocks`; their work arrays are overwritten.
        size: (T,) number of variables of each stage; numbers of y beyond them are not read.
        y: (T, m) guess, then the motion.
        work: Room (`Work`) for T stages of m variables.
        options: `Options`.

    Returns:
        Whether it converged, the iterations, and the objective of the program.
    """
    last = y.shape[0] - 1
    count = 0
    for block in all_blocks:
        count += block.value.size
    force = np.zeros(3)  # multiplier of the final rest
    rows.prepare_contacts(all_blocks.contacts)
    far = 1.0  # from a solution: the largest violation or, where it is larger, the mean complementarity
    value = evaluate(steps, prices, squares, all_blocks, size, y, FLOOR, False, work)
    for block in all_blocks:
        blocks.start(block, options.least, options.gap)
    blocks.start(all_blocks.bounds, 0.1 * options.least, options.gap)
    for iteration in range(options.iterations):
        kept = options.linear and iteration > 0
        value = evaluate(steps, prices, squares, all_blocks, size, y, FLOOR * min(far, 1.0), kept, work)
        (worst, mismatch), gap = violations(all_blocks, y, options.at_rest, work), 0.0
        for block in all_blocks:
            gap += blocks.complementarity(block)
            blocks.add_curvature(block, work.hessian)
        far = max(worst, gap / count)
        if not (value < np.inf and gap < np.inf):
            return False, iteration, value
        if options.at_rest:
            for a in range(3, 6):
                work.gradient[last, a] += force[a - 3] + REST_STIFFNESS * y[last, a]
                work.hessian[last, a, a] += REST_STIFFNESS
        newton.factor(size, work.hessian, work.following, work.sweep)

        goal = 0.0
        direction(all_blocks, size, goal, goal > 0.0, work)
        accepted, decrease = options.tolerance * (abs(value) + options.small), 0.0
        for t in range(last + 1):
            for k in range(size[t]):
                decrease += work.gradient[t, k] * work.change[t, k]
        if worst < options.feasible and gap + mismatch < accepted and abs(decrease) < accepted:
            return True, iteration, value
        primal, dual = longest_steps(all_blocks, 1.0)
        after = 0.0
        for block in all_blocks:
            after += blocks.product_after(block, primal, dual)
        goal = max(min(1.0, (after / gap) ** 3) * gap, 0.1 * accepted) / count

        direction(all_blocks, size, goal, goal > 0.0, work)
        primal, dual = longest_steps(all_blocks, max(0.99, 1.0 - gap / count))
        if options.at_rest:
            for a in range(3):
                force[a] += primal * REST_STIFFNESS * (y[last, 3 + a] + work.change[last, 3 + a])
        for t in range(last + 1):
            for k in range(size[t]):
                y[t, k] += primal * work.change[t, k]
        for block in all_blocks:
            blocks.move(block, primal, dual, options.linear)
    return False, options.iterations, value
