"""Scores over several sets: median, worst and tails of errors that are put in by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from toolkit.learning.samples import Samples
from validation.score_sets import TAILS, Scores


@pytest.fixture
def network():
    """Stands for a network: the first feature decides the label, the others are the targets."""
    return SimpleNamespace(
        feasible=lambda features: features[:, 0] > 0.0, predict=lambda features, goal: features[:, 1:]
    )


def samples(error: float, com: float, wrong: int) -> Samples:
    """A hundred transitions, all objectives and CoMs off by so much, `wrong` labels as well."""
    features = np.random.default_rng(0).uniform(1.0, 2.0, (100, 8))
    features[50:, 0] *= -1.0
    targets = features[:, 1:].copy()
    targets[:, 0] += error
    targets[:, 1] += com
    labels = features[:, 0] > 0.0
    targets[~labels] = np.nan
    labels[:wrong] = False
    return Samples(features, labels, targets, np.zeros((100, 3)), np.zeros(100, np.int32))


def test_median_and_worst_are_over_the_sets(network):
    scores = Scores.of(network, [samples(*row) for row in ((1.0, 0.01, 0), (2.0, 0.03, 10), (9.0, 0.02, 5))])
    assert scores.median.objective_error == pytest.approx(2.0)
    assert scores.worst.objective_error == pytest.approx(9.0)
    assert scores.median.accuracy == pytest.approx(0.95)
    assert scores.worst.accuracy == pytest.approx(0.9)
    assert scores.median.com_error == pytest.approx(0.02)


def test_tails_rise_and_are_over_all_sets_together(network):
    alone = Scores.of(network, [samples(1.0, 0.01, 0)])
    both = Scores.of(network, [samples(1.0, 0.01, 0), samples(1.0, 0.05, 0)])
    assert alone.com == pytest.approx([0.01] * len(TAILS))
    assert both.com[-1] == pytest.approx(0.05)
    assert both.velocity == pytest.approx([0.0] * len(TAILS), abs=1e-12)
    assert sorted(both.relative) == both.relative
