"""Linear cones of the wrenches that a contact can carry."""

from __future__ import annotations

import itertools

import numpy as np


def friction_rows(friction: float, sides: int = 16) -> np.ndarray:
    """Rows of a regular polygon inside the circular friction cone.

    Args:
        friction: Coulomb coefficient.
        sides: of the polygon.

    Returns:
        (sides, 3); `rows @ f <= 0` implies |f_xy| <= friction * f_z.
    """
    angles = 2.0 * np.pi * np.arange(sides) / sides
    bound = np.full(sides, -friction * np.cos(np.pi / sides))
    return np.column_stack([np.cos(angles), np.sin(angles), bound])


def sole_rows(friction: float, half_size: np.ndarray, yaw: float = 1.0, sides: int = 16) -> np.ndarray:
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
