"""Command line: runs side by side."""

from __future__ import annotations

import argparse

from toolkit import cli

DESCRIPTION = """\
Set runs side by side: verdicts, plans, execution and times in one table, and the settings in which they differ.

With --out the comparison is written too: as Markdown or CSV, or as a recording for the rerun viewer, in which all
robots walk side by side, with their CoM paths in one scene, their curves and the tables.
"""

EPILOG = """\
examples:
  python -m toolkit.compare runs/first runs/pushed
  python -m toolkit.compare runs/* --out table.csv
  python -m toolkit.compare runs/first runs/pushed --out both.md --out both.rrd     # then: rerun both.rrd
"""
ENDINGS = (".md", ".csv", ".rrd")


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("compare", DESCRIPTION, EPILOG)
    parser.add_argument("runs", type=cli.path, metavar="RUN", nargs="+", help="folders of runs, two or more")
    parser.add_argument(
        "--out",
        type=cli.path,
        metavar="FILE",
        action="append",
        default=[],
        help="also write the comparison; the name ends in .md, .csv or .rrd, and the option may be repeated",
    )
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code.

    Raises:
        InputError: A folder is no whole run, or a file cannot be written.
    """
    args = arguments().parse_args(argv)
    # Heavy imports come after the options, so that --help and mistakes in them answer at once.
    from toolkit.errors import InputError

    if len(args.runs) < 2:
        raise InputError(f"{args.runs[0]}: one run alone; name two or more to compare")
    for out in args.out:
        if out.suffix.lower() not in ENDINGS:
            raise InputError(f"{out}: the name must end in one of {', '.join(ENDINGS)}")
    from toolkit.drafts import write_whole
    from toolkit.report.comparison import as_csv, as_markdown, compare, comparison_table
    from toolkit.report.console import make_console, progress_bar
    from toolkit.report.saved_run import read_run

    console = make_console()
    with progress_bar(console) as bar:
        runs = [read_run(folder) for folder in bar.track(args.runs, description="reading")]
    comparison = compare(runs)
    for out in args.out:
        if out.suffix.lower() == ".rrd":
            from toolkit.report.comparison_recording import write_comparison_recording

            write_comparison_recording(out, comparison, runs)
        else:
            csv = out.suffix.lower() == ".csv"
            text = as_csv(comparison, args.runs) if csv else as_markdown(comparison)
            write_whole(out, text.encode("utf-8", "backslashreplace"))
    same = "" if comparison.settings else ", all with the same settings"
    console.print(comparison_table(comparison, f"{len(runs)} runs{same}"))
    for out in args.out:
        console.print(f"written to {out}", soft_wrap=True, markup=False)
    return 0


if __name__ == "__main__":
    cli.run(main)
