"""Command line: the plan alone, without whole-body motion and simulation."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from toolkit import cli

DESCRIPTION = """\
Search for a contact sequence through a world and optimise its centroidal motion.

The anytime search finds a first sequence quickly and improves it until its budget is spent. All its sequences are then
optimised as a whole, and the one with the least true cost among the dynamically feasible ones is the plan. To see
whether the robot can carry it out, run python -m toolkit.validate.
"""

EPILOG = """\
examples:
  python -m toolkit.plan worlds/stairs.xml
  python -m toolkit.plan my_world.xml --planner quasi-static --time-limit 5

written into the output folder: report.json, plan.json, motion.npz, recording.rrd, plan.png (seen from above)
"""


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("plan", DESCRIPTION, EPILOG)
    parser.add_argument("world", type=Path, help=cli.WORLD)
    cli.add_robot_options(parser)
    cli.add_planning_options(parser)
    parser.add_argument("--out", type=cli.path, help="output folder (default: runs/<world>-<robot>-<time>)")
    parser.add_argument("--no-recording", action="store_true", help="leave the rerun recording out")
    parser.set_defaults(pictures=True)
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    args = arguments().parse_args(argv)
    # Heavy imports come after the options, so that --help and mistakes in them answer at once.
    from toolkit.pipeline import PipelineConfig, make_planner, run
    from toolkit.pipeline.warmup import warm_up
    from toolkit.report.console import StageConsole, sequence_table
    from toolkit.report.files import RunFolder
    from toolkit.report.run import RunOptions, write_run
    from toolkit.robot.loader import load_robot
    from toolkit.world.loader import load_world

    began, options = time.perf_counter(), cli.PlanningOptions.of(args)
    display = StageConsole()
    display.started("surfaces")
    with warm_up(display):
        world = load_world(args.world, progress=lambda share: display.progress("surfaces", share))
        surface_seconds = time.perf_counter() - began
        robot = load_robot(args.robot, args.robots)
        run_folder = RunFolder(args.out, world.name, robot.name)  # one that is not fit for it is noticed here
    display.warn(robot, world)
    with run_folder as folder:
        display.finished("surfaces", True, surface_seconds, f"{len(world.surfaces)} surfaces")
        planner = make_planner(robot, world, options.planner, options.planner_config())
        config = PipelineConfig(seed=args.seed, time_limit=options.time_limit, until="dynamics")
        result = run(robot, world, planner, config, display)
        written = RunOptions(not args.no_recording, args.pictures, False, surface_seconds, cli.plain_options(args))
        write_run(folder.path, result, written)
    if result.candidates:
        display.console.print(sequence_table(result))
    display.verdict((), result.passed, result.reason, folder.target, time.perf_counter() - began)
    return 0 if result.passed else 1


if __name__ == "__main__":
    cli.run(main)
