"""What the options of the commands become."""

import argparse

import numpy as np
import pytest

from toolkit import cli
from toolkit.errors import InputError
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import Disturbance
from toolkit.world.timing import Timing


def config_of(*options: str) -> ExecutionConfig:
    parser = argparse.ArgumentParser()
    cli.add_disturbance_options(parser)
    cli.add_execution_options(parser)
    return cli.execution_config(parser.parse_args(options))


def parsed(*options: str) -> Disturbance:
    return config_of(*options).disturbance


def test_nothing_differs_by_default():
    assert repr(parsed()) == repr(Disturbance())  # NaN is never equal to itself


def test_every_option_reaches_the_simulation():
    found = parsed(
        *("--push", "60", "--mass-error", "0.05", "--friction-error", "-0.1", "--terrain-error", "0.01,2"),
        *("--state-noise", "0.001", "--delay", "0.002"),
    )
    assert (found.push, found.mass_error, found.friction_error) == (60.0, 0.05, -0.1)
    assert (found.terrain_offset, found.state_noise, found.delay) == (0.01, 0.001, 0.002)
    assert found.terrain_tilt == pytest.approx(np.radians(2.0))
    assert not found.replayable
    assert parsed("--terrain-error", "0.02").terrain_tilt == 0.0


@pytest.mark.parametrize("options", [("--push", "nan"), ("--terrain-error", "1,2,3"), ("--delay", "soon")])
def test_what_is_no_number_is_refused(options, capsys):
    with pytest.raises(SystemExit) as error:
        parsed(*options)
    assert error.value.code == 2
    assert options[1] in capsys.readouterr().err


def test_what_is_out_of_range_is_refused():
    with pytest.raises(InputError, match="delay"):
        parsed("--delay", "-1")
    with pytest.raises(InputError, match="mass_error"):
        parsed("--mass-error", "-2")


def test_replanning_can_be_left_out():
    assert config_of().replanning
    config = config_of("--no-replanning", "--push", "60")
    assert not config.replanning and config.disturbance.push == 60.0


def test_planning_options_reach_the_planner():
    parser = argparse.ArgumentParser()
    cli.add_planning_options(parser)
    assert cli.PlanningOptions.of(parser.parse_args([])) == cli.PlanningOptions()
    words = "--no-palms --steps 38 --heuristic euclidean --expansions 7 --timing 0.4,0.6 --planner optimiser"
    options = cli.PlanningOptions.of(parser.parse_args(words.split()))
    config = options.planner_config()
    assert options.planner == "optimiser" and options.time_limit == 30.0
    assert not config.palms and config.steps == 38 and config.heuristic == "euclidean"
    assert config.search.max_expansions == 7 and config.timings == (Timing(0.4, 0.6),)


def test_a_report_keeps_the_options_but_for_seed_and_folder():
    args = argparse.Namespace(seed=3, out=None, planner="auto", timing=(1, 2), push=0.0, no_palms=False)
    assert cli.plain_options(args) == {"planner": "auto", "push": 0.0, "no_palms": False}
