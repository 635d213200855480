"""What a data set is enriched by: canonical, near what it is made of, labelled by the optimiser, reproducible."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from tests.learning.test_sensitivity import labelled as random_samples
from tests.prediction.networks import write_random_networks
from toolkit.contacts.category import Category
from toolkit.errors import DatasetError, NetworkError
from toolkit.learning import enrich as module
from toolkit.learning.dataset import SCHEMA, Manifest, read_datasets, read_shard, shard_path, write_shard
from toolkit.learning.enrich import COMBINED, VARIED, EnrichConfig, chosen, combined, enrich, labelled, varied
from toolkit.learning.label import label
from toolkit.learning.samples import AT_DEFAULT
from toolkit.learning.sensitivity import decode
from toolkit.prediction.features import MIRROR, encode, feature_size
from toolkit.robot.loader import load_robot

LENDER, CATEGORY = Category.MOVE_FOOT, Category.BREAK_ONLY_PALM
STILL = replace(COMBINED, foot=(0.0, 0.0), palm=(0.0, 0.0), com=0.0, velocity=0.0, exchange=0.0)


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.fixture(scope="module")
def stored(robot):
    return random_samples(robot, Category.ADD_PALM, 40)


@pytest.fixture(scope="module")
def shard(robot):
    return {category: random_samples(robot, category, 30) for category in (LENDER, CATEGORY)}


@pytest.fixture
def config(robot):
    return EnrichConfig(robot.name, str(robot.folder.parent), seed=3, categories=(int(Category.ADD_PALM),), draws=30)


def test_variations_are_feasible_neighbours_and_mostly_costly(robot, stored, monkeypatch):
    features = varied(Category.ADD_PALM, stored, 30, np.random.default_rng(0))
    found = labelled(robot, Category.ADD_PALM, features)
    assert 5 < len(found) <= 30
    assert found.feasible.all() and (found.targets[:, 0] > 0).all() and (found.targets[:, 0] <= module.LIMIT).all()
    np.testing.assert_allclose(found.features[:, -3:], np.tile(AT_DEFAULT, (len(found), 1)), rtol=0, atol=1e-6)
    base = stored.features[stored.feasible]
    velocity = np.linalg.norm(found.features[:, None, -6:-3] - base[None, :, -6:-3], axis=2).min(1)
    assert (velocity < 5 * VARIED.velocity).all()
    assert np.median(found.targets[:, 0]) > np.median(stored.targets[stored.feasible, 0])
    # Labels are what the optimiser says of the stored features.
    for row in range(len(found)):
        stance, com, speed, transition = decode(found.features[row], Category.ADD_PALM)
        again = label(robot, stance, com[None], speed[None], [transition])
        assert again.feasible[0]
        np.testing.assert_allclose(again.objective[0], found.targets[row, 0], rtol=0.01, atol=0.01)  # single precision
    monkeypatch.setattr(module, "LIMIT", 1.0)
    assert len(labelled(robot, Category.ADD_PALM, features)) < len(found)


def test_only_the_default_timing_and_what_is_feasible_is_varied(stored):
    other_times = replace(stored, features=stored.features.copy())
    other_times.features[:, -3] = 0.5
    infeasible = replace(stored, feasible=np.zeros(len(stored), bool))
    for samples in (other_times, infeasible):
        found = varied(Category.ADD_PALM, samples, 5, np.random.default_rng(0))
        assert found.shape == (0, feature_size(Category.ADD_PALM))


def test_a_variation_keeps_a_stored_transition_but_for_its_new_contact(stored):
    base = stored.features[stored.feasible]
    for exchange, low, high in ((0.0, 1.0, 1.0), (0.5, 0.3, 0.75)):
        found = varied(Category.ADD_PALM, stored, 200, np.random.default_rng(0), replace(STILL, exchange=exchange))
        nearest = np.abs(found[:, None, :18] - base[:, :18]).max(2)
        assert (nearest.min(1) < 1e-5).all()  # the feet, in single precision
        own = np.abs(found[:, 18:27] - base[nearest.argmin(1), 18:27]).max(1) < 1e-5
        assert low <= own.mean() <= high


@pytest.mark.parametrize("category", [LENDER, CATEGORY])
@pytest.mark.parametrize("make", [varied, combined])
def test_features_are_those_of_a_canonical_transition(shard, category, make):
    source = shard[category] if make is varied else shard
    found = make(category, source, 20, np.random.default_rng(0))
    assert found.shape == (20, feature_size(category))
    for row in found:
        stance, com, velocity, transition = decode(row, category)
        _, again = encode(stance, com, velocity, [transition])
        np.testing.assert_allclose(again[0], row, rtol=0, atol=1e-6)  # data sets are in single precision
    np.testing.assert_allclose(found[:, -3:], np.tile(AT_DEFAULT, (20, 1)))


def test_parts_come_from_what_is_feasible_and_half_of_them_mirrored(shard):
    found = combined(CATEGORY, shard, 200, np.random.default_rng(1), STILL)
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
    wide = replace(STILL, palm=(0.05, 0.0))
    still, moved = (combined(CATEGORY, shard, 400, np.random.default_rng(2), how) for how in (STILL, wide))
    np.testing.assert_allclose(still[:, :18], moved[:, :18], rtol=0, atol=1e-12)
    assert (moved - still)[:, 18:21].std() == pytest.approx(0.05, rel=0.1)  # of 1,200 numbers: 2 % at one sigma


def test_a_shard_without_the_category_gives_nothing(shard):
    rng = np.random.default_rng(0)
    assert combined(CATEGORY, {LENDER: shard[LENDER]}, 5, rng).shape == (0, feature_size(CATEGORY))
    infeasible = replace(shard[CATEGORY], feasible=np.zeros(len(shard[CATEGORY]), bool))
    assert len(combined(CATEGORY, shard | {CATEGORY: infeasible}, 5, rng)) == 0


class SpeedIsCostly:
    """Calls a transition feasible where the CoM moves to the left, and costly where it is fast."""

    def feasible(self, features):
        return features[:, -5] > 0.0

    def predict(self, features):
        return 1e3 * np.linalg.norm(features[:, -6:-3], axis=1, keepdims=True) ** 4


def test_a_network_chooses_what_is_feasible_and_costly(stored, monkeypatch):
    candidates = combined(Category.ADD_PALM, {Category.ADD_PALM: stored}, 360, np.random.default_rng(0))
    found = chosen(candidates, SpeedIsCostly(), 30, np.random.default_rng(0))
    assert len(found) == 30 == len(np.unique(found, axis=0)) and (found[:, -5] > 0.0).all()
    monkeypatch.setattr(module, "COSTLY", 0.0)
    even = chosen(candidates, SpeedIsCostly(), 30, np.random.default_rng(0))
    speed, even_speed = (np.linalg.norm(rows[:, -6:-3], axis=1) for rows in (found, even))
    assert np.median(speed) > 1.2 * np.median(even_speed)
    monkeypatch.setattr(module, "LIMIT", 2.0)
    limited = chosen(candidates, SpeedIsCostly(), 30, np.random.default_rng(0))
    assert (SpeedIsCostly().predict(limited) <= 2.0).all()
    assert len(chosen(candidates[:0], SpeedIsCostly(), 30, np.random.default_rng(0))) == 0


def begun(folder, robot, stored, indices):
    """A data set whose shards hold the same samples."""
    folder.mkdir()
    Manifest(SCHEMA, robot.name, robot.fingerprint, 0, {}, {}).write(folder)
    for index in indices:
        write_shard(folder, index, {Category.ADD_PALM: stored})
    return folder


def test_a_data_set_is_enriched_shard_by_shard(tmp_path, robot, stored, config):
    source, rich = begun(tmp_path / "source", robot, stored, ()), tmp_path / "rich"
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(DatasetError, match="holds no shards"):
            enrich(source, rich, robot, config, pool)
        for index in (0, 4):
            write_shard(source, index, {Category.ADD_PALM: stored})
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
    counts = [len(read_shard(shard_path(rich, index))[Category.ADD_PALM]) for index in (0, 4)]
    assert sum(counts) == added
    # Read together, the variations stand by the shard that they vary.
    both = read_datasets([source, rich], robot.fingerprint)[Category.ADD_PALM]
    assert len(both) == 2 * len(stored) + added
    second = both.features[len(stored) + counts[0] :][: len(stored)]
    assert np.array_equal(second, stored.features) or np.array_equal(both.features[-len(stored) :], stored.features)


def test_a_data_set_is_enriched_by_what_networks_choose(tmp_path, robot, stored, config):
    source, rich, networks = begun(tmp_path / "source", robot, stored, (0,)), tmp_path / "rich", tmp_path / "networks"
    choosing = replace(config, networks=str(networks))
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(NetworkError, match="no such network"):
            enrich(source, rich, robot, choosing, pool)
        write_random_networks(networks, robot.fingerprint)
        added = enrich(source, rich, robot, choosing, pool)
        assert enrich(source, rich, robot, choosing, pool) == 0
        with pytest.raises(DatasetError, match="begun with other settings"):
            enrich(source, rich, robot, config, pool)
    assert 0 < added == len(read_shard(shard_path(rich, 0))[Category.ADD_PALM])
