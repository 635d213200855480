"""The categories of contact transitions (paper, Fig. 3)."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from functools import lru_cache

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.robot.model import RobotModel


class Category(IntEnum):
    """Category of a contact transition; the value is the paper's index.

    Each row holds the number, the palms in contact before the transition, the limb that moves, and whether that limb
    makes a contact or breaks one. A row is written for a left limb that moves and stands for its mirror image too. The
    inner foot is the one on the side of the only palm in contact.

    Attributes:
        before: Limbs in contact before the transition, in order.
        moving: The limb that moves.
        makes: Whether it makes a new contact.
    """

    before: tuple[Limb, ...]
    moving: Limb
    makes: bool

    MOVE_FOOT = 0, (), Limb.LEFT_FOOT, True
    ADD_PALM = 1, (), Limb.LEFT_PALM, True
    MOVE_INNER_FOOT_WITH_PALM = 2, (Limb.LEFT_PALM,), Limb.LEFT_FOOT, True
    MOVE_OUTER_FOOT_WITH_PALM = 3, (Limb.RIGHT_PALM,), Limb.LEFT_FOOT, True
    BREAK_ONLY_PALM = 4, (Limb.LEFT_PALM,), Limb.LEFT_PALM, False
    MOVE_ONLY_PALM = 5, (Limb.LEFT_PALM,), Limb.LEFT_PALM, True
    ADD_OTHER_PALM = 6, (Limb.RIGHT_PALM,), Limb.LEFT_PALM, True
    MOVE_FOOT_WITH_PALMS = 7, PALMS, Limb.LEFT_FOOT, True
    BREAK_ONE_PALM = 8, PALMS, Limb.LEFT_PALM, False
    MOVE_ONE_PALM = 9, PALMS, Limb.LEFT_PALM, True

    def __new__(cls, number: int, palms: tuple[Limb, ...], moving: Limb, makes: bool) -> Category:
        """Make the member of one row."""
        category = int.__new__(cls, number)
        category._value_ = number
        category.before, category.moving, category.makes = (*FEET, *palms), moving, makes
        return category

    @property
    def words(self) -> str:
        """What happens, such as "move foot"."""
        return self.name.lower().replace("_", " ")

    @property
    def contact_limbs(self) -> tuple[Limb, ...]:
        """Limbs of the contacts that describe a transition: those before it, then that of the new contact if any."""
        return (*self.before, self.moving) if self.makes else self.before

    @property
    def palms_before(self) -> int:
        """Number of palms in contact before the transition."""
        return len(self.before) - len(FEET)


def category_rows(stance: Stance, transitions: Sequence[ContactTransition]) -> np.ndarray:
    """(n,) int; category of each of n transitions out of a stance.

    Raises:
        ValueError: A limb that is not in contact would break its contact.
    """
    rows = TransitionRows.of(transitions)
    found = _table(stance.limbs)[rows.limb, rows.makes.astype(int)]
    if (found < 0).any():
        limb = Limb(rows.limb[np.argmin(found)])
        raise ValueError(f"{limb.label} is not in contact and cannot be broken")
    return found


def category_of(stance: Stance, transition: ContactTransition) -> Category:
    """Category of one transition out of a stance; see `category_rows`."""
    return Category(category_rows(stance, [transition])[0])


def performs(robot: RobotModel, category: Category, *, mirrored: bool = False) -> bool:
    """Whether a robot has all limbs of a category's row, or of the mirror image of the row."""
    used = (*category.before, category.moving)
    return {limb.mirrored if mirrored else limb for limb in used} <= {*robot.legs, *robot.arms}


def categories_of(robot: RobotModel) -> list[Category]:
    """Categories that a robot has the limbs for on at least one side."""
    return [category for category in Category if performs(robot, category) or performs(robot, category, mirrored=True)]


@lru_cache
def _table(in_contact: tuple[Limb, ...]) -> np.ndarray:
    """(len(Limb), 2) int; category by the limb that moves and by whether it makes a contact, or -1."""
    table = np.full((len(Limb), 2), -1)
    for category in Category:
        for mirrored in (False, True):
            before = {limb.mirrored if mirrored else limb for limb in category.before}
            if before == set(in_contact):
                limb = category.moving.mirrored if mirrored else category.moving
                table[limb, int(category.makes)] = category
    return table
