"""Command line: a world in, a verdict out."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from toolkit import cli

DESCRIPTION = """\
Plan a way through a world, run it in simulation, and say whether the robot got there.

The stages: contact surfaces are extracted from the MJCF scene; an anytime search proposes contact sequences of feet
and palms; the centroidal optimiser, inverse kinematics and the simulation test them, newest first; the first that
passes every check is the plan.
"""

EPILOG = """\
examples:
  python -m toolkit.validate worlds/stairs.xml --seed 3
  python -m toolkit.validate my_world.xml --robot robots/my_robot --out results/first --pictures

written into the output folder: report.json, plan.json, motion.npz, execution.npz, scene.mjb, recording.rrd
"""


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("validate", DESCRIPTION, EPILOG)
    parser.add_argument("world", type=Path, help=cli.WORLD)
    cli.add_robot_options(parser)
    cli.add_planning_options(parser)
    cli.add_disturbance_options(parser)
    cli.add_execution_options(parser)
    parser.add_argument("--out", type=cli.path, help="output folder (default: runs/<world>-<robot>-<time>)")
    parser.add_argument(
        "--candidates", type=cli.positive(int), default=16, help="sequences to test at most (default: 16)"
    )
    parser.add_argument("--pictures", action="store_true", help="also render a strip of pictures and plots")
    parser.add_argument("--video", action="store_true", help="also render a video")
    parser.add_argument("--no-recording", action="store_true", help="leave the rerun recording out")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    args = arguments().parse_args(argv)
    # Heavy imports come after the options, so that --help and mistakes in them answer at once.
    from toolkit.pipeline import PipelineConfig, make_planner, run
    from toolkit.pipeline.warmup import warm_up
    from toolkit.report.console import StageConsole
    from toolkit.report.files import RunFolder
    from toolkit.report.offscreen import require_rendering
    from toolkit.report.run import RunOptions, write_run
    from toolkit.robot.loader import load_robot
    from toolkit.world.loader import load_world

    began = time.perf_counter()
    display = StageConsole()
    options, execution = cli.PlanningOptions.of(args), cli.execution_config(args)
    display.started("surfaces")
    with warm_up(display):
        world = load_world(args.world, progress=lambda share: display.progress("surfaces", share))
        surface_seconds = time.perf_counter() - began
        robot = load_robot(args.robot, args.robots)
        run_folder = RunFolder(args.out, world.name, robot.name)  # one that is not fit for it is noticed here
        if args.pictures or args.video:
            require_rendering()
    display.warn(robot, world)
    with run_folder as folder:
        display.finished("surfaces", True, surface_seconds, f"{len(world.surfaces)} surfaces")
        planner = make_planner(robot, world, options.planner, options.planner_config())
        config = PipelineConfig(
            seed=args.seed, time_limit=options.time_limit, candidates=args.candidates, execution=execution
        )
        result = run(robot, world, planner, config, display)
        written = RunOptions(not args.no_recording, args.pictures, args.video, surface_seconds, cli.plain_options(args))
        write_run(folder.path, result, written)
    display.verdict(result.checks, result.passed, result.reason, folder.target, time.perf_counter() - began)
    return 0 if result.passed else 1


if __name__ == "__main__":
    cli.run(main)
