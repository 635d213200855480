"""A shard: what it holds, and that it depends on nothing but its configuration and its number."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.contacts.category import Category
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.quota import Quota
from toolkit.learning.samples import Samples
from toolkit.learning.sensitivity import sensitivity_size
from toolkit.learning.shard import collect_shard
from toolkit.learning.terrain import random_terrain
from toolkit.prediction.features import CONTACT, feature_size
from toolkit.robot.loader import load_robot
from toolkit.world.loader import load_world


@pytest.fixture(scope="module")
def config():
    return CollectConfig(robot=load_robot(None).name, seed=3, per_shard=30)


@pytest.fixture(scope="module")
def shard(config):
    return collect_shard(config, 4)


def test_a_shard_holds_enough_of_every_category_and_both_labels(shard, config):
    assert list(shard) == list(Category)
    for category, group in shard.items():
        assert len(group) >= config.per_shard
        assert group.features.shape[1] == feature_size(category)
        assert np.isfinite(group.features).all() and np.isfinite(group.targets).all()
        assert 0.15 < (~group.feasible).mean() < 0.6  # aimed at 33 %, of few samples
        assert (group.targets[~group.feasible] == 0).all()
        assert (group.targets[group.feasible, 0] >= 0).all()
        assert (group.targets[:, 0] <= config.objective_limit).all()
        known = ~np.isnan(group.sensitivity).any(1)
        assert not (known & ~group.feasible).any()
        assert known[group.feasible].mean() > 0.6  # unknown where the CoM was out of reach by rounding


def test_features_are_what_was_asked_for(shard, config):
    for category, group in shard.items():
        shift, swing, friction = group.features[:, -3:].T
        is_default = np.isclose(shift, 1) & np.isclose(swing, 1) & np.isclose(friction, 0.5)
        others = ~is_default
        for values, bounds in ((shift, config.shift), (swing, config.swing), (friction, config.friction)):
            assert (values >= bounds[0] - 1e-6).all() and (values <= bounds[1] + 1e-6).all()
        assert len(np.unique(shift[others])) == len(np.unique(swing[others])) == others.sum()
        axes = group.features[:, : CONTACT * len(category.contact_limbs)].reshape(len(group), -1, 3, 3)[:, :, 1:]
        np.testing.assert_allclose(np.linalg.norm(axes, axis=-1), 1.0, rtol=0, atol=1e-5)  # float32
        assert len(np.unique(group.features, axis=0)) == len(group)  # no transition twice


def test_a_shard_is_a_function_of_its_arguments(shard, config):
    again = collect_shard(config, 4)
    other = collect_shard(config, 5)
    another = collect_shard(replace(config, seed=4), 4)
    for category, group in shard.items():
        for name in ("features", "feasible", "targets", "sensitivity"):
            np.testing.assert_array_equal(getattr(again[category], name), getattr(group, name))
        for different in (other, another):
            assert not np.array_equal(different[category].features[:10], group.features[:10])


def test_a_quota_counts():
    quota = Quota(3, [Category.MOVE_FOOT])
    size = feature_size(Category.MOVE_FOOT)
    assert not quota.full and quota.lack(Category.MOVE_FOOT) == 3
    known = np.ones((4, sensitivity_size(Category.MOVE_FOOT)))
    quota.add(Category.MOVE_FOOT, Samples(np.ones((4, size)), np.ones(4, bool), np.ones((4, 7)), known))
    assert quota.full and quota.lack(Category.MOVE_FOOT) == 0
    assert len(quota.samples()[Category.MOVE_FOOT]) == 4  # what was labelled is kept


@pytest.mark.parametrize("walls", [1, 2])
def test_terrain_loads_and_has_what_it_says(walls):
    text = random_terrain(np.random.default_rng(0), walls)
    world = load_world("terrain.xml", mjcf=text)
    assert {surface.geom for surface in world.surfaces if surface.serves_palm} == {
        f"wall_{number}" for number in range(walls)
    }
    tilts = [np.degrees(np.arccos(surface.pose.normal[2])) for surface in world.surfaces if surface.serves_foot]
    assert len(tilts) >= 9 and max(tilts) <= 28.1 and max(tilts) > 5  # roll and pitch of 20 degrees together
