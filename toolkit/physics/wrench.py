"""The wrenches that a patch in contact can carry, and the points at which they act.

A wrench is force and moment about the centre of the patch in the contact frame, (fx, fy, fz, mx, my, mz), z along the
surface's normal. A patch carries it where

    friction   |(fx, fy)| <= mu fz,
    pressure   |mx| <= Y fz,  |my| <= X fz:  the centre of pressure is inside the half extents X and Y,
    yaw        |Y fx - mu mx| + |X fy - mu my| - mu (X + Y) fz <= mz <= mu (X + Y) fz - |Y fx + mu mx| - |X fy + mu my|.

`pressure_rows`, `yaw_row` and `pressure` use only arithmetic, so NumPy, compiled functions and CasADi share them.

Reference:
    Caron, Pham, Nakamura, "Stability of surface contacts for humanoid robots", ICRA 2015, Eqs. 17-19.
"""

from __future__ import annotations

import itertools

import numpy as np

from toolkit.compiled import law

SIGNS = tuple(itertools.product((-1.0, 1.0), repeat=3))
"""Signs of the eight yaw rows."""
DIRECTIONS = 12
"""Directions of the tangential force in `turning_rows`."""


@law
def pressure_rows(x, y):
    """The four rows that keep the CoP inside a patch of half extents x and y in m; `row @ wrench <= 0` inside."""
    return (
        (0.0, 0.0, -y, 1.0, 0.0, 0.0),
        (0.0, 0.0, -y, -1.0, 0.0, 0.0),
        (0.0, 0.0, -x, 0.0, 1.0, 0.0),
        (0.0, 0.0, -x, 0.0, -1.0, 0.0),
    )


@law
def yaw_row(mu, x, y, a, b, side):
    """One of the eight rows that bound the yaw moment of a patch; `row @ wrench <= 0` inside.

    Of a patch of half extents x and y in m, whose friction mu may be used for the yaw moment. The signs a, b and side
    choose the row; a side of 1 is for the upper bound, -1 for the lower.
    """
    return a * y, b * x, -mu * (x + y), side * a * mu, side * b * mu, side


@law
def pressure(wrench, load):
    """Centre of pressure, x and y, of a wrench (6,) on its patch, and the yaw moment about it.

    Args:
        wrench: (6,) about the centre of the patch.
        load: Its normal force, or a substitute for one near zero.
    """
    x, y = -wrench[4] / load, wrench[3] / load
    return x, y, wrench[5] - x * wrench[1] + y * wrench[0]


def friction_rows(friction: float, sides: int = 24) -> np.ndarray:
    """Rows of a regular polygon inside the circular friction cone, with corners along the axes.

    Args:
        friction: Coulomb coefficient.
        sides: Number of sides of the polygon.

    Returns:
        (sides, 3); `rows @ f <= 0` implies |f_xy| <= friction * f_z.
    """
    angles = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    bound = np.full(sides, -friction * np.cos(np.pi / sides))
    return np.column_stack([np.cos(angles), np.sin(angles), bound])


def sole_rows(friction: float, half_size: np.ndarray, yaw: float = 1.0, sides: int = 24) -> np.ndarray:
    """Rows of the cone of wrenches that a rectangular sole can carry.

    The yaw margin is a factor on the friction of the yaw rows. (A factor on the moment itself would be wrong near an
    edge: the tangential force at the CoP has a moment about the centre, and what friction adds to it vanishes at the
    corners.)

    Args:
        friction: Coulomb coefficient.
        half_size: (2,) m; X along x and Y along y of the contact frame.
        yaw: Factor on the friction that may be used for the yaw moment.
        sides: Number of sides of the friction polygon.

    Returns:
        (sides + 12, 6); `rows @ wrench <= 0` inside.
    """
    x, y = half_size
    friction_part = np.hstack([friction_rows(friction, sides), np.zeros((sides, 3))])
    yaw_rows = [yaw_row(yaw * friction, x, y, *signs) for signs in SIGNS]
    return np.vstack([friction_part, pressure_rows(x, y), yaw_rows])


def turning_rows(friction: float, half_size: np.ndarray, yaw: float = 1.0) -> np.ndarray:
    """Rows that couple the tangential force and the yaw moment of a sole whose corners slide by circular cones.

    Corners at r_i with normal forces n_i hold, in any direction (a, c) of tangential force and yaw moment,

        a . f_xy + c mz <= mu sum_i n_i |a + c z x r_i|,

    and elastic corners share the load so that n_i is affine in the centre of pressure, as is then the right-hand side.
    A sole that uses all of its friction to push has none left to turn with, which the square cones behind the yaw rows
    of `sole_rows` do not see; those in turn are the tighter ones where the load is on three corners.

    Args:
        friction: Coulomb coefficient.
        half_size: (2,) m; X along x and Y along y of the contact frame.
        yaw: Factor on the friction of rows for a pure yaw moment; the more a row is about force, the closer to 1.

    Returns:
        (6 * DIRECTIONS + 2, 6); `rows @ [f, m] <= 0` as in `sole_rows`.

    Reference:
        Goyal, Ruina, Papadopoulos, "Planar sliding with dry friction", Wear 143, 1991: limit surfaces.
    """
    tilts = np.radians([20.0, -20.0, 45.0, -45.0, 70.0, -70.0])
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ahead = np.append(np.kron(np.cos(tilts), np.cos(angles)), [0.0, 0.0])
    aside = np.append(np.kron(np.cos(tilts), np.sin(angles)), [0.0, 0.0])
    share = np.append(np.repeat(np.sin(tilts), DIRECTIONS), [1.0, -1.0])
    turn = share / np.hypot(*half_size)
    signs = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    x, y = (signs * half_size).T
    held = np.hypot(ahead[:, None] - turn[:, None] * y, aside[:, None] + turn[:, None] * x)
    held *= (friction * np.cos(np.pi / 16) * (1.0 + (yaw - 1.0) * share**2))[:, None]
    by_x, by_y = (held @ signs / (4.0 * np.asarray(half_size))).T  # per fz and m of the CoP, which is (-my, mx) / fz
    return np.column_stack([ahead, aside, -held.mean(1), -by_y, by_x, turn])


def foot_rows(friction: float, half_size: np.ndarray, yaw: float = 1.0) -> np.ndarray:
    """Everything that bounds the wrench of a sole: `sole_rows` and `turning_rows`."""
    return np.vstack([sole_rows(friction, half_size, yaw), turning_rows(friction, half_size, yaw)])


def corner_rays(friction: float, half_size: np.ndarray, sides: int) -> tuple[np.ndarray, np.ndarray]:
    """Forces at the corners of a patch; their combinations with nonnegative factors are wrenches that it can carry.

    They lie along the edges of a polygon inside the circular friction cone, with corners along the axes.

    Args:
        friction: Coulomb coefficient.
        half_size: (2,) m; X along x and Y along y of the contact frame.
        sides: Number of sides of the polygon.

    Returns:
        (4 * sides, 3) forces with normal force 1 and (4 * sides, 3) m points at which they act, in the contact frame.
    """
    angle = np.arange(sides) * (2 * np.pi / sides)
    edges = np.stack([friction * np.cos(angle), friction * np.sin(angle), np.ones(sides)], 1)
    corners = np.array([[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]]) * [half_size[0], half_size[1], 0.0]
    return np.tile(edges, (4, 1)), np.repeat(corners, sides, 0)
