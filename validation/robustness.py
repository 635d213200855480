"""What disturbances a run survives: `python -m validation.robustness`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from toolkit import cli
from toolkit.errors import ToolkitError
from toolkit.execution.disturbance import Disturbance
from toolkit.execution.run import execute
from toolkit.pipeline import PipelineConfig, PipelineResult
from toolkit.report.console import make_console
from toolkit.wholebody.plan import WholeBodyPlan
from validation import goals, options
from validation.cases import Case, make_cases
from validation.goals import Goal
from validation.jobs import Job, Record, reason_of, run_jobs
from validation.options import TrialSettings
from validation.run_trial import held_within, keep_run, run_pipeline
from validation.tables import (
    failure_counts,
    in_unit,
    largest,
    markdown_table,
    mean,
    number,
    show_results,
    values,
    write_results,
)
from validation.trial_file import TrialFile

DESCRIPTION = """\
Plan once through each of ten random rubble fields, then execute the plan under each disturbance alone: pushes, body
mass, friction, surfaces that lie elsewhere, delay. A run SURVIVES when the robot carries the plan out to its end and
stands in the goal; it HOLDS when moreover no stance slips 2 cm, nothing but soles and palms touches the world, and
torques and velocities stay within the limits; it PASSES when every check of the verdict does.
"""
NONE = "none"
DISTURBANCES = {
    "push of 60 N for 0.2 s": Disturbance(push=60.0, push_duration=0.2),
    "body mass +5 %": Disturbance(mass_error=0.05),
    "friction -10 %": Disturbance(friction_error=-0.10),
    "surfaces off by 1 cm and 2 deg": Disturbance(terrain_offset=0.01, terrain_tilt=float(np.radians(2.0))),
    "delay of 2 ms": Disturbance(delay=0.002),
}
MAGNITUDES = ("push", "mass_error", "friction_error", "terrain_offset", "terrain_tilt", "state_noise", "delay")
WANTED, OF = 8, 10


def scaled(disturbance: Disturbance, level: float) -> Disturbance:
    """A disturbance of `level` times the magnitude; durations stay."""
    return replace(disturbance, **{name: level * getattr(disturbance, name) for name in MAGNITUDES})


def sweep(levels: Sequence[float]) -> dict[str, Disturbance]:
    """No disturbance, then each one at each level."""
    found = {NONE: Disturbance()}
    for level in levels:
        suffix = "" if level == 1.0 else f", x {level:g}"
        found |= {f"{name}{suffix}": scaled(disturbance, level) for name, disturbance in DISTURBANCES.items()}
    return found


def robustness_trial(settings: TrialSettings, case: Case, levels: Sequence[float]) -> dict[str, Any]:
    """A record: one field, planned once and executed under each disturbance."""
    world = case.world()
    record: dict[str, Any] = {"kind": case.kind, "seed": case.seed, "passed": False, "runs": {}}
    try:
        result, log = run_pipeline(settings, case, world, PipelineConfig(execution=settings.execution))
    except ToolkitError as error:
        return record | {"stage": "planning", "reason": reason_of(error)}
    trial = result.trial
    if trial is None or not isinstance(trial.plan, WholeBodyPlan) or not trial.plan.trajectory.feasible:
        return record | {"stage": "planning", "reason": result.reason, "stages": log.entries}
    for index, (name, disturbance) in enumerate(sweep(levels).items()):
        record["runs"][name] = disturbed_run(settings, case, result, trial.plan, disturbance, index)
    survived = all(run["survived"] for run in record["runs"].values())
    reasons = [f"{name}: {run['reason']}" for name, run in record["runs"].items() if not run["survived"]]
    return record | {
        "passed": survived,
        "stage": "done" if survived else "execution",
        "reason": "; ".join(reasons),
    }


def disturbed_run(
    settings: TrialSettings,
    case: Case,
    result: PipelineResult,
    plan: WholeBodyPlan,
    disturbance: Disturbance,
    index: int,
) -> dict[str, Any]:
    """One execution of the plan; a run that does not survive is kept."""
    try:
        execution = execute(
            plan,
            config=replace(settings.execution, disturbance=disturbance),
            rng=np.random.default_rng([case.seed, 1, index]),
        )
    except ToolkitError as error:
        return {"survived": False, "held": False, "passed": False, "reason": reason_of(error)}
    reason = "" if execution.failure is None else execution.failure.reason
    survived = execution.completed and not execution.fell and execution.goal_reached
    run: dict[str, Any] = {
        "survived": survived,
        "passed": not reason,
        "reason": reason,
        "fell": execution.fell,
        "max_slip": execution.max_slip,
        "max_scuff": execution.max_scuff,
        "max_torque_ratio": execution.max_torque_ratio,
        "max_velocity_ratio": execution.max_velocity_ratio,
        "com_rms_error": execution.com_rms_error,
        "unplanned_contacts": len(execution.unplanned_contacts),
        "simulated_seconds": execution.simulated_seconds,
    }
    run["held"] = survived and held_within(run)
    if not survived:
        assert result.trial is not None
        disturbed = replace(result.trial, execution=execution, failure=execution.failure)
        kept = replace(result, trial=disturbed, reason=reason)
        run["folder"] = keep_run(settings, case, kept, 0.0, f"{case.name}-disturbance{index}")
    return run


def summarise(names: Sequence[str], records: Sequence[Record]) -> list[dict[str, Any]]:
    """One row per disturbance; a field without a plan is a run that did not survive."""
    rows = []
    for name in names:
        runs = [
            record.get("runs", {}).get(name)
            or {"survived": False, "held": False, "passed": False, "reason": f"no plan: {record['reason']}"}
            for record in records
        ]
        survivors = [run for run in runs if run["survived"]]
        failed = [
            {"name": record["name"], "stage": "execution", **run}
            for record, run in zip(records, runs, strict=True)
            if not run["survived"]
        ]
        reasons = [{**run, "passed": False} for run in failed]
        rows.append(
            {
                "disturbance": name,
                "trials": len(runs),
                "survived": len(survivors),
                "held": sum(run["held"] for run in runs),
                "passed": sum(run["passed"] for run in runs),
                "max_slip": largest(values(survivors, "max_slip")),
                "com_rms_error": mean(values(survivors, "com_rms_error")),
                "reasons": [f"{count} x {reason}" for count, _, reason, _ in failure_counts(reasons)],
                "folders": [run["folder"] for run in failed if run.get("folder")],
            }
        )
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The rows in Markdown."""
    header = ("disturbance", "survived", "holds", "PASS", "slip max [cm]", "CoM RMS [mm]", "why the others did not")
    return markdown_table(
        header,
        [
            (
                row["disturbance"],
                f"{row['survived']} of {row['trials']}",
                f"{row['held']} of {row['trials']}",
                f"{row['passed']} of {row['trials']}",
                number(in_unit(row["max_slip"], 100), ".1f"),
                number(in_unit(row["com_rms_error"], 1e3), ".1f"),
                "; ".join(row["reasons"]),
            )
            for row in rows
        ],
    )


def goals_of(rows: Sequence[dict[str, Any]]) -> list[Goal]:
    """At least 8 of 10 under each disturbance alone."""
    asked = [row for row in rows if row["disturbance"] in DISTURBANCES]
    return [goals.count(row["disturbance"], row["survived"], row["trials"], WANTED, OF) for row in asked]


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("robustness", DESCRIPTION, ["rubble_field"], OF)
    cli.add_execution_options(parser)
    parser.add_argument(
        "--levels",
        type=cli.positive(float),
        nargs="+",
        default=[1.0],
        metavar="X",
        help="multiples of each disturbance to try (default: 1)",
    )
    args = parser.parse_args(argv)
    console = make_console()
    settings = options.settings_of(args)
    names = list(sweep(args.levels))
    described = {**settings.described(), "levels": " ".join(f"{level:g}" for level in args.levels)}
    store = TrialFile(args.out / "trials.jsonl", {**settings.deciding(), "disturbances": _described(args.levels)})
    cases = make_cases(args.kinds, args.trials, args.seed_offset)
    jobs = [Job(case.name, robustness_trial, (settings, case, tuple(args.levels))) for case in cases]
    records = run_jobs(jobs, store, options.pool_of(args), console, "fields")
    rows = summarise(names, records)
    runs = [f"- {row['disturbance']}: {', '.join(row['folders'])}" for row in rows if row["folders"]] or [
        "Every plan that was executed survived."
    ]
    path = write_results(
        args.results,
        "robustness",
        title="What disturbances a run survives",
        sections=[("Table", table(rows)), ("Runs that did not survive", "\n".join(runs))],
        content={"table": rows, "trials": records},
        goals=goals_of(rows),
        settings={**described, "trials": args.trials, "seed_offset": args.seed_offset},
    )
    show_results(console, path)
    return 0 if all(record["passed"] for record in records) else 1


def _described(levels: Sequence[float]) -> dict[str, dict[str, str]]:
    """The disturbances of a sweep, field by field."""
    return {
        name: {item.name: str(getattr(disturbance, item.name)) for item in fields(disturbance)}
        for name, disturbance in sweep(levels).items()
    }


if __name__ == "__main__":
    cli.run(main)
