"""Blocks of inequality rows `g(v) >= 0` of an optimal-control program, and what an interior-point method does to them.

A block is one small function that is applied to n stages. A row has a slack s = g and a multiplier z, both positive;
at a solution s z = mu for the barrier parameter mu.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled


class Block(NamedTuple):
    """One function at n stages with m rows of k variables each.

    Attributes:
        stage: (n,) stage of each application, in ascending order.
        variables: (n, k) numbers of its variables within the stage; one may be named twice.
        parameters: (n, p).
        value: (n, m) rows g.
        slope: (n, m, k) their derivatives.
        slack: (n, m) s.
        multiplier: (n, m) z.
        slack_change, multiplier_change: (n, m) The last Newton step.
    """

    stage: np.ndarray
    variables: np.ndarray
    parameters: np.ndarray
    value: np.ndarray
    slope: np.ndarray
    slack: np.ndarray
    multiplier: np.ndarray
    slack_change: np.ndarray
    multiplier_change: np.ndarray

    @classmethod
    def of(cls, stage: np.ndarray, variables: np.ndarray, parameters: np.ndarray, rows: int) -> Block:
        """A block whose work arrays are empty, in the order of the stages."""
        n, k = variables.shape
        order = np.argsort(stage, kind="stable")
        return cls(
            stage=np.ascontiguousarray(stage[order], np.int64),
            variables=np.ascontiguousarray(variables[order], np.int64),
            parameters=np.ascontiguousarray(parameters[order], float),
            value=np.zeros((n, rows)),
            slope=np.zeros((n, rows, k)),
            slack=np.zeros((n, rows)),
            multiplier=np.zeros((n, rows)),
            slack_change=np.zeros((n, rows)),
            multiplier_change=np.zeros((n, rows)),
        )


@compiled(reordered=True)
def start(block, least, gap):
    """Slacks as large as the rows, at least `least`; multipliers such that s z = gap."""
    for i in range(block.value.shape[0]):
        for a in range(block.value.shape[1]):
            block.slack[i, a] = max(block.value[i, a], least)
            block.multiplier[i, a] = gap / block.slack[i, a]


@compiled(reordered=True)
def state(block):
    """Largest -g, which is negative where every row holds; sum of s z; and sum of |g - s| z.

    The last is by how much the sum of |g z| may exceed that of s z.
    """
    worst, gap, mismatch = -np.inf, 0.0, 0.0
    for i in range(block.value.shape[0]):
        for a in range(block.value.shape[1]):
            value, slack, multiplier = block.value[i, a], block.slack[i, a], block.multiplier[i, a]
            worst = max(worst, -value)
            gap += slack * multiplier
            mismatch += abs(value - slack) * multiplier
    return worst, gap, mismatch


@compiled(reordered=True, allocates=True)
def add_curvature(block, span, hessian):
    """Add J' (z / s) J of a span of applications to the stages' Hessians."""
    rows, k = block.value.shape[1], block.variables.shape[1]
    local = np.empty((k, k))
    for i in range(span[0], span[1]):
        local[:] = 0.0
        for a in range(rows):
            stiffness = block.multiplier[i, a] / block.slack[i, a]
            slope = block.slope[i, a]
            for b in range(k):
                if slope[b] == 0.0:
                    continue
                factor = stiffness * slope[b]
                for c in range(k):
                    local[b, c] += factor * slope[c]
        out = hessian[block.stage[i] % len(hessian)]
        for b in range(k):
            row = block.variables[i, b]
            for c in range(k):
                out[row, block.variables[i, c]] += local[b, c]


@compiled(reordered=True)
def add_gradient(block, span, goal, corrected, gradient):
    """Add a span's part of the condensed gradient for s z = goal, with Mehrotra's second-order term if wanted."""
    rows, k = block.value.shape[1], block.variables.shape[1]
    for i in range(span[0], span[1]):
        out = gradient[block.stage[i]]
        for a in range(rows):
            slack, multiplier = block.slack[i, a], block.multiplier[i, a]
            wanted = goal
            if corrected:
                wanted -= block.slack_change[i, a] * block.multiplier_change[i, a]
            force = (wanted - multiplier * (block.value[i, a] - slack)) / slack
            for b in range(k):
                out[block.variables[i, b]] -= force * block.slope[i, a, b]


@compiled(reordered=True)
def set_changes(block, goal, corrected, change):
    """Fill the changes of slacks and multipliers that belong to a change of the variables."""
    rows, k = block.value.shape[1], block.variables.shape[1]
    for i in range(block.value.shape[0]):
        moved = change[block.stage[i]]
        for a in range(rows):
            slack, multiplier = block.slack[i, a], block.multiplier[i, a]
            wanted = goal
            if corrected:
                wanted -= block.slack_change[i, a] * block.multiplier_change[i, a]
            ds = block.value[i, a] - slack
            for b in range(k):
                ds += block.slope[i, a, b] * moved[block.variables[i, b]]
            block.slack_change[i, a] = ds
            block.multiplier_change[i, a] = (wanted - multiplier * ds) / slack - multiplier


@compiled(reordered=True)
def longest(values, changes):
    """Longest step, at most 1.01, that keeps values (n, m) from falling below zero."""
    step = 1.01
    for i in range(values.shape[0]):
        for a in range(values.shape[1]):
            if changes[i, a] < 0.0:
                step = min(step, -values[i, a] / changes[i, a])
    return step


@compiled(reordered=True)
def product_after(block, primal, dual):
    """Sum of s z after steps of these lengths."""
    total = 0.0
    for i in range(block.value.shape[0]):
        for a in range(block.value.shape[1]):
            slack = block.slack[i, a] + primal * block.slack_change[i, a]
            total += slack * (block.multiplier[i, a] + dual * block.multiplier_change[i, a])
    return total


@compiled(reordered=True)
def move(block, primal, dual, linear):
    """Take a step of these lengths; linear rows change with it, while others are filled again."""
    for i in range(block.value.shape[0]):
        for a in range(block.value.shape[1]):
            if linear:
                block.value[i, a] += primal * (block.slack_change[i, a] - block.value[i, a] + block.slack[i, a])
            block.slack[i, a] += primal * block.slack_change[i, a]
            block.multiplier[i, a] += dual * block.multiplier_change[i, a]
