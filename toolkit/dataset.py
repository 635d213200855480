"""Command line: hours of motion through random worlds."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from toolkit import cli

if TYPE_CHECKING:
    from rich.console import Console

    from toolkit.clips.attempt import Record

_AHEAD = 16  # attempts that wait on a cluster, whose number of workers nobody knows

DESCRIPTION = """\
Make a data set of motions: random worlds, each planned, executed in MuJoCo, and kept where the run passes every check.

Each clip has its motion in one of the formats of python -m toolkit.export, its contacts, and its world as MJCF; its run
lies beside it and replays it bit for bit. An index (Parquet), statistics, and a page of pictures say what there is.

A data set that was stopped goes on with the same command and becomes the same one; a larger --hours makes it longer.
"""

EPILOG = """\
kinds of worlds, whose sizes, friction and timing are drawn for each world:
  {kinds}

examples:
  python -m toolkit.dataset --hours 0.05 --out data/tiny
  python -m toolkit.dataset --robot my_robot --kinds flat,stairs --hours 1 --seed 3 --out data/stairs
  python -m toolkit.dataset --hours 10 --to mjlab --cluster tls://scheduler:8786 --out /shared/motions

written into the output folder: index.parquet, statistics.json, README.md, sheet.jpg, clips/, runs/, robot/, attempts/
"""


def _kinds(text: str) -> tuple[str, ...]:
    """An argparse type: kinds of worlds separated by commas."""
    from toolkit.clips.terrain import KINDS

    names = tuple(name.strip() for name in text.split(","))
    for name in names:
        if name not in KINDS:
            raise argparse.ArgumentTypeError(f"{name!r} is no kind of worlds; choose from {','.join(KINDS)}")
    return tuple(dict.fromkeys(names))


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    from toolkit.clips.terrain import KINDS
    from toolkit.exchange.formats import FORMATS

    parser = cli.parser("dataset", DESCRIPTION, EPILOG.format(kinds=", ".join(KINDS)))
    parser.add_argument("--out", type=cli.path, required=True, metavar="DIR", help="data set folder, new or begun")
    parser.add_argument(
        "--hours", type=cli.positive(float, 1e4), default=1.0, metavar="H", help="hours of motion kept (default: 1)"
    )
    parser.add_argument(
        "--kinds", type=_kinds, default=tuple(KINDS), metavar="KIND,KIND,...", help="they take turns (default: all)"
    )
    cli.add_robot_options(parser)
    cli.add_planning_options(parser)
    parser.set_defaults(time_limit=120.0)  # where time ends a search, another machine makes another data set
    parser.add_argument(
        "--candidates", type=cli.positive(int), default=6, help="sequences to test in a world at most (default: 6)"
    )
    parser.add_argument(
        "--to", choices=tuple(FORMATS), default="npz", metavar="FORMAT", help=f"{', '.join(FORMATS)} (default: npz)"
    )
    parser.add_argument(
        "--fps", type=cli.positive(float, 10_000), metavar="N", help="frames per second (default: the format's)"
    )
    parser.add_argument(
        "--workers", type=cli.positive(int), default=cli.cores(), metavar="N", help="processes (default: all cores)"
    )
    cli.add_cluster_options(parser)
    parser.add_argument(
        "--so-far", action="store_true", help="make nothing; write index, statistics and pictures of what there is"
    )
    parser.add_argument("--no-sheet", action="store_true", help="leave the page of pictures out")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code.

    Raises:
        InputError: An option cannot be used, or the folder holds something else or cannot be written.
        PlanningError: No world passes.
    """
    args = arguments().parse_args(argv)
    from toolkit.clips.collect import so_far
    from toolkit.clips.index import pyarrow
    from toolkit.report.console import make_console
    from toolkit.report.offscreen import require_rendering

    pyarrow()
    if not args.no_sheet:
        require_rendering()
    console = make_console()
    records = so_far(args.out) if args.so_far else _collected(args, console)
    _describe(args, console, records)
    return 0


def _collected(args: argparse.Namespace, console: Console) -> list[Record]:
    """Make what is lacking; returns the records of all attempts."""
    from toolkit.clips.attempt import ClipConfig
    from toolkit.clips.collect import State, collect
    from toolkit.exchange.formats import FORMATS
    from toolkit.learning.jobs import executor
    from toolkit.pipeline import planner_kind
    from toolkit.pipeline.warmup import warm_up
    from toolkit.prediction.networks import digest, load_networks
    from toolkit.report.console import StageConsole, progress_bar
    from toolkit.robot.loader import load_robot

    robot = load_robot(args.robot, args.robots)
    planning, planner = cli.PlanningOptions.of(args), planner_kind(robot, args.planner)
    if planner == "learned":
        load_networks(robot)  # a planner that lacks its networks is refused before the first world
    config = ClipConfig(
        robot=robot.folder.name,
        robots=str(robot.folder.parent.resolve()),
        kinds=args.kinds,
        planner=planner,
        planning=planning.planner_config(),
        networks=digest(robot.folder / "networks") if planner == "learned" else "",
        seed=args.seed,
        time_limit=args.time_limit,
        candidates=args.candidates,
        format=args.to,
        fps=args.fps or FORMATS[args.to].fps,
    )
    with warm_up(StageConsole(console)):
        pass
    with (
        executor(args.workers, args.cluster, unencrypted=args.cluster_unencrypted) as pool,
        progress_bar(console) as progress,
    ):
        task = progress.add_task("s of motion", total=math.ceil(3600.0 * args.hours))

        def tick(state: State) -> None:
            words = f"{state.clips} of {state.attempts} worlds passed"
            progress.update(task, completed=int(state.seconds), description=f"s of motion ({words})")
            if not console.is_terminal and state.last is not None:
                last = state.last
                outcome = "PASS" if last["passed"] else f"FAIL {last['stage']}: {last['reason']}"
                head = f"{state.seconds:.0f} s of motion, {words}; {last['kind']}, {last['seconds']:.0f} s: {outcome}"
                console.print(head, soft_wrap=True, markup=False)

        ahead = args.workers if args.cluster is None else _AHEAD
        return collect(args.out, robot, config, args.hours, pool, tick, ahead=ahead)


def _describe(args: argparse.Namespace, console: Console, records: list[Record]) -> None:
    """Write index, statistics and pictures of what there is, and say so."""
    from toolkit.clips.collect import manifest_of
    from toolkit.clips.index import write_index
    from toolkit.clips.sheet import write_sheet
    from toolkit.clips.statistics import PAGE, STATISTICS, page, statistics
    from toolkit.drafts import write_whole
    from toolkit.report.files import write_json

    manifest, figures = manifest_of(args.out), statistics(records)
    write_index(args.out, manifest.robot, records)
    if not args.no_sheet:
        with console.status("drawing the page of pictures"):
            write_sheet(args.out, records)
    write_json(args.out / STATISTICS, figures)
    write_whole(args.out / PAGE, page(figures, manifest).encode())
    console.print(
        f"{figures['hours']:.3f} h of motion in {figures['clips']} clips, {figures['passed']:.0%} of "
        f"{figures['attempts']} worlds passed"
    )
    console.print(f"written to {args.out}", soft_wrap=True, markup=False)


if __name__ == "__main__":
    cli.run(main)
