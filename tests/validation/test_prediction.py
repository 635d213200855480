"""Several test sets in one row: the median, and the worst of each figure."""

from dataclasses import replace

import pytest

from toolkit.contacts.category import Category
from toolkit.learning.evaluate import Score
from validation import goals
from validation.prediction import middle, score_goals, score_rows, worst

GOOD = Score(1000, 0.75, 0.97, 100.0, 2.0, 0.004, 0.003, 20.0)
BAD = replace(GOOD, accuracy=0.9, mean_objective=50.0, objective_error=10.0, objective_tail=40.0)
SLOW = replace(GOOD, velocity_error=0.05)


def test_the_median_and_the_worst_set_are_shown():
    sets = [GOOD, BAD, SLOW]
    assert middle(sets) == GOOD
    found = worst(sets)
    assert found.relative_objective_error == pytest.approx(0.2) and found.objective_tail == 40.0
    assert found.accuracy == 0.9 and found.velocity_error == 0.05
    lines = score_rows({Category.MOVE_FOOT: sets}, paper=True).splitlines()
    assert [line.split(" | ")[1].strip() for line in lines[2:]] == ["ours, median set", "ours, worst set", "the paper"]
    assert "20.0 %" in lines[3] and "80 %" in lines[3]
    assert len({line.count("|") for line in lines}) == 1


def test_goals_are_asked_of_the_median():
    (accuracy, _, objective, *_) = score_goals({Category.MOVE_FOOT: [GOOD, BAD, SLOW]})
    assert accuracy.result == objective.result == goals.MET
