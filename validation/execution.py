"""How many plans hold in simulation, on random and authored worlds: `python -m validation.execution`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toolkit import cli
from toolkit.execution.config import ExecutionConfig
from toolkit.report.console import make_console
from toolkit.robot.loader import load_robot
from toolkit.world.scaling import Fit
from validation import goals, options
from validation.cases import KINDS, kind_of, make_cases
from validation.goals import Goal
from validation.jobs import Job, Record, run_jobs
from validation.run_trial import execution_trial
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
Run the whole pipeline on random rubble fields and corridors, the wide gap and steep slopes, and count what arrives.

Every trial counts, also one without a plan. A trial HOLDS when the robot arrives, the run replays in plain MuJoCo,
no stance slips 2 cm, nothing but soles and palms touches the world, and torques and velocities stay within the
robot's limits; it PASSES when every check of the toolkit's own verdict does. Failures keep their reason and the folder
of their run with its recording. Generated terrain is to the scale of the robot's legs.
"""

COLUMNS = (
    "world",
    "trials",
    "planned",
    "dynamically feasible",
    "whole body",
    "arrived",
    "holds",
    "PASS",
    "planning max [s]",
    "slip max [cm]",
    "torque / limit",
    "velocity / limit",
    "unplanned contacts",
    "palm force error",
    "CoM RMS [mm]",
    "pace [m/s]",
    "real-time factor",
    "tick median [ms]",
    "tick 99 % [ms]",
)

PACES = {"flat": 0.4, "rubble_field": 0.2}
"""m/s; least paces where the planner chooses the timing."""
PLANNED_WITHIN = {"steep_slope_3m": 60.0}
"""s; longest time of all searches, optimisations and local searches of a run there."""


def summarise(kind: str, records: Sequence[Record]) -> dict[str, Any]:
    """One row of the table; slip, ratios and errors are of the runs that arrived."""
    arrived = [record for record in records if record.get("arrived")]
    ran = [record for record in records if record.get("real_time_factor") is not None]
    summary: dict[str, Any] = {"kind": kind, "trials": len(records)}
    for name in ("planned", "feasible", "wholebody", "arrived", "held", "passed"):
        summary[name] = sum(bool(record.get(name)) for record in records)
    return summary | {
        "planning_seconds": largest(values(records, "planning_seconds")),
        "max_slip": largest(values(arrived, "max_slip")),
        "max_torque_ratio": largest(values(arrived, "max_torque_ratio")),
        "max_velocity_ratio": largest(values(arrived, "max_velocity_ratio")),
        "unplanned_contacts": sum(values(ran, "unplanned_contacts")),
        "palm_runs": len(values(arrived, "palm_force_error")),
        "palm_force_error": mean(values(arrived, "palm_force_error")),
        "com_rms_error": mean(values(arrived, "com_rms_error")),
        "pace": median(values(arrived, "pace")),
        "real_time_factor": median(values(ran, "real_time_factor")),
        "tick_median": median(values(ran, "tick_median")),
        "tick_99": median(values(ran, "tick_99")),
    }


def table(summaries: Sequence[dict[str, Any]]) -> str:
    """The table in Markdown."""
    rows = [
        (
            row["kind"],
            *(str(row[name]) for name in ("trials", "planned", "feasible", "wholebody", "arrived", "held", "passed")),
            number(row["planning_seconds"], ".0f"),
            number(in_unit(row["max_slip"], 100), ".2f"),
            number(row["max_torque_ratio"], ".2f"),
            number(row["max_velocity_ratio"], ".2f"),
            f"{row['unplanned_contacts']:.0f}",
            "-" if row["palm_force_error"] is None else f"{row['palm_force_error']:.0%} ({row['palm_runs']} runs)",
            number(in_unit(row["com_rms_error"], 1e3), ".1f"),
            number(row["pace"], ".2f"),
            number(row["real_time_factor"], ".2f"),
            number(in_unit(row["tick_median"], 1e3), ".2f"),
            number(in_unit(row["tick_99"], 1e3), ".2f"),
        )
        for row in summaries
    ]
    return markdown_table(COLUMNS, rows)


def goals_of(summaries: Sequence[dict[str, Any]], auto: bool = False) -> list[Goal]:
    """What is asked of each kind of world, and of all together; more where the planner chooses the timing (`auto`)."""
    found = []
    for row in summaries:
        wanted, of = (45, 50) if kind_of(row["kind"]).random else (5, 5)
        found.append(goals.count(f"{row['kind']}: holds", row["held"], row["trials"], wanted, of))
        if auto and row["kind"] in PACES:
            found.append(goals.at_least(f"{row['kind']}: pace, median", row["pace"], PACES[row["kind"]], "m/s"))
        if auto and row["kind"] in PLANNED_WITHIN:
            limit = PLANNED_WITHIN[row["kind"]]
            found.append(goals.at_most(f"{row['kind']}: planning, longest", row["planning_seconds"], limit, "s"))
    held = {
        "slip of any one stance": ("max_slip", ExecutionConfig().slip_limit, "m"),
        "torque over its limit": ("max_torque_ratio", 1.0, ""),
        "velocity over its limit": ("max_velocity_ratio", 1.0, ""),
        "palm force error": ("palm_force_error", 0.2, ""),
        "controller tick, median": ("tick_median", 0.5e-3, "s"),
        "controller tick, 99th percentile": ("tick_99", 1e-3, "s"),
    }
    for name, (figure, limit, unit) in held.items():
        found.append(goals.at_most(f"{name}, worst kind of world", largest(values(summaries, figure)), limit, unit))
    factors = values(summaries, "real_time_factor")
    found.append(goals.at_least("real-time factor, worst kind of world", min(factors, default=None), 1.0))
    return found


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("execution", DESCRIPTION, list(KINDS), 50)
    cli.add_execution_options(parser)
    args = parser.parse_args(argv)
    console = make_console()
    settings = options.settings_of(args)
    cases = make_cases(args.kinds, args.trials, args.seed_offset, Fit.of(load_robot(args.robot, args.robots)))
    store = TrialFile(args.out / "trials.jsonl", settings.deciding())
    jobs = [Job(case.name, execution_trial, (settings, case)) for case in cases]
    records = run_jobs(jobs, store, options.pool_of(args), console, "trials")
    by_kind = {kind: [r for r, c in zip(records, cases, strict=True) if c.kind == kind] for kind in args.kinds}
    summaries = [summarise(kind, found) for kind, found in by_kind.items()]
    path = write_results(
        args.results,
        "execution",
        title="Plans that hold in simulation",
        sections=[("Table", table(summaries)), ("Failures", failure_section(records))],
        content={"table": summaries, "trials": records},
        goals=goals_of(summaries, args.timing == "auto"),
        settings={**settings.described(), "trials": args.trials, "seed_offset": args.seed_offset},
    )
    show_results(console, path)
    return 0 if all(record["passed"] for record in records) else 1


if __name__ == "__main__":
    cli.run(main)
