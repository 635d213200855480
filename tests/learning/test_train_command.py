"""`python -m toolkit.train fit`: what a user sees of it."""

import numpy as np
import pytest
import torch

from tests.learning.test_fit import HERE, samples
from toolkit import train
from toolkit.contacts.category import Category
from toolkit.errors import InputError, NetworkError
from toolkit.learning.dataset import SCHEMA, Manifest, write_shard
from toolkit.prediction.network import load_network, training_summary
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder, robot = tmp_path_factory.mktemp("data"), load_robot(None)
    Manifest(SCHEMA, robot.name, robot.fingerprint, 0, {}, {}).write(folder)
    for index in range(2):
        write_shard(folder, index, {category: samples(300, seed=index) for category in (Category.MOVE_FOOT,)})
    return folder


def fit(dataset, out, *more):
    options = ["--data", str(dataset), "--out", str(out), "--epochs", "2", "--categories", "0", "--workers", "1"]
    return train.main(["fit", *options, *more])


def test_fit_writes_networks_and_curves_and_goes_on_after_a_stop(dataset, tmp_path, capsys):
    assert fit(dataset, tmp_path) == 0
    first = (tmp_path / "category_0.safetensors").read_bytes()
    assert (tmp_path / "learning_curves.png").stat().st_size > 5000
    assert str(tmp_path) in capsys.readouterr().out.replace("\n", "")
    assert fit(dataset, tmp_path, "--resume") == 0
    assert "category 0: trained already" in capsys.readouterr().out
    assert fit(dataset, tmp_path, "--resume", "--seed", "1") == 0
    assert "trained already" not in capsys.readouterr().out
    assert (tmp_path / "category_0.safetensors").read_bytes() != first


def test_threads_are_as_before(dataset, tmp_path):
    before = torch.get_num_threads()
    assert fit(dataset, tmp_path, "--workers", str(before + 1)) == 0
    assert torch.get_num_threads() == before


def test_classifiers_are_kept(dataset, tmp_path):
    with pytest.raises(NetworkError, match="no such network"):
        fit(dataset, tmp_path, "--keep-classifiers")
    fit(dataset, tmp_path)
    robot = load_robot(None)
    before = load_network(tmp_path / "category_0.safetensors", Category.MOVE_FOOT, robot.fingerprint)
    fit(dataset, tmp_path, "--keep-classifiers", "--seed", "1")
    after = load_network(tmp_path / "category_0.safetensors", Category.MOVE_FOOT, robot.fingerprint)
    for one, other in zip(before.classifier.weights, after.classifier.weights, strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(before.regressor.weights[0], after.regressor.weights[0])
    assert set(training_summary(after)["curves"]) == {"classifier", "regressor"}


def test_regressors_are_refined(dataset, tmp_path):
    fit(dataset, tmp_path)
    robot = load_robot(None)
    before = load_network(tmp_path / "category_0.safetensors", Category.MOVE_FOOT, robot.fingerprint)
    fit(dataset, tmp_path, "--refine", "--learning-rate", "1e-9", "--batch", "64")
    after = load_network(tmp_path / "category_0.safetensors", Category.MOVE_FOOT, robot.fingerprint)
    # With a step size of nothing the network is what it was, through scaling and back in single precision.
    features = samples(50, seed=3).features
    np.testing.assert_allclose(after.predict(features, HERE), before.predict(features, HERE), rtol=1e-3, atol=1e-3)
    np.testing.assert_array_equal(before.classifier.weights[0], after.classifier.weights[0])
    config = training_summary(after)["config"]
    assert config["batch"] == 64
    assert training_summary(after)["config_before"] == training_summary(before)["config"]


def test_a_device_that_is_not_there_is_refused(dataset, tmp_path):
    with pytest.raises(InputError, match="--device nonsense: torch cannot compute there .*; use --device cpu"):
        fit(dataset, tmp_path / "new", "--device", "nonsense")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--learning-rate", "inf", "not above zero"),
        ("--learning-rate", "nan", "not above zero"),
        ("--learning-rate", "-5", "not above zero"),
        ("--learning-rate", "1e300", "above 1"),
        ("--seed", "9" * 23, "give a whole number"),
        ("--seed", "-1", "give a whole number"),
    ],
)
def test_numbers_that_no_training_can_use_are_refused(dataset, tmp_path, capsys, option, value, message):
    with pytest.raises(SystemExit) as left:
        fit(dataset, tmp_path / "out", f"{option}={value}")
    assert left.value.code == 2 and message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
