"""Bulk labels are those of the optimiser's evaluator."""

import numpy as np
import pytest

from toolkit.contacts.category import Category
from toolkit.learning.label import label
from toolkit.prediction.optimiser import OptimiserEvaluator
from toolkit.robot.loader import load_robot
from validation.random_contacts import SamplingConfig, sample_transition


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.mark.parametrize("category", list(Category))
def test_labels_are_the_optimisers(robot, category):
    rng = np.random.default_rng(int(category))
    judge, both = OptimiserEvaluator(robot), set()
    for _ in range(6):
        sample = sample_transition(robot, category, rng, SamplingConfig(speed_spread=0.8))
        com = sample.com + 0.05 * rng.normal(size=(2, 3))
        velocity = sample.com_velocity + 0.1 * rng.normal(size=(2, 3))
        batch = label(robot, sample.stance, com, velocity, [sample.transition] * 2)
        for row in range(2):
            one = judge.evaluate(sample.stance, com[row], velocity[row], [sample.transition])
            both.add(bool(one.feasible[0]))
            assert one.feasible[0] == batch.feasible[row]
            if one.feasible[0]:
                # the objective is summed in another order
                np.testing.assert_allclose(batch.objective[row], one.objective[0], rtol=1e-9)
                np.testing.assert_array_equal(batch.com[row], one.com[0])
                np.testing.assert_array_equal(batch.com_velocity[row], one.com_velocity[0])
            else:
                assert batch.objective[row] == np.inf
    assert both  # both labels occur over all categories; see the shard's test
