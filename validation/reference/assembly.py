"""A nonlinear program as a sum of small functions, each applied many times: quick to build, however long it is.

A `Piece` is one small CasADi function with its derivatives; a `Block` applies it n times to variables and rows given by
index arrays. `Assembly` gathers, maps and scatters. So a program of any size has only a few graph nodes, and the solver
receives its derivatives instead of differentiating the whole program.

The Hessian is Gauss-Newton in the objective: sum_i rho_i(v)^2 + linear(v) has the Hessian 2 Jrho^T Jrho. Objective and
rows add more curvature only where a piece knows a convex part of it. So the Hessian is positive semidefinite at any
point and any multipliers, and the solver needs no regularisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np


class Piece:
    """A small function (v, p) -> (objective, rows) with derivatives.

    Args:
        name: Name of the piece.
        v: (nv,) variables.
        p: (np,) parameters.
        rho: (nr,) terms whose squares add to the objective, or None.
        linear: Scalar added to the objective, linear in v, or None.
        rows: (ng,) constraint rows, or None.
        bend: Positive semidefinite (nv, nv) part of the objective's Hessian beyond Gauss-Newton; None to leave it out.
        curvature: Function from the rows' multipliers (not positive where a row's lower bound is active) to a positive
            semidefinite (nv, nv) part of the Hessian; None to leave the rows' curvature out.
        jacobian: (ng, nv) Jacobian of the rows where the caller knows a shorter expression.
    """

    def __init__(
        self,
        name: str,
        v: ca.SX,
        p: ca.SX,
        *,
        rho=None,
        linear=None,
        rows=None,
        bend=None,
        curvature=None,
        jacobian=None,
    ):
        self.name = name
        rho = ca.SX(0, 1) if rho is None else rho
        rows = ca.SX(0, 1) if rows is None else rows
        cost = ca.sumsqr(rho) + (0 if linear is None else linear)
        weight, multiplier = ca.SX.sym("weight"), ca.SX.sym("multiplier", rows.numel())
        gradient = ca.gradient(cost, v)
        jacobian = ca.jacobian(rows, v) if jacobian is None else jacobian
        d_rho = ca.jacobian(rho, v)
        hessian = 2 * weight * (d_rho.T @ d_rho)
        if bend is not None:
            hessian = hessian + weight * bend
        if curvature is not None:
            hessian = hessian + curvature(multiplier)
        hessian = ca.triu2symm(ca.triu(hessian + ca.SX(hessian.sparsity().T, 0)))
        self.size, self.parameters, self.rows = v.numel(), p.numel(), rows.numel()
        self.jacobian_pattern = _pattern(jacobian)
        self.hessian_pattern = _pattern(hessian)

        def function(kind: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
            return ca.Function(f"{name}_{kind}", inputs, ca.cse(outputs))

        self.cost = function("cost", [v, p], [cost])
        self.value = function("value", [v, p], [rows])
        self.gradient = function("gradient", [v, p], [cost, ca.densify(gradient)])
        self.first = function("first", [v, p], [rows, jacobian.nz[:]])
        self.second = function("second", [v, p, weight, multiplier], [hessian.nz[:]])


class Parameters:
    """Hands out named parts of one growing parameter vector."""

    def __init__(self):
        self.parts: list[ca.SX] = []

    def __call__(self, size: int = 1) -> ca.SX:
        """The next part."""
        self.parts.append(ca.SX.sym(f"p{len(self.parts)}", size))
        return self.parts[-1]

    @property
    def vector(self) -> ca.SX:
        """All parts so far."""
        return ca.vertcat(*self.parts)


@dataclass(frozen=True)
class Block:
    """A piece applied n times.

    Attributes:
        piece: The function.
        variables: (n, piece.size) indices into the program's variables.
        rows: (n, piece.rows) indices into the program's rows; several may add to one row.
        parameters: (n, piece.parameters).
    """

    piece: Piece
    variables: np.ndarray
    rows: np.ndarray
    parameters: np.ndarray

    def __post_init__(self):
        n = len(self.variables)
        expected = [(n, self.piece.size), (n, self.piece.rows), (n, self.piece.parameters)]
        shapes = [self.variables.shape, self.rows.shape, self.parameters.shape]
        if shapes != expected:
            raise ValueError(f"{self.piece.name}: shapes {shapes} should be {expected}")


class Assembly:
    """A program of blocks.

    Args:
        blocks: Parts of the program.
        size: Number of variables.
        rows: Number of constraint rows.
    """

    def __init__(self, blocks: list[Block], size: int, rows: int):
        self.blocks = [block for block in blocks if len(block.variables)]
        self.size, self.rows = size, rows

    @property
    def parameters(self) -> np.ndarray:
        """All parameters in the order that the functions take them."""
        return np.concatenate([block.parameters.ravel() for block in self.blocks])

    def functions(self) -> dict[str, ca.Function]:
        """Functions under the names under which CasADi passes them to Ipopt."""
        x = ca.MX.sym("x", self.size)
        p = ca.MX.sym("p", sum(block.parameters.size for block in self.blocks))
        weight, multiplier = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.rows)
        v, params, lam = [], [], []
        offset = 0
        for block in self.blocks:
            n = len(block.variables)
            v.append(ca.reshape(x[_list(block.variables)], block.piece.size, n))
            params.append(ca.reshape(p[offset : offset + block.parameters.size], block.piece.parameters, n))
            lam.append(ca.reshape(multiplier[_list(block.rows)], block.piece.rows, n))
            offset += block.parameters.size

        def mapped(name: str, *extra) -> list:
            outputs = []
            for index, block in enumerate(self.blocks):
                function = getattr(block.piece, name).map(len(block.variables))
                arguments = [part[index] if isinstance(part, list) else part for part in extra]
                result = function(v[index], params[index], *arguments)
                outputs.append(result if isinstance(result, tuple | list) else (result,))
            return outputs

        def stacked(outputs: list, which: int) -> ca.MX:
            return ca.vertcat(*[ca.vec(output[which]) for output in outputs])

        def total(outputs: list) -> ca.MX:
            return sum((ca.sum2(output[0]) for output in outputs), ca.MX(0))

        to_x = self._scatter([block.variables for block in self.blocks], self.size)
        to_g = self._scatter([block.rows for block in self.blocks], self.rows)
        row, column = self._entries(
            [(block.rows, block.variables, block.piece.jacobian_pattern) for block in self.blocks]
        )
        jac_pattern, to_jac = _gathered(row, column, self.rows, self.size)
        pairs = [(block.variables, block.variables, block.piece.hessian_pattern) for block in self.blocks]
        row, column = self._entries(pairs)
        hess_pattern, to_hess = _gathered(row, column, self.size, self.size, row <= column)
        cost, value = mapped("cost"), mapped("value")
        gradient, first = mapped("gradient"), mapped("first")
        second = mapped("second", ca.MX(weight), lam)
        f, g = total(cost), to_g @ stacked(value, 0)
        grad_f = to_x @ stacked(gradient, 1)
        jac = ca.MX(jac_pattern, to_jac @ stacked(first, 1))
        hess = ca.MX(hess_pattern, to_hess @ stacked(second, 0))
        inputs, names = [x, p], ["x", "p"]
        dual, dual_names = [x, p, weight, multiplier], ["x", "p", "lam_f", "lam_g"]
        make = ca.Function
        return {
            "nlp": make("nlp", inputs, [f, g], names, ["f", "g"]),
            "nlp_f": make("nlp_f", inputs, [f], names, ["f"]),
            "nlp_g": make("nlp_g", inputs, [g], names, ["g"]),
            "nlp_grad_f": make("nlp_grad_f", inputs, [total(gradient), grad_f], names, ["f", "grad_f_x"]),
            "nlp_jac_g": make("nlp_jac_g", inputs, [to_g @ stacked(first, 0), jac], names, ["g", "jac_g_x"]),
            "nlp_hess_l": make("nlp_hess_l", dual, [hess], dual_names, ["triu_hess_gamma_x_x"]),
        }

    @staticmethod
    def _scatter(indices: list[np.ndarray], size: int) -> ca.MX:
        """(size, total) matrix that adds stacked entries up at their indices."""
        row = np.concatenate([index.ravel() for index in indices])
        return _ones(ca.Sparsity(size, len(row), list(range(len(row) + 1)), row.tolist()))

    @staticmethod
    def _entries(parts: list) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of each stacked entry, of blocks' (rows, columns, pattern within a piece)."""
        row = [rows[:, pattern[0]].ravel() for rows, _, pattern in parts]
        column = [columns[:, pattern[1]].ravel() for _, columns, pattern in parts]
        return np.concatenate(row), np.concatenate(column)


def _gathered(
    row: np.ndarray, column: np.ndarray, rows: int, columns: int, kept: np.ndarray | None = None
) -> tuple[ca.Sparsity, ca.MX]:
    """Compressed-column pattern of entries, and the matrix that adds stacked entries up to its nonzeros."""
    source = np.arange(len(row)) if kept is None else np.flatnonzero(kept)
    keys, nonzero = np.unique(column[source] * rows + row[source], return_inverse=True)
    colind = np.searchsorted(keys, np.arange(columns + 1) * rows)
    pattern = ca.Sparsity(rows, columns, colind.tolist(), (keys % rows).tolist())
    start = np.searchsorted(source, np.arange(len(row) + 1))
    return pattern, _ones(ca.Sparsity(len(keys), len(row), start.tolist(), nonzero.tolist()))


def _ones(pattern: ca.Sparsity) -> ca.MX:
    """Matrix of ones where the pattern has entries."""
    return ca.MX(ca.DM(pattern, 1.0))


def _pattern(matrix: ca.SX) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of each nonzero in column-major order."""
    row, column = matrix.sparsity().get_triplet()
    return np.array(row, int), np.array(column, int)


def _list(index: np.ndarray) -> list[int]:
    """Flat list of an index array: CasADi indexes by lists."""
    return index.ravel().tolist()
