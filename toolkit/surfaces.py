"""Command line: show the contact surfaces of a world."""

from __future__ import annotations

import argparse
from pathlib import Path

from toolkit import cli

DESCRIPTION = """\
Show the contact surfaces that are extracted from a world: a table, and a recording for the rerun viewer.
"""

EPILOG = """\
examples:
  python -m toolkit.surfaces worlds/stairs.xml
  python -m toolkit.surfaces my_world.xml --out look     # then: rerun look/surfaces.rrd
"""

RECORDING = "surfaces.rrd"


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("surfaces", DESCRIPTION, EPILOG)
    parser.add_argument("world", type=Path, help=cli.WORLD)
    parser.add_argument("--out", type=cli.path, metavar="DIR", help=f"folder for {RECORDING} (default: table only)")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code.

    Raises:
        WorldError: the world cannot be used.
        InputError: the recording cannot be written.
    """
    args = arguments().parse_args(argv)
    # The viewer's library takes a second to import: mistakes in the world are reported before.
    from rich.progress import Progress

    from toolkit.report.console import make_console
    from toolkit.world.loader import load_world

    console = make_console()
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("surfaces", total=1.0)
        world = load_world(args.world, progress=lambda share: bar.update(task, completed=share))
    from toolkit.report.surfaces import surface_table, write_surface_recording

    console.print(surface_table(world))
    if args.out is None:
        return 0
    write_surface_recording(args.out / RECORDING, world)
    console.print(f"written to {args.out / RECORDING}", soft_wrap=True, markup=False)
    return 0


if __name__ == "__main__":
    cli.run(main)
