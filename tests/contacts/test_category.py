"""The table of categories against the paper's words, and what is derived from it for robots that lack limbs."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.contacts.category import Category, categories_of, category_of, category_rows
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.loader import load_robot

PALM_SETS = [(), (Limb.LEFT_PALM,), (Limb.RIGHT_PALM,), PALMS]


def contact(limb):
    return Contact(limb, Pose.identity(), 0.5)


def in_words(palms, limb, makes):
    """The category as the paper's table says it."""
    if limb in FEET:
        if len(palms) == 1:
            inner = (palms[0] == Limb.LEFT_PALM) == (limb == Limb.LEFT_FOOT)
            return Category.MOVE_INNER_FOOT_WITH_PALM if inner else Category.MOVE_OUTER_FOOT_WITH_PALM
        return Category.MOVE_FOOT_WITH_PALMS if palms else Category.MOVE_FOOT
    if limb not in palms:
        return Category.ADD_OTHER_PALM if palms else Category.ADD_PALM
    if makes:
        return Category.MOVE_ONE_PALM if len(palms) == 2 else Category.MOVE_ONLY_PALM
    return Category.BREAK_ONE_PALM if len(palms) == 2 else Category.BREAK_ONLY_PALM


def test_limbs_are_ordered_and_mirrored():
    assert [int(limb) for limb in Limb] == list(range(len(Limb))) and list(Limb) == [*FEET, *PALMS]
    for limb in Limb:
        other = limb.mirrored
        assert other != limb and other.mirrored == limb
        assert other.is_foot == limb.is_foot and other.is_left != limb.is_left
        assert limb.label == f"{'left' if limb.is_left else 'right'}_{'foot' if limb.is_foot else 'palm'}"
        assert Limb.from_label(limb.label) is limb


@pytest.mark.parametrize("palms", PALM_SETS)
def test_every_transition_has_the_papers_category(palms):
    stance = Stance(tuple(contact(limb) for limb in (*FEET, *palms)))
    moves = [ContactTransition(limb, contact(limb)) for limb in Limb]
    moves += [ContactTransition(limb, None) for limb in palms]
    expected = [in_words(palms, move.limb, move.contact is not None) for move in moves]
    assert [category_of(stance, move) for move in moves] == expected
    np.testing.assert_array_equal(category_rows(stance, moves), expected)
    for limb in set(PALMS) - set(palms):
        with pytest.raises(ValueError, match=f"{limb.label} is not in contact and cannot be broken"):
            category_of(stance, ContactTransition(limb, None))


def test_a_robot_has_the_categories_of_its_limbs():
    robot = load_robot(None)
    assert categories_of(robot) == list(Category)
    assert categories_of(replace(robot, arms={})) == [Category.MOVE_FOOT]
    for limb in PALMS:
        one = categories_of(replace(robot, arms={limb: robot.arms[limb]}))
        assert one == [Category(number) for number in range(6)]
