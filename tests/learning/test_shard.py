"""A shard: what it holds, and that it depends on nothing but its configuration and its number."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.contacts.category import Category
from toolkit.learning import shard as shard_module
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.quota import Quota
from toolkit.learning.samples import PARTS, Samples
from toolkit.learning.shard import WORLDS, collect_shard
from toolkit.learning.terrain import tiles_and_walls
from toolkit.prediction.features import CONTACT, TIMING, feature_size
from toolkit.robot.loader import load_robot
from toolkit.world.loader import load_world
from toolkit.world.timing import own_timings


@pytest.fixture(scope="module")
def config():
    return CollectConfig(
        robot=load_robot(None).name, seed=7, per_shard=1, most_worlds=30, expansions=(60, 120), kept=1, variants=4
    )


@pytest.fixture(scope="module")
def shard(config):
    return collect_shard(config, 4)


def test_a_shard_holds_labels_of_every_category_and_both_judgements(shard, config):
    assert list(shard) == list(Category)
    for category, group in shard.items():
        assert group.known.sum() >= config.per_shard
        assert group.features.shape[1] == feature_size(category)
        assert np.isfinite(group.features).all() and np.isfinite(group.targets[group.known]).all()
        assert group.feasible[group.known].all() and (group.targets[group.known, 0] > 0).all()
        assert ((group.world >= 4 * WORLDS) & (group.world < 4 * WORLDS + config.most_worlds)).all()
    every = np.concatenate([group.feasible for group in shard.values()])
    assert 0.1 < (~every).mean() < 0.5  # 33 % are wanted
    assert sum((group.feasible & ~group.known).sum() for group in shard.values()) > 0


def test_features_are_what_was_asked_for(shard, config):
    pace = load_robot(config.robot).pace
    for category, group in shard.items():
        shift, swing, friction = group.features[:, -3:].T
        low, high = np.minimum(config.shift, config.quick_shift)[0], np.maximum(config.shift, config.quick_shift)[1]
        shifts, swings = (pace * low, high), (pace * config.swing[0], config.swing[1])  # the paper's times do not scale
        for values, bounds in ((shift, shifts), (swing, swings), (friction, config.friction)):
            assert (values >= bounds[0] - 1e-6).all() and (values <= bounds[1] + 1e-6).all()
        axes = group.features[:, : CONTACT * len(category.contact_limbs)].reshape(len(group), -1, 3, 3)[:, :, 1:]
        np.testing.assert_allclose(np.linalg.norm(axes, axis=-1), 1.0, rtol=0, atol=1e-5)  # float32


def test_a_shard_is_a_function_of_its_arguments(shard, config):
    again = collect_shard(config, 4)
    few = replace(config, most_worlds=1)
    others = collect_shard(few, 5), collect_shard(replace(few, seed=8), 4)
    for category, group in shard.items():
        for part in PARTS:
            np.testing.assert_array_equal(getattr(again[category], part), getattr(group, part))
        for different in others:
            assert not np.array_equal(different[category].features, group.features)


def test_searches_choose_timings_as_planners_do(config):
    alone = replace(config, paper_share=0.0, planned_share=0.0, own_share=1.0, most_worlds=1)
    times = collect_shard(alone, 2)[Category.MOVE_FOOT].features[:, TIMING].astype(float)
    own = np.array([(each.shift, each.swing) for each in own_timings(load_robot(config.robot).pace)])
    assert len(times) and (np.abs(times[:, None] - own).max(2).min(1) < 1e-6).all()


def some(count, known):
    size = feature_size(Category.MOVE_FOOT)
    targets = np.where(np.arange(count)[:, None] < known, np.ones((count, 7)), np.nan)
    return Samples(np.ones((count, size)), np.arange(count) < 3, targets, np.ones((count, 3)), np.zeros(count, int))


def test_a_quota_counts_labels():
    quota = Quota(3, [Category.MOVE_FOOT])
    assert quota.lacking == [Category.MOVE_FOOT] and quota.lack(Category.MOVE_FOOT) == 3
    assert quota.lack(Category.ADD_PALM) == 0 and quota.infeasible_share(Category.MOVE_FOOT) == 0.0
    quota.add(Category.MOVE_FOOT, some(4, 2))
    assert quota.lack(Category.MOVE_FOOT) == 1 and quota.infeasible_share(Category.MOVE_FOOT) == 0.25
    quota.add(Category.MOVE_FOOT, some(4, 2))
    assert not quota.lacking
    assert len(quota.samples()[Category.MOVE_FOOT]) == 8  # what was labelled is kept


@pytest.mark.parametrize("walls", [1, 2])
def test_terrain_loads_and_has_what_it_says(walls):
    text = tiles_and_walls(np.random.default_rng(0), walls)
    world = load_world("terrain.xml", mjcf=text)
    assert {surface.geom for surface in world.surfaces if surface.serves_palm} == {
        f"wall_{number}" for number in range(walls)
    }
    tilts = [np.degrees(np.arccos(surface.pose.normal[2])) for surface in world.surfaces if surface.serves_foot]
    assert len(tilts) >= 9 and max(tilts) <= 28.1 and max(tilts) > 5  # roll and pitch of 20 degrees together


def test_a_shard_ends_where_worlds_give_no_more(monkeypatch, config):
    seen = []
    monkeypatch.setattr(shard_module, "draw_sequences", lambda *parts: seen.append(parts) or [])
    samples = shard_module.collect_shard(replace(config, most_idle=3), 0)
    assert len(seen) == 3 and not any(len(each) for each in samples.values())
