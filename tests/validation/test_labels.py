"""Continuations of one prefix, what their labels differ by, and predictions in a row."""

from typing import Any

import numpy as np
import pytest

from tests.centroidal.walks import foot
from toolkit.contacts.category import Category
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.learning.label import label
from toolkit.prediction.features import encode
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.robot.loader import load_robot
from toolkit.world.timing import Timing
from validation.labels import AGES, Along, Spread, chained, spread_rows, spreads


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


def walk(robot, places):
    start = Stance(tuple(foot(robot, limb, 0.0) for limb in FEET))
    steps = (
        ContactTransition(Limb(i % 2), foot(robot, Limb(i % 2), x), Timing(0.6, 0.8)) for i, x in enumerate(places)
    )
    return ContactSequence(start, tuple(steps))


class Exact:
    """In place of a network: gives the outcome of the transition that is asked about."""

    def __init__(self, labelled, offset):
        self._labelled, self._offset, self._index = labelled, offset, 0

    def feasible(self, features):
        return np.ones(len(features), bool)

    def predict(self, features, goal):
        problem = self._labelled.problem(self._index)
        frame, _ = encode(problem.stance, problem.com, problem.com_velocity, [problem.transition])
        objective, com, velocity = self._labelled.outcome(self._index)
        self._index += 1
        return np.concatenate([[objective], frame.point(com + self._offset), frame.vector(velocity)])[None]


def test_labels_of_one_prefix_and_predictions_in_a_row(robot):
    first = [0.15, 0.3, 0.45]
    tried = [label(robot, walk(robot, [*first, *rest])) for rest in ([0.45], [0.6, 0.6])]
    labelled = [item for item in tried if item is not None]
    assert len(labelled) == 2
    found = spreads(3, labelled)
    assert [item.age for item in found] == list(range(AGES))
    for item in found:
        for row, motion in enumerate(labelled):
            assert item.objective[row] == motion.parts.objective[2 - item.age]
            np.testing.assert_array_equal(item.com[row], motion.parts.com[3 - item.age])
    rows = spread_rows(found)
    # What comes later matters less to a transition that is longer ago.
    assert rows[0].com > rows[1].com > rows[2].com and rows[0].relative > rows[2].relative

    motion = labelled[1]
    networks: Any = dict.fromkeys(Category, Exact(motion, np.array([0.0, 0.003, 0.0])))
    result = chained(motion, networks)
    assert result.com_error is None and result.rejected == 0 and result.transitions == 5
    assert result.predicted == pytest.approx(result.objective)


def test_rows_are_medians_over_prefixes():
    still = np.zeros((2, 3))
    found = [Spread(0, np.array(pair), still, still + [[0.0], [0.2]]) for pair in ([9.0, 11.0], [80.0, 120.0])]
    (row,) = spread_rows(found)
    assert row.prefixes == 2 and row.relative == pytest.approx((0.1 + 0.2) / 2)
    assert row.unexplained == pytest.approx((1.0 + 400.0) / 2 / np.var([9.0, 11.0, 80.0, 120.0]))
    assert row.com == 0.0 and row.com_velocity == pytest.approx(0.1 * np.sqrt(3.0))


def test_a_search_is_kept_on_its_prefix(robot):
    sequence = walk(robot, [0.15, 0.3, 0.45])
    judge = Along(KinematicEvaluator(robot), sequence, 1)
    com, rest = np.zeros(3), np.zeros(3)
    other = ContactTransition(Limb.LEFT_FOOT, foot(robot, Limb.LEFT_FOOT, 0.2), Timing(0.6, 0.8))
    asked = [other, sequence.transitions[0]]
    assert judge.evaluate(sequence.start, com, rest, asked).feasible.tolist() == [False, True]
    later = [sequence.transitions[1]]
    assert judge.evaluate(sequence.stances[1], com, rest, later).feasible.tolist() == [True]
