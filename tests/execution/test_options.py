"""Disturbances and replanning from the command line."""

import argparse

import numpy as np
import pytest

from toolkit import cli
from toolkit.errors import InputError
from toolkit.execution.disturbance import Disturbance
from toolkit.execution.options import disturbance, execution_config


def parsed(*options: str) -> Disturbance:
    parser = argparse.ArgumentParser()
    cli.add_disturbance_options(parser)
    return disturbance(parser.parse_args(options))


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
    parser = argparse.ArgumentParser()
    cli.add_disturbance_options(parser)
    cli.add_execution_options(parser)
    assert execution_config(parser.parse_args([])).replanning.enabled
    config = execution_config(parser.parse_args(["--no-replanning", "--push", "60"]))
    assert not config.replanning.enabled and config.disturbance.push == 60.0
