"""Sequences have an identity: equal ones share it, and nothing that makes them different is lost in it."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.contacts.sequence import Change, ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.world.timing import Timing


def contact(limb, x=0.0, yaw=0.0, friction=0.7, surface=0):
    return Contact(limb, Pose.from_yaw(np.array([x, 0.1 - 0.2 * limb, 0.0]), yaw), friction, surface)


def sequence(*transitions, start=0.0):
    return ContactSequence(
        Stance((contact(Limb.LEFT_FOOT, start), contact(Limb.RIGHT_FOOT))),
        (ContactTransition(Limb.LEFT_FOOT, contact(Limb.LEFT_FOOT, 0.3)), *transitions),
    )


PALM = ContactTransition(Limb.LEFT_PALM, contact(Limb.LEFT_PALM, 0.4, surface=2))


def test_equal_sequences_are_the_same():
    assert sequence(PALM).identity == sequence(replace(PALM)).identity


@pytest.mark.parametrize(
    "other",
    [
        sequence(),
        sequence(PALM, start=1e-9),
        sequence(replace(PALM, contact=None)),
        sequence(replace(PALM, contact=contact(Limb.LEFT_PALM, 0.4, yaw=1e-9, surface=2))),
        sequence(replace(PALM, contact=contact(Limb.LEFT_PALM, 0.4, surface=1))),
        sequence(replace(PALM, contact=contact(Limb.LEFT_PALM, 0.4, friction=0.6, surface=2))),
        sequence(replace(PALM, timing=Timing(1.0, 0.9))),
        sequence(ContactTransition(Limb.RIGHT_PALM, contact(Limb.RIGHT_PALM, 0.4, surface=2))),
    ],
)
def test_whatever_differs_makes_another_one(other):
    assert other.identity != sequence(PALM).identity


def steps(*places):
    """Feet by turns, the left one first."""
    limbs = (Limb(number % 2) for number in range(len(places)))
    return tuple(ContactTransition(limb, contact(limb, x)) for limb, x in zip(limbs, places, strict=True))


WALK = ContactSequence(sequence().start, steps(0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9))


@pytest.mark.parametrize("around", [0, 1, 2, 20])
@pytest.mark.parametrize("dropped", [(0,), (3,), (7,), (2, 3), (1, 2, 3, 4), ()])
def test_a_change_is_what_two_sequences_do_not_share(around, dropped):
    other = replace(WALK, transitions=tuple(t for index, t in enumerate(WALK.transitions) if index not in dropped))
    change = Change.between(WALK, other, around)
    end = change.first + len(change.old.transitions)
    before, after = WALK.transitions[: change.first], WALK.transitions[end:]
    assert change.old.start == change.new.start == WALK.stances[change.first]
    assert (*before, *change.old.transitions, *after) == WALK.transitions
    assert (*before, *change.new.transitions, *after) == other.transitions
    assert change.old.stances[-1].identity == change.new.stances[-1].identity or not after
    assert change.first == max(0, min((*dropped, 8)) - around)
    assert change.following == next(iter(after), None)


def test_a_change_lasts_until_the_feet_stand_where_they_did():
    other = replace(WALK, transitions=WALK.transitions[:3] + WALK.transitions[4:])  # the right foot steps farther later
    change = Change.between(WALK, other, 0)
    assert change.old.transitions == WALK.transitions[3:6]
    assert change.new.transitions == WALK.transitions[4:6]
