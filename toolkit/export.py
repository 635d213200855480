"""Command line: a run in the format of other software."""

from __future__ import annotations

import argparse
from pathlib import Path

from toolkit import cli

DESCRIPTION = """\
Write a run in the format of other software.

A run is a folder that python -m toolkit.validate wrote. Its simulated states are exported, or with --planned those of
the plan. Every export comes with contact labels, joint torques and targets for each frame, the contact sequence, the
terrain as MJCF and as a mesh, the robot, friction and verdict; README.txt in the folder says frames, units and orders.
"""

EPILOG = """\
formats:
{formats}

examples:
  python -m toolkit.export runs/flat-my_robot-20260101-120000 --to mjlab
  python -m toolkit.export runs/stairs --to csv --fps 100 --out stairs_csv
"""


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    from toolkit.exchange.formats import FORMATS

    width = max(map(len, FORMATS))
    formats = "\n".join(f"  {name:<{width}}  {form.about}, {form.fps:g} fps" for name, form in FORMATS.items())
    parser = cli.parser("export", DESCRIPTION, EPILOG.format(formats=formats))
    parser.add_argument("run", type=cli.path, metavar="RUN", help="folder of a run")
    parser.add_argument("--to", choices=tuple(FORMATS), required=True, metavar="FORMAT", help=", ".join(FORMATS))
    parser.add_argument("--out", type=cli.path, metavar="DIR", help="output folder (default: RUN-FORMAT)")
    parser.add_argument(
        "--fps", type=cli.positive(float, 10_000), metavar="N", help="frames per second (default: the format's)"
    )
    parser.add_argument("--planned", action="store_true", help="the planned states instead of the simulated ones")
    parser.add_argument("--robot", help="folder name under robots/, or a path (default: the run's)")
    parser.add_argument("--robots", type=Path, metavar="DIR", help="folder with the robots (default: robots/)")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code.

    Raises:
        InputError: the run cannot be exported, or the folder cannot be written.
    """
    args = arguments().parse_args(argv)
    from toolkit.exchange.folder import FILES, write_export
    from toolkit.exchange.formats import FORMATS
    from toolkit.exchange.frames import frames_of
    from toolkit.exchange.record import check_robot, read_run
    from toolkit.report.console import make_console
    from toolkit.report.files import RunFolder
    from toolkit.robot.loader import load_robot

    console = make_console()
    with console.status("reading") as status:
        record = read_run(args.run)
        robot = load_robot(args.robot or record.robot_option, args.robots)
        check_robot(record, robot)
        run = args.run.resolve()
        out = args.out or run.with_name(f"{run.name}-{args.to}")
        with RunFolder(out, record.report["world"], robot.name, robot.assets, FILES, "export") as folder:
            status.update("computing the frames")
            frames = frames_of(record, robot, args.fps or FORMATS[args.to].fps, planned=args.planned)
            status.update("writing")
            write_export(folder.path, args.to, record, robot, frames, planned=args.planned)
    states = "planned" if args.planned else "simulated"
    console.print(f"{len(frames.times)} {states} frames at {frames.fps:g} fps; verdict {record.report['verdict']}")
    console.print(f"written to {folder.target}", soft_wrap=True, markup=False)
    return 0


if __name__ == "__main__":
    cli.run(main)
