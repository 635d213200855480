"""Network files and data sets: what is written comes back, and every broken file is refused in one clear line."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save_file

from tests.prediction.networks import metadata, random_tensors
from toolkit.contacts.category import Category
from toolkit.errors import DatasetError, NetworkError
from toolkit.learning.dataset import (
    SCHEMA,
    Manifest,
    read_dataset,
    read_manifest,
    read_shard,
    shard_path,
    write_shard,
)
from toolkit.learning.evaluate import balanced, score
from toolkit.learning.samples import PARTS, Samples, Split
from toolkit.prediction.features import feature_size
from toolkit.prediction.network import (
    OBJECTIVE_SCALE,
    Perceptron,
    load_network,
    network_path,
    restored,
    stored,
    training_summary,
)
from toolkit.prediction.networks import NetworkEvaluator
from toolkit.world.world import Goal

CATEGORY = Category.BREAK_ONLY_PALM


METADATA = metadata(CATEGORY, "abc")


@pytest.fixture
def saved(tmp_path):
    path = network_path(tmp_path, CATEGORY)
    values = random_tensors(np.random.default_rng(0), CATEGORY)
    save_file(values, path, METADATA)
    return path, values


def test_a_network_computes_what_its_layers_say(saved):
    path, values = saved
    network = load_network(path, CATEGORY, "abc")
    x = np.random.default_rng(1).normal(size=(5, feature_size(CATEGORY))).astype(np.float32)
    goal = np.array([0.3, -0.5], np.float32)
    y = np.concatenate([x, np.tile(goal, (5, 1))], axis=1)
    for layer in range(4):
        y = y @ values[f"regressor.{layer}.weight"] + values[f"regressor.{layer}.bias"]
        y = y if layer == 3 else np.maximum(y, 0)
    y[:, 0] = OBJECTIVE_SCALE * np.expm1(np.maximum(y[:, 0], 0))
    y[:, 1:4] += x[:, -9:-6]  # where the CoM is, from which it goes on
    np.testing.assert_allclose(network.predict(x, goal), y, rtol=1e-4, atol=1e-4)  # float32 sums
    assert (network.predict(x, goal)[:, 0] >= 0).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v, m: v.update({"regressor.1.weight": np.zeros((3, 3), np.float32)}), "is \\(3, 3\\)"),
        (lambda v, m: v.pop("classifier.0.bias"), "classifier.0.bias is missing"),
        (lambda v, m: v["regressor.3.bias"].__setitem__(0, np.nan), "not finite"),
        (lambda v, m: m.update(robot="other"), "robot is 'other', expected 'abc'"),
        (lambda v, m: m.update(category="7"), "category is '7'"),
        (lambda v, m: m.update(schema="old"), "schema is 'old'"),
    ],
)
def test_a_network_that_does_not_fit_is_refused(tmp_path, change, message):
    values, metadata = random_tensors(np.random.default_rng(0), CATEGORY), dict(METADATA)
    change(values, metadata)
    path = network_path(tmp_path, CATEGORY)
    save_file(values, path, metadata)
    with pytest.raises(NetworkError, match=message):
        load_network(path, CATEGORY, "abc")


def test_missing_and_truncated_network_files_are_refused(saved):
    path, _ = saved
    with pytest.raises(NetworkError, match="no such network; train it with"):
        load_network(path.with_name("other.safetensors"), CATEGORY, "abc")
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(NetworkError, match="not a readable safetensors file"):
        load_network(path, CATEGORY, "abc")


def some_samples(rng, n=40):
    size = feature_size(CATEGORY)
    feasible = rng.random(n) < 0.9
    return Samples(
        rng.normal(size=(n, size)).astype(np.float32),
        feasible,
        np.where(feasible[:, None], rng.random((n, 7)), np.nan).astype(np.float32),
        rng.normal(size=(n, 3)).astype(np.float32),
        np.arange(n, dtype=np.int32),
    )


def data_set(folder, rng, fingerprint="abc"):
    Manifest(SCHEMA, "some_robot", fingerprint, 0, {}, {}).write(folder)
    groups = [some_samples(rng), some_samples(rng)]
    for index, group in enumerate(groups):
        write_shard(folder, index, {CATEGORY: group})
    return groups


def test_a_data_set_comes_back_in_order(tmp_path):
    groups = data_set(tmp_path, np.random.default_rng(2))
    samples = read_dataset(tmp_path, "abc")[CATEGORY]
    for part in PARTS:
        expected = np.concatenate([getattr(group, part) for group in groups])
        np.testing.assert_array_equal(getattr(samples, part), expected)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "manifest.json",
        "shard-000000.npz",
        "shard-000001.npz",
    ]


def test_a_broken_data_set_is_refused(tmp_path):
    with pytest.raises(DatasetError, match="no data set here"):
        read_dataset(tmp_path, "abc")
    data_set(tmp_path, np.random.default_rng(2))
    with pytest.raises(DatasetError, match="collected for robot 'some_robot'"):
        read_dataset(tmp_path, "def")
    path = shard_path(tmp_path, 1)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DatasetError, match="truncated or not a shard"):
        read_dataset(tmp_path, "abc")
    group = some_samples(np.random.default_rng(3))
    group.features[0, 0] = np.nan
    write_shard(tmp_path, 1, {CATEGORY: group})
    with pytest.raises(DatasetError, match="NaN or infinite"):
        read_shard(path)
    for name in ("features", "targets", "goal"):
        write_shard(tmp_path, 1, {CATEGORY: replace(group, **{name: getattr(group, name)[:, 1:]})})
        with pytest.raises(DatasetError, match="has shapes"):
            read_shard(path)
    group = some_samples(np.random.default_rng(3))
    write_shard(tmp_path, 1, {CATEGORY: replace(group, feasible=~group.feasible)})
    with pytest.raises(DatasetError, match="outcomes of infeasible transitions"):
        read_shard(path)


def test_worlds_are_split_whole():
    samples = some_samples(np.random.default_rng(4), 200)
    parts = [samples.of(split) for split in Split]
    assert sum(len(part) for part in parts) == 200
    assert [len(part) for part in parts] == [160, 20, 20]
    worlds = [set(part.world.tolist()) for part in parts]
    assert not (worlds[0] & worlds[1] or worlds[0] & worlds[2] or worlds[1] & worlds[2])


def test_a_balanced_test_set_keeps_a_quarter_of_each_label(saved):
    samples = some_samples(np.random.default_rng(5), 2000)
    chosen = balanced(samples, 400, np.random.default_rng(0))
    assert len(chosen) == 400
    assert chosen.feasible.mean() == 0.75
    result = score(load_network(saved[0], CATEGORY, "abc"), chosen)
    assert result.feasible_share == 0.75
    assert 0 <= result.accuracy <= 1


def test_a_query_with_nan_is_refused(saved):
    from tests.prediction.test_features import random_case

    evaluator = NetworkEvaluator({CATEGORY: load_network(saved[0], CATEGORY, "abc")}, Goal(np.ones(3), 0.2))
    stance, com, velocity, transition = random_case(CATEGORY, np.random.default_rng(6))
    batch = evaluator.evaluate(stance, com, velocity, [transition])
    assert batch.com.shape == (1, 3)
    with pytest.raises(NetworkError, match="NaN or infinite"):
        evaluator.evaluate(stance, com * np.nan, velocity, [transition])


@pytest.mark.parametrize("text", ["[" * 100_000, "{}", "[1]", '{"schema": ' + "9" * 5000 + "}", "\udcff"])
def test_a_damaged_manifest_is_refused(tmp_path, text):
    (tmp_path / "manifest.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(DatasetError, match="not a manifest"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("name", "value"),
    [("features", np.array(["a", "b"])), ("feasible", np.array(True)), ("targets", np.ones((2, 7), complex))],
)
def test_a_shard_of_other_types_is_refused(tmp_path, name, value):
    path = tmp_path / "shard.npz"
    arrays = dict(
        features=np.zeros((2, feature_size(CATEGORY)), np.float32),
        feasible=np.ones(2, bool),
        targets=np.zeros((2, 7), np.float32),
        goal=np.zeros((2, 3), np.float32),
        world=np.zeros(2, np.int32),
    )
    named: dict[str, Any] = {f"{key}_{int(CATEGORY)}": item for key, item in (arrays | {name: value}).items()}
    np.savez(path, **named)
    with pytest.raises(DatasetError, match="arrays of other types"):
        read_shard(path)


@pytest.mark.parametrize("notes", ["no JSON", "[1]", "[" * 100_000])
def test_notes_on_the_training_that_are_no_json_are_refused(saved, notes):
    path, values = saved
    save_file(values, path, METADATA | {"training": notes})
    with pytest.raises(NetworkError, match="no JSON"):
        training_summary(load_network(path, CATEGORY, "abc"))


def test_weights_in_half_precision_hardly_change_a_network():
    rng, size = np.random.default_rng(2), 20
    widths = [size, 64, 64, 64, 7]
    lower = rng.normal(scale=5.0, size=size).astype(np.float32)
    upper = lower + np.exp(rng.uniform(-6.0, 3.0, size)).astype(np.float32)
    upper[3] = lower[3]
    inputs = rng.uniform(lower, upper, (200, size)).astype(np.float32)
    pairs = zip(widths, widths[1:], strict=False)
    weights = [rng.normal(size=pair).astype(np.float32) / np.float32(np.sqrt(pair[0])) for pair in pairs]
    spread = np.where(upper > lower, upper - lower, 1.0)[:, None]
    weights[0] /= spread.astype(np.float32)
    biases = [rng.normal(size=width).astype(np.float32) for width in widths[1:]]
    biases[0] -= (lower + upper) / 2 @ weights[0]
    net = Perceptron(tuple(weights), tuple(biases))
    half = stored(net, lower, upper)
    assert all(weight.dtype == np.float16 for weight in half.weights)
    np.testing.assert_allclose(restored(half, lower, upper)(inputs), net(inputs), atol=0.01)


def test_inputs_after_the_features_are_stored_as_they_are():
    rng = np.random.default_rng(3)
    net = Perceptron((rng.normal(size=(5, 2)).astype(np.float32),), (np.zeros(2, np.float32),))
    lower, upper = np.full(3, 10.0, np.float32), np.full(3, 12.0, np.float32)
    half = stored(net, lower, upper)
    np.testing.assert_array_equal(half.weights[0][3:], net.weights[0][3:].astype(np.float16))
    inputs = np.concatenate([rng.uniform(lower, upper, (9, 3)), rng.uniform(-1.0, 1.0, (9, 2))], axis=1)
    np.testing.assert_allclose(restored(half, lower, upper)(inputs), net(inputs), atol=0.01)
