"""Command line: say whether this installation works."""

from __future__ import annotations

import argparse
import itertools

from toolkit import cli

DESCRIPTION = """\
Say whether this installation works, and what to do where it does not.

Looked at are the installed packages, the robots and their networks, the folder where compiled kernels are kept and
the renderers; then a robot walks over a flat world for some ten seconds. A note is about something that not everybody
needs.
"""

EPILOG = """\
examples:
  python -m toolkit.doctor
  python -m toolkit.doctor --quick                    # without the walk
  python -m toolkit.doctor --robots my_robots --robot mine
"""


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("doctor", DESCRIPTION, EPILOG)
    cli.add_robot_options(parser)
    parser.add_argument("--quick", action="store_true", help="leave the walk out")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code: 1 where something is wrong."""
    args = arguments().parse_args(argv)
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from toolkit.report.console import StageConsole, make_console
    from toolkit.report.health import (
        State,
        check_cache,
        check_kernels,
        check_packages,
        check_renderers,
        check_robots,
        check_walk,
    )

    console = make_console()
    styles = {State.GOOD: "green", State.NOTE: "yellow", State.BAD: "bold red"}
    table = Table("what", "", "", box=box.SIMPLE, pad_edge=False, show_header=False)
    with console.status("looking at packages, robots and renderers"):
        findings = list(
            itertools.chain(
                check_packages(), check_robots(args.robots), [check_cache()], check_kernels(), check_renderers()
            )
        )
    if not args.quick:
        findings.append(check_walk(args.robot, args.robots, StageConsole(console)))
    for finding in findings:
        state = Text(finding.state.value, style=styles[finding.state])
        table.add_row(Text(finding.name), state, Text(" ".join(finding.detail.split())))
    console.print(table)
    bad = [finding.name for finding in findings if finding.state is State.BAD]
    console.print(f"FAIL: {', '.join(bad)}" if bad else "everything that is needed works", markup=False)
    return 1 if bad else 0


if __name__ == "__main__":
    cli.run(main)
