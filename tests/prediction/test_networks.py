"""Networks hand on what they were not trained for, and count it in their answer."""

from dataclasses import replace

import numpy as np
import pytest

from tests.prediction.networks import write_random_networks
from tests.prediction.test_features import random_case
from toolkit.contacts.category import Category
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.prediction.features import TIMING_AND_FRICTION
from toolkit.prediction.network import load_network, network_path
from toolkit.prediction.networks import NetworkEvaluator
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

CATEGORY = Category.MOVE_FOOT
GOAL = Goal(np.array([2.0, 1.0, 0.0]), 0.2)


class Seven(TransitionEvaluator):
    """Finds everything feasible at an objective of 7."""

    def evaluate(self, stance, com, com_velocity, transitions):
        n = len(transitions)
        return TransitionBatch(np.ones(n, bool), np.full(n, 7.0), np.zeros((n, 3)), np.zeros((n, 3)))


@pytest.fixture
def networks(tmp_path):
    write_random_networks(tmp_path / "networks", "abc")
    network = load_network(network_path(tmp_path / "networks", CATEGORY), CATEGORY, "abc")
    network.lower[TIMING_AND_FRICTION] = 0.2
    return {CATEGORY: network}


def on_level_ground(rng):
    """A random case whose contacts rest."""
    stance, *state, transition = random_case(CATEGORY, rng)
    level = (replace(item, pose=Pose.from_yaw(item.pose.position, 0.0)) for item in stance.contacts)
    return replace(stance, contacts=tuple(level)), *state, transition


def test_what_was_not_trained_is_judged_all_the_same_and_counted(networks):
    stance, com, velocity, transition = random_case(CATEGORY, np.random.default_rng(0))
    known, strange = (replace(transition, timing=Timing(0.5, swing)) for swing in (0.5, 1e-3))
    judge = NetworkEvaluator(networks, GOAL)
    batch = judge.evaluate(stance, com, velocity, [known, strange, strange])
    assert batch.untrained == 2 and batch.feasible[1] == batch.feasible[2]
    assert np.isfinite(batch.objective).all() and batch.objective[1] == batch.objective[2]
    assert judge.evaluate(stance, com, velocity, [known]).untrained == 0


def test_more_time_and_friction_than_trained_are_judged_as_the_most_of_the_training(networks):
    stance, com, velocity, transition = on_level_ground(np.random.default_rng(0))
    shift, swing, friction = networks[CATEGORY].upper[TIMING_AND_FRICTION].tolist()

    def case(factor):
        feet = tuple(replace(item, friction=factor * friction) for item in stance.contacts)
        contact = replace(transition.contact, friction=factor * friction)
        new = replace(transition, timing=Timing(factor * shift, factor * swing), contact=contact)
        return NetworkEvaluator(networks, GOAL).evaluate(replace(stance, contacts=feet), com, velocity, [new])

    most, more = case(1.0), case(3.0)
    assert most.untrained == more.untrained == 0
    for field in ("feasible", "objective", "com", "com_velocity"):
        np.testing.assert_array_equal(getattr(most, field), getattr(more, field))


def test_a_limb_that_lifts_off_at_once_costs_more_than_is_predicted(networks):
    networks[CATEGORY].lower[TIMING_AND_FRICTION] = 0.0
    stance, com, velocity, transition = on_level_ground(np.random.default_rng(0))
    both = [replace(transition, timing=Timing(*times)) for times in ((0.05, 0.3), (0.35, 0.6))]
    plain, judge = NetworkEvaluator(networks, GOAL, hasty=1.0), NetworkEvaluator(networks, GOAL)
    predicted, judged = (item.evaluate(stance, com, velocity, both) for item in (plain, judge))
    assert predicted.feasible.all() and (predicted.objective > 0.0).all()
    np.testing.assert_allclose(judged.objective, predicted.objective * [judge.hasty, 1.0])
    np.testing.assert_array_equal(judged.com_velocity, predicted.com_velocity)


def test_where_nothing_rests_nothing_is_understated_and_friction_bounds_the_motion(networks):
    networks[CATEGORY].lower[TIMING_AND_FRICTION] = 0.0
    stance, com, velocity, transition = on_level_ground(np.random.default_rng(0))
    tilt = rotation_on_surface(np.array([0.6, 0.0, 0.8]), 0.0)
    steep = (replace(item, pose=Pose(tilt, item.pose.position), friction=0.3) for item in stance.contacts)
    steep, quick = replace(stance, contacts=tuple(steep)), replace(transition, timing=Timing(0.05, 0.3))
    plain, judge = NetworkEvaluator(networks, GOAL, hasty=1.0), NetworkEvaluator(networks, GOAL)
    predicted, judged = (item.evaluate(steep, com, velocity, [quick]) for item in (plain, judge))
    assert judged.feasible.all()
    np.testing.assert_array_equal(judged.objective, predicted.objective)
    downhill = (judged.com_velocity[0] - velocity) @ [0.8, 0.0, -0.6]
    assert downhill >= 0.35 * 9.81 * (0.6 - 0.3 * 0.8) - 1e-6


def test_a_judge_says_of_itself_what_a_search_has_to_know(networks):
    stance, com, velocity, transition = random_case(CATEGORY, np.random.default_rng(1))
    plain = Seven()
    assert (plain.costly, plain.rejection) == (False, "dynamics")
    assert plain.evaluate(stance, com, velocity, [transition]).untrained == 0
    with pytest.raises(TypeError, match="abstract"):
        TransitionEvaluator()
