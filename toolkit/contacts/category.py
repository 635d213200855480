"""The ten categories of contact transitions (paper, Fig. 3) and their mirror."""

from __future__ import annotations

from enum import IntEnum

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance


class Category(IntEnum):
    """Category of a contact transition; the value is the paper's index."""

    MOVE_FOOT = 0
    ADD_PALM = 1
    MOVE_INNER_FOOT_WITH_PALM = 2
    MOVE_OUTER_FOOT_WITH_PALM = 3
    BREAK_ONLY_PALM = 4
    MOVE_ONLY_PALM = 5
    ADD_OTHER_PALM = 6
    MOVE_FOOT_WITH_PALMS = 7
    BREAK_ONE_PALM = 8
    MOVE_ONE_PALM = 9


def category_of(stance: Stance, transition: ContactTransition) -> Category:
    """Category of a transition from a stance.

    The inner foot is the one on the side of the only palm in contact, the outer foot the other.

    Raises:
        ValueError: a palm that is not in contact cannot be broken.
    """
    palms, limb = stance.palms, transition.limb
    if transition.contact is None and limb not in palms:
        raise ValueError(f"{limb.label} is not in contact and cannot be broken")
    if limb.is_foot:
        if len(palms) == 1:
            inner = palms[0].is_left == limb.is_left
            return Category.MOVE_INNER_FOOT_WITH_PALM if inner else Category.MOVE_OUTER_FOOT_WITH_PALM
        return Category.MOVE_FOOT_WITH_PALMS if palms else Category.MOVE_FOOT
    if not palms:
        return Category.ADD_PALM
    if limb not in palms:
        return Category.ADD_OTHER_PALM
    if transition.contact is None:
        return Category.BREAK_ONE_PALM if len(palms) == 2 else Category.BREAK_ONLY_PALM
    return Category.MOVE_ONE_PALM if len(palms) == 2 else Category.MOVE_ONLY_PALM
