"""What one robot gets through, on terrain to its scale: `python -m validation.bodies --robot NAME`."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any

from toolkit import cli
from toolkit.report.console import make_console
from toolkit.robot.loader import load_robot
from toolkit.world.scaling import Fit
from validation import goals, options
from validation.cases import SCALED, kind_of, make_cases
from validation.goals import Goal
from validation.growing import add_growing_options, growth_note, stamped, state_of, take_over
from validation.jobs import Job, Record, run_jobs
from validation.run_trial import execution_trial
from validation.tables import (
    failure_section,
    in_unit,
    largest,
    markdown_table,
    number,
    show_results,
    values,
    write_results,
)
from validation.trial_file import TrialFile

DESCRIPTION = """\
Run the whole pipeline of one robot on rubble fields and corridors, stairs, stones, mesh ground, a gap and a slope.

All of it is to the scale of the robot's legs, and tiles are no steeper than its ankles follow; the kinds that end in
_20 are as steep as the paper's. The slope is 3 degrees below the friction angle. Every trial counts, also one without
a plan, and is a PASS where every check of the verdict is and plain MuJoCo replays the run.
"""

COLUMNS = (
    "world",
    "trials",
    "planned",
    "PASS",
    "transitions",
    "palm contacts",
    "runs with palms",
    "slip max [mm]",
    "torque / limit",
    "velocity / limit",
    "CoM RMS [mm]",
    "computing [s]",
    "commonest reason of failure",
)


def summarise(kind: str, records: Sequence[Record]) -> dict[str, Any]:
    """One row of the table; figures of executions are of the runs that passed."""
    passed = [record for record in records if record["passed"]]
    reasons = [str(record["reason"]) for record in records if not record["passed"]]
    palms = [int(value) for value in values(passed, "palm_contacts")]
    seconds = [sum(stage["seconds"] for stage in record["stages"]) for record in records if record.get("stages")]
    return {
        "kind": kind,
        "trials": len(records),
        "planned": sum(bool(record["planned"]) for record in records),
        "passed": len(passed),
        "transitions": statistics.median(values(passed, "transitions")) if passed else None,
        "palm_contacts": sum(palms),
        "runs_with_palms": sum(count > 0 for count in palms),
        "max_slip": largest(values(passed, "max_slip")),
        "max_torque_ratio": largest(values(passed, "max_torque_ratio")),
        "max_velocity_ratio": largest(values(passed, "max_velocity_ratio")),
        "com_rms_error": largest(values(passed, "com_rms_error")),
        "seconds": statistics.median(seconds) if seconds else None,
        "reason": statistics.mode(reasons) if reasons else "",
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The table in Markdown."""
    return markdown_table(
        COLUMNS,
        [
            (
                row["kind"],
                *(str(row[name]) for name in ("trials", "planned", "passed")),
                number(row["transitions"], ".0f"),
                str(row["palm_contacts"]),
                str(row["runs_with_palms"]),
                number(in_unit(row["max_slip"], 1e3), ".1f"),
                number(row["max_torque_ratio"], ".2f"),
                number(row["max_velocity_ratio"], ".2f"),
                number(in_unit(row["com_rms_error"], 1e3), ".1f"),
                number(row["seconds"], ".0f"),
                row["reason"] or "-",
            )
            for row in rows
        ],
    )


def goals_of(rows: Sequence[dict[str, Any]]) -> list[Goal]:
    """What is asked of each kind of world; the paper's tilts stand beside."""
    found = []
    for row in rows:
        if row["kind"].endswith("_20"):
            continue
        kind = kind_of(row["kind"])
        wanted, of = (23, 25) if kind.random and not kind.few else (5, 5)
        found.append(goals.count(f"{row['kind']}: PASS", row["passed"], row["trials"], wanted, of))
    return found


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("bodies", DESCRIPTION, list(SCALED), 25)
    parser.epilog = options.GOAL_CODES
    cli.add_execution_options(parser)
    add_growing_options(parser)
    parser.set_defaults(timing="auto")
    args = parser.parse_args(argv)
    console = make_console()
    settings = options.settings_of(args)
    robot = load_robot(args.robot, args.robots)
    fit = Fit.of(robot)
    cases = {case.name: case for case in make_cases(args.kinds, args.trials, args.seed_offset, fit)}
    described = {**settings.described(), "trials": args.trials, "seed_offset": args.seed_offset}
    store = TrialFile(args.out / f"{robot.name}.jsonl", settings.deciding())
    if args.grow:
        take_over(store, args.results / f"bodies_{robot.name}.json", described, cases)
    jobs = [Job(name, execution_trial, (settings, case)) for name, case in cases.items()]
    found = run_jobs(jobs, store, options.pool_of(args), console, "trials", args.minutes)
    records = stamped(found, state_of(settings))
    rows = [summarise(kind, [r for r in records if cases[r["name"]].kind == kind]) for kind in args.kinds]
    body = f"Lengths are {fit.factor:.2f} times the usual ones; tiles are at most {fit.tilt:.0f} degrees steep."
    goals_found = goals_of(rows)
    path = write_results(
        args.results,
        f"bodies_{robot.name}",
        title=f"What {robot.name} gets through",
        sections=[
            ("Terrain", body),
            ("Table", f"{table(rows)}\n\n{growth_note(records, len(cases), state_of(settings))}".strip()),
            ("Failures", failure_section(records)),
        ],
        content={"table": rows, "trials": records},
        goals=goals_found,
        settings=described,
    )
    show_results(console, path)
    return options.goal_code(goals_found)


if __name__ == "__main__":
    cli.run(main)
