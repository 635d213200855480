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
GROUP = 16
"""Most stages whose Hessians are kept at a time."""
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
        stage, variable: (n,) its stage, in ascending order, and its number there.
        linear, quadratic, wanted: (n,).
    """

    stage: np.ndarray
    variable: np.ndarray
    linear: np.ndarray
    quadratic: np.ndarray
    wanted: np.ndarray

    @classmethod
    def joined(cls, parts: Iterable[Prices]) -> Prices:
        """All of these prices, in the order of the stages."""
        arrays = [np.concatenate(part) for part in zip(*parts, strict=True)]
        order = np.argsort(arrays[0], kind="stable")
        return cls(*(array[order] for array in arrays))


class Squares(NamedTuple):
    """Prices of n sums of k variables: weight * (factors . v - wanted)^2.

    Attributes:
        stage: (n,) their stage, in ascending order.
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
        first: (k, T + 1) first application in a stage of each block, then of single prices and of squares.
        hessian: (j, m, m) of stages t modulo j, which are made and factored in groups of at most j: all of them would
            not fit into a processor's cache.
        gradient: (T, m) of the objective; condensed: (T, m) with the rows'.
        following: (T - 1, n, m) derivative of the next state; defect: (T - 1, n).
        change: (T, m) Newton step.
        sweep: Factors of the Newton step.
    """

    first: np.ndarray
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
            first=np.zeros((len(Blocks._fields) + 2, t + 1), np.int64),
            hessian=np.zeros((min(t, GROUP), m, m)),
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


@compiled(reordered=True, allocates=True)
def prepare(prices, squares, all_blocks, work):
    """Fill the slopes of linear rows, and what is where."""
    rows.prepare_contacts(all_blocks.contacts)
    stages, count = np.arange(work.first.shape[1]), len(all_blocks)
    for number, block in enumerate(all_blocks):
        work.first[number] = np.searchsorted(block.stage, stages)
    work.first[count] = np.searchsorted(prices.stage, stages)
    work.first[count + 1] = np.searchsorted(squares.stage, stages)


@compiled(reordered=True)
def span(first, begin, end):
    """First and one after the last of a block's applications in the stages from `begin` to before `end`."""
    return first[begin], first[end]


@compiled(reordered=True)
def evaluate(steps, prices, squares, all_blocks, begin, end, size, y, floor, kept, work):
    """Fill the model at y of the stages from `begin` to before `end`; returns their objective, after `prepare`.

    `floor` is explained in `rows.fill_contacts`. Where the rows of the body are `kept`, they are left as they are.
    """
    hessian, gradient, first = work.hessian, work.gradient, work.first
    for t in range(begin, end):
        hessian[t % len(hessian)] = 0.0
        gradient[t] = 0.0
    value = dynamics.linearise(steps, begin, end, size, y, hessian, gradient, work.following, work.defect)
    value += rows.add_prices(prices, span(first[7], begin, end), y, hessian, gradient)
    value += rows.add_squares(squares, span(first[8], begin, end), y, hessian, gradient)
    contacts, legs, torques, distances, heights, final, bounds = all_blocks
    value += rows.fill_contacts(contacts, span(first[0], begin, end), y, floor, hessian, gradient)
    if kept:
        return value
    value += rows.fill_legs(legs, span(first[1], begin, end), y, hessian, gradient)
    value += rows.fill_distances(distances, span(first[3], begin, end), y, hessian, gradient)
    value += rows.fill_final(final, span(first[5], begin, end), y, hessian, gradient)
    rows.fill_torques(torques, span(first[2], begin, end), y)
    rows.fill_heights(heights, span(first[4], begin, end), y)
    rows.fill_bounds(bounds, span(first[6], begin, end), y)
    return value


@compiled(reordered=True)
def backward(all_blocks, begin, end, size, goal, corrected, work):
    """Sweep the stages from `begin` to before `end` back, for complementarities of `goal`."""
    for t in range(begin, end):
        for k in range(size[t]):
            work.condensed[t, k] = work.gradient[t, k]
    for number, block in enumerate(all_blocks):
        blocks.add_gradient(block, span(work.first[number], begin, end), goal, corrected, work.condensed)
    newton.backward(begin, end, size, work.following, work.defect, work.condensed, work.sweep)


@compiled(reordered=True)
def forward(all_blocks, size, goal, corrected, work):
    """Newton step after `backward`, with the changes of slacks and multipliers."""
    newton.forward(size, work.following, work.defect, work.sweep, work.change)
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
    """Largest violation of dynamics, rows, and rest at the end if wanted; complementarity; cost of slacks that differ.

    A slack that differs from a row that holds violates nothing.
    """
    worst, gap, mismatch = 0.0, 0.0, 0.0
    for t in range(work.defect.shape[0]):
        for k in range(work.defect.shape[1]):
            worst = max(worst, abs(work.defect[t, k]))
    if rest:
        for a in range(3):
            worst = max(worst, abs(y[-1, 3 + a]))
    for block in all_blocks:
        found = blocks.state(block)
        worst, gap, mismatch = max(worst, found[0]), gap + found[1], mismatch + found[2]
    return worst, gap, mismatch


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
    prepare(prices, squares, all_blocks, work)
    far = 1.0  # from a solution: the largest violation or, where it is larger, the mean complementarity
    stages, group = last + 1, len(work.hessian)
    for begin in range(0, stages, group):
        end = min(begin + group, stages)
        evaluate(steps, prices, squares, all_blocks, begin, end, size, y, FLOOR, False, work)
    for block in all_blocks:
        blocks.start(block, options.least, options.gap)
    blocks.start(all_blocks.bounds, 0.1 * options.least, options.gap)
    value = np.inf
    for iteration in range(options.iterations):
        kept, floor, value = options.linear and iteration > 0, FLOOR * min(far, 1.0), 0.0
        for end in range(stages, 0, -group):
            begin = max(end - group, 0)
            value += evaluate(steps, prices, squares, all_blocks, begin, end, size, y, floor, kept, work)
            for number, block in enumerate(all_blocks):
                blocks.add_curvature(block, span(work.first[number], begin, end), work.hessian)
            if options.at_rest and end == stages:
                for a in range(3, 6):
                    work.gradient[last, a] += force[a - 3] + REST_STIFFNESS * y[last, a]
                    work.hessian[last % group, a, a] += REST_STIFFNESS
            newton.factor(begin, end, size, work.hessian, work.following, work.sweep)
            backward(all_blocks, begin, end, size, 0.0, False, work)
        worst, gap, mismatch = violations(all_blocks, y, options.at_rest, work)
        if not (value < np.inf and gap < np.inf):
            return False, iteration, value
        far = max(worst, gap / count)

        forward(all_blocks, size, 0.0, False, work)
        accepted, decrease = options.tolerance * (abs(value) + options.small), 0.0
        for t in range(stages):
            for k in range(size[t]):
                decrease += work.gradient[t, k] * work.change[t, k]
        if worst < options.feasible and gap + mismatch < accepted and abs(decrease) < accepted:
            return True, iteration, value
        primal, dual = longest_steps(all_blocks, 1.0)
        after = 0.0
        for block in all_blocks:
            after += blocks.product_after(block, primal, dual)
        goal = max(min(1.0, (after / gap) ** 3) * gap, 0.1 * accepted) / count

        backward(all_blocks, 0, stages, size, goal, True, work)
        forward(all_blocks, size, goal, True, work)
        primal, dual = longest_steps(all_blocks, max(0.99, 1.0 - gap / count))
        if options.at_rest:
            for a in range(3):
                force[a] += primal * REST_STIFFNESS * (y[last, 3 + a] + work.change[last, 3 + a])
        for t in range(stages):
            for k in range(size[t]):
                y[t, k] += primal * work.change[t, k]
        for block in all_blocks:
            blocks.move(block, primal, dual, options.linear)
    return False, options.iterations, value
