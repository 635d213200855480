"""Seeds made from networks: the same for the same weights, others for other weights and other experiments."""

import pytest

from toolkit.errors import InputError
from toolkit.robot.loader import load_robot
from validation import options
from validation.fresh_seeds import add_seed_option, fresh_seed


@pytest.fixture
def networks(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.safetensors").write_bytes(name.encode() * 100)
    return tmp_path


def test_the_seed_depends_on_every_weight_and_on_the_purpose(networks):
    seed = fresh_seed(networks, "calibration")
    assert seed == fresh_seed(networks, "calibration")
    assert seed != fresh_seed(networks, "ablation")
    (networks / "note.md").write_text("not a network")
    assert seed == fresh_seed(networks, "calibration")
    (networks / "b.safetensors").write_bytes(b"b" * 99 + b"c")
    assert seed != fresh_seed(networks, "calibration")


def test_without_networks_a_seed_is_asked_for(tmp_path):
    with pytest.raises(InputError, match="--seed-offset"):
        fresh_seed(tmp_path, "calibration")


def test_an_experiment_takes_the_seed_of_the_networks_unless_one_is_given():
    parser = options.parser("calibration", "", ["flat"], 1)
    add_seed_option(parser)
    folder = load_robot(None).folder / "networks"
    assert options.first_seed(parser.parse_args([]), "calibration") == fresh_seed(folder, "calibration")
    assert options.first_seed(parser.parse_args(["--seed-offset", "0"]), "calibration") == 0
