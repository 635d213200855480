"""Transitions as arrays: the same transitions, in the same order, and those that judge them say the same."""

from __future__ import annotations

import numpy as np
import pytest

from tests.prediction.test_features import random_case
from toolkit.contacts.category import Category
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.prediction.features import encode


@pytest.mark.parametrize("category", Category)
def test_rows_are_the_transitions(category):
    stance, com, velocity, transition = random_case(category, np.random.default_rng(int(category)))
    others = [random_case(category, np.random.default_rng([7, int(category), k]))[3] for k in range(40)]
    transitions = [transition, *[item for item in others if item.limb == transition.limb]]
    rows = TransitionRows.of(transitions)
    assert TransitionRows.of(rows) is rows
    assert list(rows) == transitions and rows[-1] == transitions[-1]
    chosen = np.array([2, 0, 2])
    assert list(rows.select(chosen).select(np.array([2, 1]))) == [transitions[2], transitions[0]]
    assert list(rows[1:3]) == transitions[1:3]
    with pytest.raises(IndexError):
        rows[len(transitions)]
    np.testing.assert_array_equal(encode(stance, com, velocity, rows)[1], encode(stance, com, velocity, transitions)[1])
