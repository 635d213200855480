"""Variations of transitions: near what they vary, labelled by the optimiser, a function of seed and shard."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from tests.learning.test_sensitivity import labelled
from tests.prediction.networks import write_random_networks
from toolkit.contacts.category import Category
from toolkit.errors import DatasetError, NetworkError
from toolkit.learning.dataset import Manifest, read_datasets, read_shard, shard_path, write_shard
from toolkit.learning.differentiate import sensitivities
from toolkit.learning.enrich import EnrichConfig, combinations, enrich, variations
from toolkit.learning.evaluate import AT_DEFAULT
from toolkit.robot.loader import load_robot

CATEGORY = Category.ADD_PALM


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.fixture(scope="module")
def stored(robot):
    return labelled(robot, CATEGORY, 40)[0]


@pytest.fixture
def config(robot):
    return EnrichConfig(robot.name, str(robot.folder.parent), seed=3, categories=(int(CATEGORY),), draws=30)


def test_variations_are_feasible_neighbours_and_mostly_costly(robot, stored, config):
    found = variations(robot, CATEGORY, stored, config, np.random.default_rng(0))
    assert 5 < len(found) <= 30
    assert found.feasible.all() and (found.targets[:, 0] > 0).all() and (found.targets[:, 0] <= config.limit).all()
    np.testing.assert_allclose(found.features[:, -3:], np.tile(AT_DEFAULT, (len(found), 1)), rtol=0, atol=1e-6)
    base = stored.features[stored.feasible]
    velocity = np.linalg.norm(found.features[:, None, -6:-3] - base[None, :, -6:-3], axis=2).min(1)
    assert (velocity < 5 * config.velocity).all()
    assert np.median(found.targets[:, 0]) > np.median(stored.targets[stored.feasible, 0])
    # Labels and derivatives are what the optimiser says of the stored features.
    again = sensitivities(robot, CATEGORY, found)
    known = ~np.isnan(found.sensitivity[:, 0])
    error = np.linalg.norm(again - found.sensitivity, axis=1)[known]
    assert np.median(error / np.linalg.norm(found.sensitivity[known], axis=1)) < 2e-3
    limited = variations(robot, CATEGORY, stored, replace(config, limit=1.0), np.random.default_rng(0))
    assert len(limited) < len(found)
    other_times = replace(stored, features=stored.features.copy())
    other_times.features[:, -3] = 0.5
    assert len(variations(robot, CATEGORY, other_times, config, np.random.default_rng(0))) == 0


def test_a_data_set_is_enriched_shard_by_shard(tmp_path, robot, stored, config):
    source, rich = tmp_path / "source", tmp_path / "rich"
    source.mkdir()
    Manifest("transition-data-2", robot.name, robot.fingerprint, 0, {}, {}).write(source)
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(DatasetError, match="holds no shards"):
            enrich(source, rich, robot, config, pool)
        for index in (0, 4):
            write_shard(source, index, {CATEGORY: stored})
        added = enrich(source, rich, robot, config, pool)
        before = shard_path(rich, 0).read_bytes()
        shard_path(rich, 4).unlink()
        assert 0 < enrich(source, rich, robot, config, pool) < added
        assert shard_path(rich, 0).read_bytes() == before
        with pytest.raises(DatasetError, match="begun with other settings"):
            enrich(source, rich, robot, replace(config, seed=4), pool)
        with pytest.raises(DatasetError, match="not a data set"):
            enrich(source, source.parent, robot, config, pool)
        with pytest.raises(DatasetError, match="collected for another robot"):
            enrich(source, rich, replace(robot, fingerprint="other"), config, pool)
    counts = [len(read_shard(shard_path(rich, index))[CATEGORY]) for index in (0, 4)]
    assert sum(counts) == added
    # Read together, the variations stand by the shard that they vary.
    both = read_datasets([source, rich], robot.fingerprint)[CATEGORY]
    assert len(both) == 2 * len(stored) + added
    second = both.features[len(stored) + counts[0] :][: len(stored)]
    assert np.array_equal(second, stored.features) or np.array_equal(both.features[-len(stored) :], stored.features)


class SpeedIsCostly:
    """Calls a transition feasible where the CoM moves to the left, and costly where it is fast."""

    def feasible(self, features):
        return features[:, -5] > 0.0

    def predict(self, features):
        return 1e3 * np.linalg.norm(features[:, -6:-3], axis=1, keepdims=True) ** 4


def test_a_network_chooses_among_what_is_put_together(robot, stored, config):
    shard = {CATEGORY: stored}
    found, even = (
        combinations(robot, CATEGORY, shard, SpeedIsCostly(), replace(config, power=power), np.random.default_rng(0))
        for power in (0.7, 0.0)
    )
    assert 3 < len(found) <= config.draws
    assert found.feasible.all() and (found.targets[:, 0] <= config.limit).all()
    assert (found.features[:, -5] > 0.0).all()
    speed, even_speed = (np.linalg.norm(one.features[:, -6:-3], axis=1) for one in (found, even))
    assert np.median(speed) > 1.2 * np.median(even_speed)
    limited = replace(config, limit=2.0)
    assert (
        combinations(robot, CATEGORY, shard, SpeedIsCostly(), limited, np.random.default_rng(0)).targets < 2.0
    ).all()
    nothing = combinations(robot, Category.MOVE_FOOT, shard, SpeedIsCostly(), config, np.random.default_rng(0))
    assert len(nothing) == 0


def test_a_data_set_is_enriched_by_what_networks_choose(tmp_path, robot, stored, config):
    source, rich, networks = tmp_path / "source", tmp_path / "rich", tmp_path / "networks"
    source.mkdir()
    Manifest("transition-data-2", robot.name, robot.fingerprint, 0, {}, {}).write(source)
    write_shard(source, 0, {CATEGORY: stored})
    chosen = replace(config, networks=str(networks))
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(NetworkError, match="no such network"):
            enrich(source, rich, robot, chosen, pool)
        write_random_networks(networks, robot.fingerprint)
        added = enrich(source, rich, robot, chosen, pool)
        assert enrich(source, rich, robot, chosen, pool) == 0
        with pytest.raises(DatasetError, match="begun with other settings"):
            enrich(source, rich, robot, config, pool)
    assert 0 < added == len(read_shard(shard_path(rich, 0))[CATEGORY])
