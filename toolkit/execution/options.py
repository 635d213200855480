"""Settings of the execution from the options of a command line."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

import numpy as np

from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import Disturbance


def disturbance(args: Namespace) -> Disturbance:
    """What differs between simulation and plan (see `toolkit.cli.add_disturbance_options`).

    Raises:
        InputError: a value is out of range.
    """
    offset, tilt = args.terrain_error
    return Disturbance(
        push=args.push,
        mass_error=args.mass_error,
        friction_error=args.friction_error,
        terrain_offset=offset,
        terrain_tilt=float(np.radians(tilt)),
        state_noise=args.state_noise,
        delay=args.delay,
    )


def execution_config(args: Namespace) -> ExecutionConfig:
    """How a plan is carried out (see `toolkit.cli.add_disturbance_options` and `add_execution_options`).

    Raises:
        InputError: a value is out of range.
    """
    config = ExecutionConfig(disturbance=disturbance(args))
    return replace(config, replanning=replace(config.replanning, enabled=args.replanning))
