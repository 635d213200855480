"""Reading states of the contact search as stances and transitions."""

from __future__ import annotations

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.geometry.limb import Limb
from toolkit.robot.scale import USUAL, Scale
from toolkit.search.states.contact_table import ContactTable
from toolkit.search.states.state import CONTACTS, LAST, motion_of, origin_of, pack, unpack
from toolkit.world.timing import Timing

_LIMBS = tuple(Limb)


class StateReader:
    """Reads the states of one search, which name the contacts of `table` by number and `timings` by index.

    Attributes:
        scale: The robot's size, which gives the units of the CoM and of its velocity.
    """

    def __init__(self, table: ContactTable, timings: tuple[Timing, ...], scale: Scale = USUAL):
        self._table, self._timings, self.scale = table, timings, scale
        self._shifts, self._swings = np.array([(item.shift, item.swing) for item in timings]).T

    def at_rest(self, stance: Stance, com: np.ndarray) -> bytes:
        """State of a robot at rest in a stance with CoM (3,) m, of which no limb has moved yet."""
        numbers = np.full((1, 4), -1)
        for contact in stance.contacts:
            numbers[0, contact.limb] = self._table.add_contact(contact)
        return self.states(numbers, np.array([-1]), com[None], np.zeros((1, 3)))[0]

    def states(self, contacts: np.ndarray, last: np.ndarray, com: np.ndarray, velocity: np.ndarray) -> list[bytes]:
        """States; see `state.pack`."""
        return pack(contacts, last, com, velocity, self.scale)

    def motion(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(..., 3) CoM in m and velocity in m/s of rows (..., 11 or more)."""
        return motion_of(rows, self.scale)

    def stance(self, contacts: np.ndarray) -> Stance:
        """Stance of contact numbers (4,)."""
        return Stance(tuple(self._table.contact(int(number)) for number in contacts if number >= 0))

    def origin(self, state: bytes) -> tuple[Stance, np.ndarray, np.ndarray]:
        """Stance, CoM (3,) m and velocity (3,) m/s of a state, or of the one that a pending state comes from."""
        row = unpack([state])[0]
        return self.stance(origin_of(row)[CONTACTS]), *self.motion(row)

    def transition(self, state: bytes, payload: tuple[float, int]) -> ContactTransition:
        """The transition that led to a state over an edge with this payload (objective, index of the timing)."""
        row = unpack([state])[0]
        limb = int(row[LAST])
        return self._transition(limb, int(row[CONTACTS][limb]), payload[1])

    def transitions(self, limb: np.ndarray, number: np.ndarray, timing: np.ndarray) -> TransitionRows:
        """Transitions of limbs (n,) to contact numbers (n,), -1 where a palm breaks, with timings (n,) by index."""
        table = self._table
        return TransitionRows(
            limb,
            number >= 0,
            table.position[number],
            table.rotation[number],
            table.friction(number),
            self._shifts[timing],
            self._swings[timing],
            lambda row: self._transition(int(limb[row]), int(number[row]), int(timing[row])),
        )

    def _transition(self, limb: int, number: int, timing: int) -> ContactTransition:
        contact = self._table.contact(number) if number >= 0 else None
        return ContactTransition(_LIMBS[limb], contact, self._timings[timing])
