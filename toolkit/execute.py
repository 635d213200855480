"""Command line: a saved plan, carried out again without planning."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from toolkit import cli

DESCRIPTION = """\
Carry a saved plan out again, without planning: the contacts of plan.json are optimised, turned into joint trajectories
and run in simulation, and the verdict is said as by python -m toolkit.validate.

Of a run's folder its world, robot, seed, disturbances and replanning are taken over too; options given here go before
them. With the same ones the execution is the same to the last digit, on the same machine.
"""

EPILOG = """\
examples:
  python -m toolkit.execute runs/first                              # the same again
  python -m toolkit.execute runs/first --push 60 --out runs/pushed  # would the plan survive a push?
  python -m toolkit.execute plan.json --world my_world.xml --robot my_robot

written into the output folder: report.json, plan.json, motion.npz, execution.npz, scene.mjb, recording.rrd
"""


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("execute", DESCRIPTION, EPILOG)
    parser.add_argument("plan", type=cli.path, metavar="RUN_OR_PLAN", help="folder of a run, or a plan.json")
    parser.add_argument("--world", type=cli.path, metavar="FILE", help="MJCF scene (default: that of the run)")
    parser.add_argument("--robot", help="folder name under robots/, or a path (default: that of the plan)")
    parser.add_argument("--robots", type=Path, metavar="DIR", help="folder with the robots (default: robots/)")
    parser.add_argument("--seed", type=cli.seed, default=0, help="seed of every random draw (default: the run's, or 0)")
    cli.add_disturbance_options(parser)
    cli.add_execution_options(parser)
    parser.add_argument(
        "--replanning", action="store_true", default=argparse.SUPPRESS, help="replan, though the run was without it"
    )
    parser.add_argument("--out", type=cli.path, help="output folder (default: runs/<world>-<robot>-<time>)")
    parser.add_argument("--pictures", action="store_true", help="also render a strip of pictures and plots")
    parser.add_argument("--video", action="store_true", help="also render a video")
    parser.add_argument("--no-recording", action="store_true", help="leave the rerun recording out")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code.

    Raises:
        InputError: The plan cannot be used, or not in this world and with this robot.
    """
    parser = arguments()
    args = parser.parse_args(argv)
    # Heavy imports come after the options, so that --help and mistakes in them answer at once.
    from toolkit.errors import InputError
    from toolkit.pipeline import PipelineConfig, carry_out
    from toolkit.report.console import StageConsole
    from toolkit.report.files import PLAN, RunFolder
    from toolkit.report.offscreen import require_rendering
    from toolkit.report.plan_file import read_names, read_plan, read_proposal
    from toolkit.report.run import RunOptions, write_run
    from toolkit.robot.loader import load_robot
    from toolkit.world.loader import load_world

    began, path = time.perf_counter(), args.plan
    if path.is_dir():
        parser.set_defaults(**_kept(path))
        args = parser.parse_args(argv)
        path = path / PLAN
        if not path.is_file():
            raise InputError(f"{args.plan}: lacks {PLAN}: the run found no plan, or it was removed")
    execution = cli.execution_config(args)
    solution, (world_name, robot_name) = read_proposal(path), read_names(path)
    if args.world is None:
        raise InputError(f"{path}: name the world that it was made for with --world (it was called {world_name})")
    if args.plan.is_dir() and not args.world.is_file():
        raise InputError(f"{args.world}: the world of this run is not there; name it with --world")
    display = StageConsole()
    display.started("surfaces")
    world = load_world(args.world, progress=lambda share: display.progress("surfaces", share))
    surface_seconds = time.perf_counter() - began
    robot = load_robot(args.robot or robot_name, args.robots)
    display.warn(robot, world)
    with RunFolder(args.out, world.name, robot.name) as folder:  # one that cannot be written is noticed here
        if args.pictures or args.video:
            require_rendering()
        display.finished("surfaces", True, surface_seconds, f"{len(world.surfaces)} surfaces")
        config = PipelineConfig(seed=args.seed, execution=execution)
        moves = read_plan(path).identity != solution.sequence.identity
        result = carry_out(robot, world, solution, config, display, moves=moves)
        written = RunOptions(not args.no_recording, args.pictures, args.video, surface_seconds, cli.plain_options(args))
        write_run(folder.path, result, written)
    display.verdict(result.checks, result.passed, result.reason, folder.target, time.perf_counter() - began)
    return 0 if result.passed else 1


def _kept(folder: Path) -> dict[str, Any]:
    """The settings of a run by option.

    Raises:
        InputError: The folder is none of a run, or its report is broken.
    """
    from toolkit.errors import InputError
    from toolkit.report.files import REPORT
    from toolkit.report.run_report import report_of

    report = report_of(folder)
    try:
        found = {"seed": cli.seed(str(report.seed)), **cli.kept_options(report.options)}
    except (argparse.ArgumentTypeError, InputError) as error:
        raise InputError(f"{folder / REPORT}: {error}") from None
    for name, kind in (("world", Path), ("robots", Path), ("robot", str)):
        if isinstance(report.options.get(name), str):
            found[name] = kind(report.options[name])
    return found


if __name__ == "__main__":
    cli.run(main)
