"""States of the contact search, packed: bytes that are at once the state and its identity.

A state (44 bytes) is the numbers of its contacts (-1 where a palm has none), the limb that moved last (-1 at the
start; it may not move again at once), the CoM in mm and its velocity in mm/s. Rounding to 1 mm is the paper's
identification of states; contacts are rounded in the contact table. Bodies of other sizes have these units to scale.

A pending state (52 bytes) stands for a transition that is still to be judged. Its contacts and limb are those after the
transition, its CoM and velocity those before it. The old contact of the limb and the transition's timing follow.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.robot.scale import USUAL, Scale

SIZE, PENDING = 11, 13  # int32 each
CONTACTS, LAST, COM, VELOCITY = slice(0, 4), 4, slice(5, 8), slice(8, 11)
OLD, TIMING = 11, 12
_UNITS = 1000.0  # in a m and in a m/s, for a body of the usual size (`toolkit.robot.scale`)


def pack(
    contacts: np.ndarray, last: np.ndarray, com: np.ndarray, velocity: np.ndarray, scale: Scale = USUAL
) -> list[bytes]:
    """States of contact numbers (n, 4), limbs (n,) that moved last, CoMs (n, 3) m and velocities (n, 3) m/s."""
    rows = np.empty((len(contacts), SIZE), np.int32)
    rows[:, CONTACTS], rows[:, LAST] = contacts, last
    rows[:, COM] = np.round(com * (_UNITS / scale.length))
    rows[:, VELOCITY] = np.round(velocity * (_UNITS / scale.speed))
    return _split(rows)


def motion_of(rows: np.ndarray, scale: Scale = USUAL) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3) CoM in m and velocity in m/s of rows (..., 11 or more)."""
    return rows[..., COM] / (_UNITS / scale.length), rows[..., VELOCITY] / (_UNITS / scale.speed)


def speed_of(rows: np.ndarray) -> np.ndarray:
    """(n,) horizontal speed of rows (n, 11 or more), in m/s of a body of the usual size."""
    return np.hypot(*rows[:, VELOCITY][:, :2].T) / _UNITS


def pack_pending(before: np.ndarray, contacts: np.ndarray, limb: np.ndarray, timing: np.ndarray) -> list[bytes]:
    """Pending states of n transitions out of the state with the row `before` (11,).

    The transitions move limbs (n,) with timings (n,) by index to the contact numbers (n, 4).
    """
    rows = np.empty((len(contacts), PENDING), np.int32)
    rows[:, CONTACTS], rows[:, LAST], rows[:, TIMING] = contacts, limb, timing
    rows[:, COM], rows[:, VELOCITY], rows[:, OLD] = before[COM], before[VELOCITY], before[CONTACTS][limb]
    return _split(rows)


def is_pending(state: bytes) -> bool:
    """Whether a state stands for a transition that is still to be judged."""
    return len(state) == 4 * PENDING


def unpack(states: Sequence[bytes]) -> np.ndarray:
    """(n, 11) int rows of packed states, (n, 13) of pending ones; one kind at a time."""
    return np.frombuffer(b"".join(states), np.int32).reshape(len(states), -1)


def unpack_all(states: Sequence[bytes]) -> np.ndarray:
    """(n, 11) int rows of states of both kinds; pending ones without their last two numbers."""
    size = 4 * SIZE
    return np.frombuffer(b"".join([state[:size] for state in states]), np.int32).reshape(len(states), SIZE)


def origin_of(row: np.ndarray) -> np.ndarray:
    """The row of a state; of a pending one, the row of the state that it comes from, except for its last limb."""
    if len(row) <= OLD:
        return row
    before = row.copy()
    before[CONTACTS][row[LAST]] = row[OLD]
    return before


def _split(rows: np.ndarray) -> list[bytes]:
    """One piece of bytes per row."""
    data, size = rows.tobytes(), 4 * rows.shape[1]
    return [data[start : start + size] for start in range(0, len(data), size)]
