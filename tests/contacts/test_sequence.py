"""Sequences have an identity: equal ones share it, and nothing that makes them different is lost in it."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.contacts.sequence import ContactSequence, ContactTransition
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
