"""Linear programs with integers as plain matrices, built row by row."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_matrix


class LinearProgram(NamedTuple):
    """Minimise cost @ x subject to row_low <= matrix @ x <= row_high and low <= x <= high.

    Attributes:
        cost: (n,).
        matrix: (m, n), sparse.
        row_low, row_high: (m,).
        low, high: (n,).
        integer: (n,) bool; variables that must be whole numbers.
    """

    cost: np.ndarray
    matrix: csr_matrix
    row_low: np.ndarray
    row_high: np.ndarray
    low: np.ndarray
    high: np.ndarray
    integer: np.ndarray

    @property
    def size(self) -> dict[str, int]:
        """Numbers of variables, integers, rows and entries."""
        rows, variables = len(self.row_low), len(self.cost)
        integers = int(self.integer.sum())
        return {"variables": variables, "integers": integers, "rows": rows, "entries": int(self.matrix.nnz)}


Term = tuple[Sequence[float] | np.ndarray | float, np.ndarray]
"""Factors, or one for all, and indices of variables."""


class Builder:
    """Collects the variables and rows of a program."""

    def __init__(self) -> None:
        """Start empty."""
        self._low: list[np.ndarray] = []
        self._high: list[np.ndarray] = []
        self._integer: list[np.ndarray] = []
        self._count = 0
        self._columns: list[np.ndarray] = []
        self._entries: list[np.ndarray] = []
        self._bounds: list[tuple[float, float]] = []
        self._cost: list[tuple[int, float]] = []

    def variables(
        self, shape: tuple[int, ...], low: np.ndarray | float, high: np.ndarray | float, *, integer: bool = False
    ) -> np.ndarray:
        """New variables: their indices, of the shape; the bounds are broadcast to it."""
        indices = self._count + np.arange(int(np.prod(shape))).reshape(shape)
        self._count += indices.size
        self._low.append(np.broadcast_to(np.asarray(low, float), shape).ravel())
        self._high.append(np.broadcast_to(np.asarray(high, float), shape).ravel())
        self._integer.append(np.full(indices.size, integer))
        return indices

    def row(
        self,
        *terms: tuple[Sequence[float] | np.ndarray | float, np.ndarray],
        low: float = -np.inf,
        high: float = np.inf,
    ) -> None:
        """Demand low <= sum of factors times variables <= high; a term is (factors, indices)."""
        self._columns.append(np.concatenate([np.ravel(indices) for _, indices in terms]))
        factors = [np.broadcast_to(np.asarray(factor, float), np.shape(at)).ravel() for factor, at in terms]
        self._entries.append(np.concatenate(factors))
        self._bounds.append((low, high))

    def cost(self, factor: float, indices: np.ndarray) -> None:
        """Add a factor times the sum of variables to the objective."""
        self._cost += [(int(index), factor) for index in np.ravel(indices)]

    def absolute(self, weight: float, most: float, *terms: Term) -> None:
        """Add weight * |sum of terms| to the objective; the value is at most `most`."""
        size = self.variables((1,), 0.0, most)
        self.row(*((np.negative(factor), at) for factor, at in terms), (1.0, size), low=0.0)
        self.row(*terms, (1.0, size), low=0.0)
        self.cost(weight, size)

    def bounds_of(self, indices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of variables."""
        return np.concatenate(self._low)[indices], np.concatenate(self._high)[indices]

    def finished(self) -> LinearProgram:
        """The program."""
        lengths = [len(columns) for columns in self._columns]
        starts = np.concatenate([[0], np.cumsum(lengths)])
        matrix = csr_matrix(
            (np.concatenate(self._entries), np.concatenate(self._columns), starts), (len(lengths), self._count)
        )
        matrix.sum_duplicates()
        cost = np.zeros(self._count)
        for index, factor in self._cost:
            cost[index] += factor
        row_low, row_high = np.array(self._bounds).T
        low, high = np.concatenate(self._low), np.concatenate(self._high)
        return LinearProgram(cost, matrix, row_low, row_high, low, high, np.concatenate(self._integer))


def violation(program: LinearProgram, x: np.ndarray) -> float:
    """Largest violation of rows, bounds and whole numbers by values (n,): what a solver claims is not believed."""
    rows = program.matrix @ x
    parts = [program.row_low - rows, rows - program.row_high, program.low - x, x - program.high]
    whole = x[program.integer]
    return float(max(np.max(part, initial=0.0) for part in (*parts, np.abs(whole - np.round(whole)))))


def solution(program: LinearProgram) -> np.ndarray | None:
    """(n,) a best solution, by SciPy; None where there is none."""
    row_low: Any = program.row_low
    row_high: Any = program.row_high
    low: Any = program.low
    high: Any = program.high
    rows = LinearConstraint(program.matrix, row_low, row_high)
    return milp(program.cost, constraints=rows, bounds=Bounds(low, high), integrality=program.integer).x
