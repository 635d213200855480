"""Linear cones of the wrenches that a contact can carry."""

from __future__ import annotations

import itertools

import numpy as np


def friction_rows(friction: float, sides: int = 24) -> np.ndarray:
    """Rows of a regular polygon inside the circular friction cone, with corners along the axes.

    Args:
        friction: Coulomb coefficient.
        sides: of the polygon.

    Returns:
        (sides, 3); `rows @ f <= 0` implies |f_xy| <= friction * f_z.
    """
    angles = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    bound = np.full(sides, -friction * np.cos(np.pi / sides))
    return np.column_stack([np.cos(angles), np.sin(angles), bound])


def sole_rows(friction: float, half_size: np.ndarray, yaw: float = 1.0, sides: int = 24) -> np.ndarray:
    """Rows of the cone of wrenches that a rectangular sole can carry.

    Friction as in `friction_rows`; the centre of pressure inside the rectangle, |mx| <= Y fz and |my| <= X fz; and the
    yaw moment that corner forces can hold under friction,

        -nu (X + Y) fz + |Y fx - nu mx| + |X fy - nu my| <= mz <= nu (X + Y) fz - |Y fx + nu mx| - |X fy + nu my|,

    with nu = yaw * mu. (Scaling mz instead would be wrong near an edge: the tangential force at the CoP has a moment
    about the centre, and what friction adds to it vanishes at the corners.)

    Args:
        friction: Coulomb coefficient.
        half_size: (2,) m; X along x and Y along y of the contact frame.
        yaw: factor on the friction that may be used for the yaw moment.
        sides: of the friction polygon.

    Returns:
        (sides + 12, 6); `rows @ [f, m] <= 0` with force and moment about the centre in the contact frame.

    Reference:
        Caron, Pham, Nakamura, "Stability of surface contacts for humanoid robots", ICRA 2015, Eqs. 17-19.
    """
    x, y = half_size
    rows = [np.hstack([friction_rows(friction, sides), np.zeros((sides, 3))])]
    pressure = np.zeros((4, 6))
    pressure[:, 2] = -np.array([y, y, x, x])
    pressure[0, 3], pressure[1, 3], pressure[2, 4], pressure[3, 4] = 1.0, -1.0, 1.0, -1.0
    rows.append(pressure)
    turning = yaw * friction
    for a, b in itertools.product((-1.0, 1.0), repeat=2):
        rows.append(np.array([[a * y, b * x, -turning * (x + y), -a * turning, -b * turning, -1.0]]))
        rows.append(np.array([[a * y, b * x, -turning * (x + y), a * turning, b * turning, 1.0]]))
    return np.vstack(rows)


def turning_rows(friction: float, half_size: np.ndarray, yaw: float = 1.0, sides: int = 12) -> np.ndarray:
    """Rows that couple the tangential force and the yaw moment of a sole whose corners slide by circular cones.

    Corners at r_i with normal forces n_i hold, in any direction (a, c) of tangential force and yaw moment,

        a . f_xy + c mz <= mu sum_i n_i |a + c z x r_i|,

    and elastic corners share the load so that n_i is affine in the centre of pressure, as is then the right-hand side.
    A sole that uses all of its friction to push has none left to turn with, which the square cones behind the yaw rows
    of `sole_rows` do not see; those in turn are the tighter ones where the load is on three corners.

    Args:
        friction: Coulomb coefficient.
        half_size: (2,) m; X along x and Y along y of the contact frame.
        yaw: factor on the friction of rows for a pure yaw moment; the more a row is about force, the closer to 1.
        sides: directions of the force.

    Returns:
        (6 * sides + 2, 6); `rows @ [f, m] <= 0` as in `sole_rows`.

    Reference:
        Goyal, Ruina, Papadopoulos, "Planar sliding with dry friction", Wear 143, 1991: limit surfaces.
    """
    tilts, angles = np.radians([20.0, -20.0, 45.0, -45.0, 70.0, -70.0]), 2.0 * np.pi * np.arange(sides) / sides
    ahead = np.append(np.kron(np.cos(tilts), np.cos(angles)), [0.0, 0.0])
    aside = np.append(np.kron(np.cos(tilts), np.sin(angles)), [0.0, 0.0])
    share = np.append(np.repeat(np.sin(tilts), sides), [1.0, -1.0])
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
