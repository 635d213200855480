"""Command line: write a random world."""

from __future__ import annotations

import argparse
import inspect
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit import cli

if TYPE_CHECKING:
    from toolkit.world.scaling import Fit

DESCRIPTION = """\
Write a world of tilted tiles, stairs, a gap, a slope or one mesh as an MJCF file.

The same kind, seed and options give the same file.
"""

EPILOG = """\
examples:
  python -m toolkit.terrain rubble_corridor --seed 7 --out corridor.xml
  python -m toolkit.terrain slope --length 2 --angle 25 --out slope.xml
  python -m toolkit.terrain stepping_stones --robot my_robot --out stones.xml
  python -m toolkit.terrain stairs --help

with --robot, lengths are scaled by the length of the robot's legs, times by the root of that, and tiles are no steeper
than its ankles follow; lengths among the options are those before the scaling
"""


MOST = 100
"""Most rows, columns or steps of a world, and most walls."""
GREATEST = 1000.0
"""Greatest length in m, angle in degrees or time in s."""


def _finite(text: str) -> float:
    """An argparse type: a number, no larger than worlds are."""
    value = float(text)
    if not abs(value) <= GREATEST:
        raise argparse.ArgumentTypeError(f"{text} is not a number from -{GREATEST:g} to {GREATEST:g}")
    return value + 0.0  # no -0


def arguments() -> argparse.ArgumentParser:
    """The options of this command: those of each generator are its keyword arguments."""
    from toolkit.world.generators import KINDS

    parser = cli.parser("terrain", DESCRIPTION, EPILOG)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND", help=", ".join(KINDS))
    for kind, generator in KINDS.items():
        text = inspect.getdoc(generator) or ""
        options = kinds.add_parser(kind, description=text.splitlines()[0])
        options.add_argument("--seed", type=cli.seed, default=0, help="seed of every random draw (default: 0)")
        options.add_argument("--out", type=cli.path, metavar="FILE", help="file to write (default: standard output)")
        options.add_argument("--robot", help="make the terrain to the scale of this robot: a name or a folder")
        options.add_argument("--robots", type=Path, metavar="DIR", help="folder with the robots (default: robots/)")
        described = dict(line.strip().split(": ", 1) for line in text.splitlines() if ": " in line)
        for name, parameter in inspect.signature(generator, eval_str=True).parameters.items():
            if parameter.kind is not inspect.Parameter.KEYWORD_ONLY:
                continue
            options.add_argument(
                f"--{name.replace('_', '-')}",
                type=cli.positive(int, MOST) if parameter.annotation is int else _finite,
                default=argparse.SUPPRESS,
                help=f"{described[name].rstrip('.')} (default: {parameter.default:g})",
            )
    return parser


def main(argv: list[str] | None = None) -> int:
    """Write the world; returns the exit code.

    Raises:
        InputError: the options make no world, or the file cannot be written.
    """
    options = vars(arguments().parse_args(argv))
    import numpy as np

    from toolkit.drafts import write_whole
    from toolkit.errors import InputError
    from toolkit.world.generators import KINDS
    from toolkit.world.loader import load_world
    from toolkit.world.scaling import Fit, fitted

    kind, seed, out = options.pop("kind"), options.pop("seed"), options.pop("out")
    fit = _fit(options.pop("robot"), options.pop("robots"))
    try:
        text = fitted(KINDS[kind], np.random.default_rng(seed), fit or Fit(), options)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{kind}: these options make no world ({error})") from error
    load_world(out or Path(f"{kind}.xml"), mjcf=text)  # what is written can be used
    if out is None:
        sys.stdout.write(text)
    else:
        write_whole(out, text.encode())
    return 0


def _fit(robot: str | None, robots: Path | None) -> Fit | None:
    """The fit to a robot; None where none is named."""
    from toolkit.robot.loader import load_robot
    from toolkit.world.scaling import Fit

    return None if robot is None else Fit.of(load_robot(robot, robots))


if __name__ == "__main__":
    cli.run(main)
