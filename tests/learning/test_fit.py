"""Training: networks learn what can be learnt, files hold what was trained, and bad data are refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.descent import FitConfig, draw
from toolkit.learning.fit import fit_category, train_networks
from toolkit.learning.samples import Samples
from toolkit.prediction.features import AHEAD, COM, ahead, feature_size
from toolkit.prediction.network import load_network, network_path, training_summary

CATEGORY = Category.MOVE_FOOT
CONFIG = FitConfig(epochs=12, batch=64, seed=1)
HERE = np.zeros(AHEAD)


def samples(n=2500, seed=0):
    """Transitions of a made-up robot: feasible on one side of a plane, simple outcomes; columns of odd scales."""
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(n, feature_size(CATEGORY))) * np.geomspace(0.01, 10, feature_size(CATEGORY))
    unit = features / np.geomspace(0.01, 10, feature_size(CATEGORY))
    feasible = unit[:, 0] + 0.5 * unit[:, 5] < 0.4
    targets = np.zeros((n, 7))
    targets[:, 0] = 10 * (1 + unit[:, 1]) ** 2
    targets[:, 1:4] = features[:, COM] + 0.05 * unit[:, 2:5]
    targets[:, 4:7] = 0.1 * unit[:, 3:6]
    targets[~feasible] = np.nan
    goal, number = rng.normal(size=(n, 3)).astype(np.float32), np.arange(n, dtype=np.int32)
    world = np.where(number % 20 == 0, 8, number % 8).astype(np.int32)  # one in twenty for validation
    return Samples(features.astype(np.float32), feasible, targets.astype(np.float32), goal, world)


@pytest.fixture(scope="module")
def trained():
    return train_networks(samples(), CONFIG)


def test_networks_learn(trained):
    fresh = samples(500, seed=9)
    good = fresh.feasible
    assert (trained.feasible(fresh.features) == good).mean() > 0.95
    outputs, targets = trained.predict(fresh.features[good], HERE), fresh.targets[good]
    for columns in ([0], [1, 2, 3], [4, 5, 6]):
        spread = np.abs(targets[:, columns] - targets[:, columns].mean(0)).mean()
        assert np.abs(outputs[:, columns] - targets[:, columns]).mean() < 0.25 * spread
    for curve in trained.curves.values():
        assert curve.training[-1] < 0.5 * curve.training[0]
        assert curve.validation[curve.best] == curve.validation.min()


def test_where_the_goal_lies_is_learnt():
    def towards(rows):
        rows.targets[:, 4:6] = 0.3 * ahead(rows.goal)
        return replace(rows, targets=np.where(rows.feasible[:, None], rows.targets, np.nan))

    trained, fresh = train_networks(towards(samples()), CONFIG), towards(samples(500, seed=9))
    good = fresh.feasible
    error = trained.predict(fresh.features[good], ahead(fresh.goal[good]))[:, 4:6] - fresh.targets[good, 4:6]
    assert np.abs(error).mean() < 0.25 * np.abs(fresh.targets[good, 4:6]).mean()


def test_the_same_seed_gives_the_same_networks():
    one, again, other = (train_networks(samples(600), replace(CONFIG, epochs=4, seed=seed)) for seed in (1, 1, 2))
    features = samples(50, seed=3).features
    np.testing.assert_array_equal(again.predict(features, HERE), one.predict(features, HERE))
    np.testing.assert_array_equal(again.feasible(features), one.feasible(features))
    assert not np.array_equal(other.predict(features, HERE), one.predict(features, HERE))


def test_a_file_holds_what_was_trained(tmp_path, trained):
    seen = []
    curves = fit_category(
        CATEGORY,
        samples(),
        fingerprint="abc",
        folder=tmp_path,
        config=CONFIG,
        progress=lambda *state: seen.append(state),
    )
    assert {state[0] for state in seen} == {"classifier", "regressor"} == set(curves)
    network = load_network(network_path(tmp_path, CATEGORY), CATEGORY, "abc")
    features = samples(50, seed=3).features
    found, wanted = network.predict(features, HERE), trained.predict(features, HERE)  # files hold half precision
    np.testing.assert_allclose(found, wanted, rtol=0.02, atol=0.002)
    assert (network.feasible(features) == trained.feasible(features)).mean() >= 0.98
    np.testing.assert_array_equal(network.upper, samples().features.max(0))
    assert training_summary(network)["samples"] == 2500
    assert network_path(tmp_path, CATEGORY).stat().st_size < 0.6e6  # ten of them in 6 MB


def test_only_known_outcomes_are_learnt():
    """Feasible transitions without an outcome teach the classifier alone."""
    few = samples(600)
    hidden = few.feasible & (np.arange(600) % 3 == 0)
    without = replace(few, targets=np.where(hidden[:, None], np.nan, few.targets))
    trained, fresh = train_networks(without, replace(CONFIG, epochs=20)), samples(500, seed=9)
    assert (trained.feasible(fresh.features) == fresh.feasible).mean() > 0.85
    assert np.isfinite(trained.predict(fresh.features, HERE)).all()


def test_the_test_split_is_not_looked_at():
    rows = samples(600)
    tested = np.arange(600) % 5 == 0
    rows = replace(rows, world=np.where(tested, 9, rows.world).astype(np.int32))
    spoilt = replace(rows, features=np.where(tested[:, None], 1e6, rows.features).astype(np.float32))
    fresh = samples(50, seed=3).features
    one, other = (train_networks(each, replace(CONFIG, epochs=3)) for each in (rows, spoilt))
    np.testing.assert_array_equal(one.predict(fresh, HERE), other.predict(fresh, HERE))
    np.testing.assert_array_equal(one.feasible(fresh), other.feasible(fresh))


def test_what_matters_less_takes_part_less_often():
    share = torch.where(torch.arange(600) < 300, 1.0, 1.0 / 3.0).double()
    generator, counts = torch.Generator().manual_seed(0), np.zeros(600)
    for _ in range(300):
        drawn = draw(share, generator)
        assert len(drawn) in (399, 400, 401)
        counts[drawn.numpy()] += 1
    assert (counts[:300] == 300).all()
    # Binomial with a deviation of 8.2; 600 draws stay within 5 of them.
    assert abs(counts[300:].mean() - 100) < 1 and np.abs(counts[300:] - 100).max() < 41


def test_too_few_of_a_label_are_refused(tmp_path):
    few = samples()
    few.feasible[:] = True
    few.feasible[:7] = False
    few.targets[:] = np.where(few.feasible[:, None], 1.0, np.nan)
    with pytest.raises(DatasetError, match="7 infeasible ones; 50 of each are needed"):
        fit_category(CATEGORY, few, fingerprint="abc", folder=tmp_path, config=CONFIG)


def test_training_stops_early_without_progress():
    rng = np.random.default_rng(0)
    noise = samples(600)
    noise.feasible[:] = rng.random(600) < 0.5
    noise.targets[:] = np.where(noise.feasible[:, None], rng.random((600, 7)), np.nan)
    curves = train_networks(noise, FitConfig(epochs=60, batch=64, patience=3, classifier_share=0.5)).curves
    assert len(curves["classifier"].training) < 60
    assert curves["classifier"].best == len(curves["classifier"].training) - 4
