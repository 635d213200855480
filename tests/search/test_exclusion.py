"""Exclusions: a transition that failed, and those like it, are left out of the next search; nothing else is."""

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.search.moves.exclusion import Exclusion, excluded


def contact(limb, x, y):
    return Contact(limb, Pose.from_yaw(np.array([x, y, 0.0]), 0.0), 0.5)


def test_only_like_transitions_are_excluded():
    left, right = contact(Limb.LEFT_FOOT, 0.0, 0.1), contact(Limb.RIGHT_FOOT, 0.0, -0.1)
    palm = contact(Limb.LEFT_PALM, 0.2, 0.6)
    stance = Stance((left, right, palm))
    step = Exclusion.of(stance, ContactTransition(Limb.LEFT_FOOT, contact(Limb.LEFT_FOOT, 0.3, 0.1)))
    broken = Exclusion.of(stance, ContactTransition(Limb.LEFT_PALM, None))
    limb = np.array([0, 0, 1, 2, 2])
    target = np.array([[0.31, 0.1, 0.0], [0.4, 0.1, 0.0], [0.3, 0.1, 0.0], [np.nan] * 3, [0.2, 0.7, 0.0]])
    np.testing.assert_array_equal(excluded([step], step.before, limb, target), [1, 0, 0, 0, 0])
    np.testing.assert_array_equal(excluded([step, broken], step.before, limb, target), [1, 0, 0, 1, 0])
    # Out of another stance the same step is allowed: a foot elsewhere, or no palm.
    elsewhere = step.before + np.array([0.1, 0.0, 0.0])
    assert not excluded([step], elsewhere, limb, target).any()
    assert not excluded([step], Exclusion.of(stance.without(Limb.LEFT_PALM), _step()).before, limb, target).any()


def _step():
    return ContactTransition(Limb.LEFT_FOOT, contact(Limb.LEFT_FOOT, 0.3, 0.1))
