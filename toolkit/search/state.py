"""States of the contact search, packed: 44 bytes that are at once the state and its identity.

A state is the numbers of its contacts (-1 where a palm has none), the limb that moved last (-1 at the start; it may
not move again at once), the CoM in mm and its velocity in mm/s. Rounding to 1 mm is the paper's identification of
states; contacts are rounded in the contact table.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SIZE = 11  # int32 each
CONTACTS, LAST, COM, VELOCITY = slice(0, 4), 4, slice(5, 8), slice(8, 11)


def pack(contacts: np.ndarray, last: np.ndarray, com: np.ndarray, velocity: np.ndarray) -> list[bytes]:
    """States of n rows.

    Args:
        contacts: (n, 4) int; contact numbers by limb.
        last: (n,) int; limb moved last.
        com: (n, 3) m.
        velocity: (n, 3) m/s.
    """
    rows = np.empty((len(contacts), SIZE), np.int32)
    rows[:, CONTACTS], rows[:, LAST] = contacts, last
    rows[:, COM] = np.round(com * 1000)
    rows[:, VELOCITY] = np.round(velocity * 1000)
    data, size = rows.tobytes(), 4 * SIZE
    return [data[start : start + size] for start in range(0, len(data), size)]


def unpack(states: Sequence[bytes]) -> np.ndarray:
    """(n, 11) int rows of packed states."""
    return np.frombuffer(b"".join(states), np.int32).reshape(-1, SIZE)
