"""What is found in noisy scans, and whether plans made there hold: `python -m validation.scan`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toolkit import cli
from toolkit.report.console import make_console
from validation import goals, options
from validation.cases import make_cases
from validation.goals import Goal
from validation.jobs import Job, Record, run_jobs
from validation.scan_trial import ScanSettings, scan_trial
from validation.tables import (
    failure_section,
    in_unit,
    largest,
    markdown_table,
    mean,
    median,
    number,
    show_results,
    values,
    write_results,
)
from validation.trial_file import TrialFile

DESCRIPTION = """\
Scan random worlds from above, with noise and holes, turn the scans into worlds, plan there, and execute in the world
that was scanned.

A surface for feet counts as FOUND when a surface of the scanned world covers half of it, with a normal within 5 degrees
and 2 cm along it. The plan is the first that passes the whole-body stage in the scanned world; it is executed once, in
the world as it is, and PASSES when every check of the toolkit's own verdict does.
"""

COLUMNS = (
    "world",
    "trials",
    "surfaces",
    "found",
    "invented",
    "normal median [deg]",
    "normal max [deg]",
    "offset median [mm]",
    "offset max [mm]",
    "area found",
    "explained",
    "planned",
    "PASS",
    "slip max [cm]",
    "scan processor time max [s]",
    "triangles max",
)


def summarise(kind: str, records: Sequence[Record]) -> dict[str, Any]:
    """One row of the table."""
    angles, offsets, shares = (
        [v for r in records for v in r.get(name, [])] for name in ("angles", "offsets", "shares")
    )
    return {
        "kind": kind,
        "trials": len(records),
        "surfaces": int(sum(values(records, "surfaces"))),
        "found": int(sum(values(records, "found"))),
        "invented": int(sum(values(records, "invented"))),
        "angle_median": median(angles),
        "angle_max": largest(angles),
        "offset_median": median(offsets),
        "offset_max": largest(offsets),
        "share": mean(shares),
        "explained": mean(values(records, "explained")),
        "planned": sum(bool(record.get("planned")) for record in records),
        "passed": sum(bool(record["passed"]) for record in records),
        "max_slip": largest(values(records, "max_slip")),
        "scan_processor_seconds": largest(values(records, "scan_processor_seconds")),
        "triangles": largest(values(records, "triangles")),
    }


def table(summaries: Sequence[dict[str, Any]]) -> str:
    """The table in Markdown."""
    rows = [
        (
            row["kind"],
            *(str(row[name]) for name in ("trials", "surfaces", "found", "invented")),
            *(number(row[name], ".2f") for name in ("angle_median", "angle_max")),
            *(number(in_unit(row[name], 1e3), ".1f") for name in ("offset_median", "offset_max")),
            *(number(row[name], ".1%") for name in ("share", "explained")),
            *(str(row[name]) for name in ("planned", "passed")),
            number(in_unit(row["max_slip"], 100), ".2f"),
            number(row["scan_processor_seconds"], ".1f"),
            number(row["triangles"], ".0f"),
        )
        for row in summaries
    ]
    return markdown_table(COLUMNS, rows)


def goals_of(summaries: Sequence[dict[str, Any]]) -> list[Goal]:
    """What is asked of each kind of world."""
    found = []
    for row in summaries:
        share = row["found"] / row["surfaces"] if row["surfaces"] else None
        found.append(goals.at_least(f"{row['kind']}: share of the surfaces found", share, 0.9))
        if row["planned"]:
            found.append(goals.count(f"{row['kind']}: executed as planned", row["passed"], row["trials"], 8, 10))
        found.append(
            goals.at_most(f"{row['kind']}: processor time of a scan", row["scan_processor_seconds"], 10.0, "s")
        )
    return found


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("scan", DESCRIPTION, ["rubble_field"], 10)
    parser.add_argument(
        "--spacing", type=cli.positive(float), default=0.015, metavar="M", help="of the rays (default: %(default)s)"
    )
    parser.add_argument(
        "--noise", type=cli.at_least_zero, default=0.02, metavar="M", help="along each axis (default: %(default)s)"
    )
    parser.add_argument(
        "--holes", type=cli.at_least_zero, default=0.05, metavar="X", help="share that is lost (default: %(default)s)"
    )
    parser.add_argument("--surfaces-only", action="store_true", help="make no plans")
    args = parser.parse_args(argv)
    console = make_console()
    settings = options.settings_of(args)
    scanning = ScanSettings(args.spacing, args.noise, args.holes, not args.surfaces_only)
    own = {"spacing": args.spacing, "noise": args.noise, "holes": args.holes, "surfaces_only": args.surfaces_only}
    cases = make_cases(args.kinds, args.trials, args.seed_offset)
    store = TrialFile(args.out / "trials.jsonl", settings.deciding() | {key: str(value) for key, value in own.items()})
    jobs = [Job(case.name, scan_trial, (settings, scanning, case)) for case in cases]
    records = run_jobs(jobs, store, options.pool_of(args), console, "trials")
    by_kind = {kind: [r for r, c in zip(records, cases, strict=True) if c.kind == kind] for kind in args.kinds}
    summaries = [summarise(kind, found) for kind, found in by_kind.items()]
    path = write_results(
        args.results,
        "scan",
        title="Plans made in scanned worlds",
        sections=[("Table", table(summaries)), ("Failures", failure_section(records))],
        content={"table": summaries, "trials": records},
        goals=goals_of(summaries),
        settings={**settings.described(), **own, "trials": args.trials, "seed_offset": args.seed_offset},
    )
    show_results(console, path)
    return 0 if all(record["passed"] for record in records) else 1


if __name__ == "__main__":
    cli.run(main)
