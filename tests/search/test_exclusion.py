"""Exclusions: a transition that failed, and those like it, are left out of the next search; nothing else is."""

import numpy as np
import pytest

from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.search.moves.exclusion import Blame, Exclusion, excluded


def contact(limb, x, y):
    return Contact(limb, Pose.from_yaw(np.array([x, y, 0.0]), 0.0), 0.5)


STANCE = Stance((contact(Limb.LEFT_FOOT, 0.0, 0.1), contact(Limb.RIGHT_FOOT, 0.0, -0.1)))


def walk(*steps):
    """A sequence of steps of the left foot and the right one in turn, to the given x in m."""
    limbs = [(Limb.LEFT_FOOT, 0.1), (Limb.RIGHT_FOOT, -0.1)] * len(steps)
    moves = [ContactTransition(limb, contact(limb, x, y)) for (limb, y), x in zip(limbs, steps, strict=False)]
    return ContactSequence(STANCE, tuple(moves))


def test_only_like_transitions_are_excluded():
    palm = contact(Limb.LEFT_PALM, 0.2, 0.6)
    stance = Stance((*STANCE.contacts, palm))
    step = Exclusion.of(stance, _step())
    broken = Exclusion.of(stance, ContactTransition(Limb.LEFT_PALM, None))
    limb = np.array([0, 0, 1, 2, 2])
    target = np.array([[0.31, 0.1, 0.0], [0.4, 0.1, 0.0], [0.3, 0.1, 0.0], [np.nan] * 3, [0.2, 0.7, 0.0]])
    np.testing.assert_array_equal(excluded([step], step.before, limb, target), [1, 0, 0, 0, 0])
    np.testing.assert_array_equal(excluded([step, broken], step.before, limb, target), [1, 0, 0, 1, 0])
    # Out of another stance the same step is allowed: a foot elsewhere, or no palm.
    elsewhere = step.before + np.array([0.1, 0.0, 0.0])
    assert not excluded([step], elsewhere, limb, target).any()
    assert not excluded([step], Exclusion.of(stance.without(Limb.LEFT_PALM), _step()).before, limb, target).any()


def test_the_first_transition_that_is_avoided_is_found():
    blame = Blame()
    blame.add(walk(0.2, 0.4, 0.6), 1)
    assert blame.first_in(walk(0.2, 0.41)) == 1 and blame.first_in(walk(0.2, 0.3, 0.4)) is None
    blame.add(walk(0.2), 0)
    assert blame.first_in(walk(0.2, 0.41)) == 0
    assert blame.first_in(walk(0.2, 0.41), since=2) is None  # what was entered before does not count


@pytest.mark.parametrize("index", [None, 0])
def test_what_is_unknown_is_not_blamed(index):
    blame = Blame()
    blame.add(walk(0.2) if index is None else walk(), index)
    assert not blame.exclusions


def test_the_final_rest_is_blamed_on_the_last_transition():
    blame = Blame()
    blame.add(walk(0.2, 0.4), 2)
    assert blame.first_in(walk(0.2, 0.4)) == 1


def test_one_strike_or_more_are_given():
    blame = Blame(strikes=2)
    blame.add(walk(0.2, 0.4), 1)
    assert not blame.exclusions
    blame.add(walk(0.2, 0.5), 1)  # another transition
    assert not blame.exclusions
    blame.add(walk(0.21, 0.4), 1)  # nearly the first one
    assert blame.first_in(walk(0.2, 0.4)) == 1 and blame.first_in(walk(0.2, 0.5)) is None


def test_the_same_place_does_not_fail_a_third_time():
    """The second failure close to the first one, but not the same, makes a wide place of it."""
    blame = Blame()
    blame.add(walk(0.2, 0.4), 1)
    near = walk(0.2, 0.44)
    assert blame.first_in(near) is None
    blame.add(near, 1)
    assert all(blame.first_in(walk(0.2, x)) == 1 for x in (0.39, 0.42, 0.46, 0.49))
    assert blame.first_in(walk(0.2, 0.53)) is None and blame.first_in(walk(0.2, 0.3)) is None


def test_what_is_avoided_from_the_beginning_is_kept():
    given = Exclusion.of(STANCE, _step())
    blame = Blame([given])
    blame.add(walk(0.2), 0)
    assert blame.exclusions[0] is given and len(blame.exclusions) == 2


def _step():
    return ContactTransition(Limb.LEFT_FOOT, contact(Limb.LEFT_FOOT, 0.3, 0.1))
