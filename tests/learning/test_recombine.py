"""Transitions put together from parts: canonical, near what they come from, a function of the seed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.learning.test_sensitivity import labelled
from toolkit.contacts.category import Category
from toolkit.learning.evaluate import AT_DEFAULT
from toolkit.learning.recombine import RecombineConfig, recombined
from toolkit.learning.sensitivity import decode
from toolkit.prediction.features import MIRROR, encode, feature_size
from toolkit.robot.loader import load_robot

STILL = RecombineConfig(foot=(0.0, 0.0), palm=(0.0, 0.0), com=0.0, velocity=0.0, exchange=0.0)
LENDER, CATEGORY = Category.MOVE_FOOT, Category.BREAK_ONLY_PALM


@pytest.fixture(scope="module")
def shard():
    robot = load_robot(None)
    return {category: labelled(robot, category, 30)[0] for category in (LENDER, CATEGORY)}


@pytest.mark.parametrize("category", [LENDER, CATEGORY])
def test_features_are_those_of_a_canonical_transition(shard, category):
    found = recombined(shard, category, 20, RecombineConfig(), np.random.default_rng(0))
    assert found.shape == (20, feature_size(category))
    for row in found:
        stance, com, velocity, transition = decode(row, category)
        _, again = encode(stance, com, velocity, [transition])
        np.testing.assert_allclose(again[0], row, rtol=0, atol=1e-6)  # data sets are in single precision
    np.testing.assert_allclose(found[:, -3:], np.tile(AT_DEFAULT, (20, 1)))


def test_parts_come_from_what_is_feasible_and_half_of_them_mirrored(shard):
    found = recombined(shard, CATEGORY, 200, STILL, np.random.default_rng(1))
    good = {category: group.features[group.feasible] for category, group in shard.items()}
    velocities = np.concatenate([rows[:, -6:-3] for rows in good.values()])
    straight = np.abs(found[:, None, -6:-3] - velocities).max(2).min(1) < 1e-5
    mirrored = np.abs(found[:, None, -6:-3] - velocities * MIRROR).max(2).min(1) < 1e-5
    assert (straight | mirrored).all()
    assert 0.3 < (straight & ~mirrored).mean() < 0.7
    # Feet go with their state; palms are those of the category.
    palms = good[CATEGORY][:, 18:21]
    assert (np.abs(found[:, None, 18:21] - palms).max(2).min(1) < 1e-5).all()
    feet = np.concatenate([rows[:, :3] for rows in good.values()])
    feet = np.concatenate([feet, np.concatenate([rows[:, 9:12] for rows in good.values()]) * MIRROR])
    assert (np.abs(found[:, None, :3] - feet).max(2).min(1) < 1e-5).all()


def test_displacements_are_as_wide_as_asked_for(shard):
    config = replace(STILL, palm=(0.05, 0.0))
    still, moved = (recombined(shard, CATEGORY, 400, it, np.random.default_rng(2)) for it in (STILL, config))
    np.testing.assert_allclose(still[:, :18], moved[:, :18], rtol=0, atol=1e-12)
    assert (moved - still)[:, 18:21].std() == pytest.approx(0.05, rel=0.1)  # of 1,200 numbers: 2 % at one sigma


def test_a_shard_without_the_category_gives_nothing(shard):
    rng = np.random.default_rng(0)
    assert recombined({LENDER: shard[LENDER]}, CATEGORY, 5, STILL, rng).shape == (0, feature_size(CATEGORY))
    infeasible = replace(shard[CATEGORY], feasible=np.zeros(len(shard[CATEGORY]), bool))
    assert len(recombined(shard | {CATEGORY: infeasible}, CATEGORY, 5, STILL, rng)) == 0
