"""The same world elsewhere, turned and moved: `python -m validation.turned`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit import cli, pipeline
from toolkit.errors import PlanningError
from toolkit.report.console import make_console
from toolkit.world.loader import load_world
from validation import goals, options
from validation.cases import Case, make_cases
from validation.fresh_seeds import add_seed_option
from validation.goals import Goal
from validation.jobs import Job, Record, reason_of, run_jobs
from validation.map_worlds import anywhere
from validation.options import TrialSettings
from validation.run_trial import make_planner, robot_of
from validation.tables import failure_section, largest, markdown_table, median, number, show_results, write_results
from validation.trial_file import TrialFile

DESCRIPTION = """\
Plan and execute worlds as they are, and copies of each that are moved by up to 100 m and turned by any angle, with the
same seed. A plan must not depend on where the world lies: copies pass alike, at nearly the same true cost.
"""
KINDS = ("rubble_field", "rubble_corridor", "any_stairs", "any_stones", "any_gap")
COPIES = 10
MEDIAN, MOST = 0.05, 0.15  # deviation of a copy's true cost from that of the world itself


def turned_trial(settings: TrialSettings, case: Case, copy: int) -> Record:
    """The record of one copy of a case's world; copy 0 is the world itself."""
    mjcf = case.mjcf()
    if copy:
        mjcf = anywhere(mjcf, np.random.default_rng([case.seed, copy]))
    world = load_world(Path(f"{case.name}-copy{copy}.xml"), mjcf=mjcf)
    record: Record = {"kind": case.kind, "seed": case.seed, "copy": copy, "passed": False, "cost": None}
    config = pipeline.PipelineConfig(
        seed=case.seed, time_limit=settings.planning.time_limit, execution=settings.execution
    )
    try:
        robot = robot_of(settings.robot, settings.robots)
        result = pipeline.run(robot, world, make_planner(settings, world), config)
    except PlanningError as error:
        return record | {"stage": "planning", "reason": reason_of(error)}
    cost = None if result.cost is None else result.cost.total
    return record | {"stage": result.stage, "reason": result.reason, "passed": result.passed, "cost": cost}


def deviations(records: Sequence[Record]) -> list[float]:
    """|cost / cost of the world itself - 1| of all copies that passed as the world itself did."""
    own = {(r["kind"], r["seed"]): r["cost"] for r in records if r["copy"] == 0 and r["passed"]}
    pairs = ((r["cost"], own.get((r["kind"], r["seed"]))) for r in records if r["copy"] and r["passed"])
    return [abs(cost / base - 1.0) for cost, base in pairs if base is not None]


def summarise(kind: str, records: Sequence[Record]) -> dict[str, Any]:
    """One row: a kind of world."""
    found = deviations(records)
    own = {r["seed"]: r["passed"] for r in records if r["copy"] == 0}
    copies = [r for r in records if r["copy"]]
    return {
        "kind": kind,
        "worlds": len(own),
        "passed": sum(own.values()),
        "copies": len(copies),
        "copies_passed": sum(r["passed"] for r in copies),
        "alike": sum(r["passed"] == own[r["seed"]] for r in copies),
        "median": median(found),
        "most": largest(found),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """A row per kind of world."""
    header = ("world", "PASS", "copies: PASS", "copies that end as the world does", "cost: median deviation", "largest")
    cells = (
        (
            row["kind"],
            f"{row['passed']}/{row['worlds']}",
            f"{row['copies_passed']}/{row['copies']}",
            f"{row['alike']}/{row['copies']}",
            number(row["median"], ".3f"),
            number(row["most"], ".3f"),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def goals_of(rows: Sequence[dict[str, Any]], records: Sequence[Record]) -> list[Goal]:
    """Copies end alike and cost the same."""
    found, copies = deviations(records), sum(row["copies"] for row in rows)
    return [
        goals.every("copies that end as the world itself does", sum(row["alike"] for row in rows), copies),
        goals.at_most("deviation of the true cost of a copy, median", median(found), MEDIAN),
        goals.at_most("deviation of the true cost of a copy, largest", largest(found), MOST),
    ]


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("turned", DESCRIPTION, KINDS, 2)
    add_seed_option(parser)
    parser.add_argument(
        "--copies",
        type=cli.positive(int),
        default=COPIES,
        metavar="N",
        help="copies of each world (default: %(default)s)",
    )
    cli.add_execution_options(parser)
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    console = make_console()
    settings, first = options.settings_of(args), options.first_seed(args, "turned")
    cases = make_cases(args.kinds, args.trials, first)
    store = TrialFile(args.out / "trials.jsonl", settings.deciding())
    trials = [(case, copy) for case in cases for copy in range(args.copies + 1)]
    jobs = [Job(f"{case.name}-copy{copy}", turned_trial, (settings, case, copy)) for case, copy in trials]
    records = [
        {"kind": case.kind, "seed": case.seed, "copy": copy, "passed": False, "cost": None, **record}
        for record, (case, copy) in zip(
            run_jobs(jobs, store, options.pool_of(args), console, "copies"), trials, strict=True
        )
    ]
    rows = [summarise(kind, [record for record in records if record["kind"] == kind]) for kind in args.kinds]
    found = goals_of(rows, records)
    path = write_results(
        args.results,
        "turned",
        title="The same world elsewhere",
        sections=[("Table", table(rows)), ("Failures", failure_section(records))],
        content={"table": rows, "trials": records},
        goals=found,
        settings={**settings.described(), "trials": args.trials, "seed_offset": first, "copies": args.copies},
    )
    show_results(console, path)
    return options.goal_code(found)


if __name__ == "__main__":
    cli.run(main)
