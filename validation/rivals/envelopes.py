"""Convex envelopes of products of two variables, after McCormick, in one piece or in several.

Reference:
    McCormick: Computability of global solutions to factorable nonconvex programs, Mathematical Programming 10, 1976.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from validation.rivals.linear import Builder, Term


class _Factor(NamedTuple):
    """A variable and the ends of its range."""

    at: np.ndarray
    low: float
    high: float


def products(builder: Builder, arm: np.ndarray, forces: list[np.ndarray], parts: int) -> list[np.ndarray]:
    """Variables inside the envelopes of the products of one variable with others.

    Args:
        builder: Of the program.
        arm: (1,) index of the one.
        forces: (1,) indices of the others.
        parts: Pieces into which the range of the one is cut; where there are several, a binary choice tells which.

    Returns:
        Index (1,) of each product.
    """
    (low,), (high,) = builder.bounds_of(arm)
    ends = np.linspace(low, high, parts + 1)
    switches: list[np.ndarray | None] = [None]
    if parts > 1:
        choice = builder.variables((parts,), 0.0, 1.0, integer=True)
        builder.row((1.0, choice), low=1.0, high=1.0)
        builder.row((1.0, arm), (-ends[:-1], choice), low=0.0)
        builder.row((1.0, arm), (-ends[1:], choice), high=0.0)
        switches = [choice[part : part + 1] for part in range(parts)]
    found = []
    for force in forces:
        (least,), (most,) = builder.bounds_of(force)
        reach = max(abs(low), abs(high)) * max(abs(least), abs(most))
        product = builder.variables((1,), -reach, reach)
        for switch, first, last in zip(switches, ends[:-1].tolist(), ends[1:].tolist(), strict=True):
            factors = _Factor(arm, first, last), _Factor(force, float(least), float(most))
            _envelope(builder, *factors, product, switch, 4.0 * reach)
        found.append(product)
    return found


def _envelope(
    builder: Builder, a: _Factor, b: _Factor, product: np.ndarray, switch: np.ndarray | None, slack: float
) -> None:
    """Four planes around a product; where there is a `switch`, they have this slack unless it is 1."""
    lower: list[Term] = [] if switch is None else [(-slack, switch)]
    upper: list[Term] = [] if switch is None else [(slack, switch)]
    room = 0.0 if switch is None else slack
    for x, y in ((a.low, b.low), (a.high, b.high)):  # product >= x b + y a - x y
        builder.row((1.0, product), (-x, b.at), (-y, a.at), *lower, low=-x * y - room)
    for x, y in ((a.high, b.low), (a.low, b.high)):  # product <= x b + y a - x y
        builder.row((1.0, product), (-x, b.at), (-y, a.at), *upper, high=-x * y + room)
