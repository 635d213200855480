"""How often, how fast and how well the planner plans: `python -m validation.planning`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toolkit import cli
from toolkit.report.console import make_console
from validation import goals, growth, options
from validation.cases import kind_of, make_cases
from validation.goals import Goal
from validation.jobs import Job, Record, run_jobs
from validation.motion_figures import MotionFigures, pooled
from validation.plan_trial import plan_trial
from validation.tables import (
    failure_section,
    in_unit,
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
Plan through random rubble fields and corridors, the wide gap and the steep slope, with the planner and with the
quasi-static one, and set the figures beside the paper's: success, sequences tested, motions, times, growth.
"""
KINDS = ("rubble_field", "rubble_corridor", "wide_gap", "steep_slope_3m")
BASELINE = "quasi-static"
FIRST_SEQUENCE = {"rubble_field": 0.05, "rubble_corridor": 0.15, "wide_gap": 0.07, "steep_slope_3m": 0.3}  # s
PAPER_FIRST = {"rubble_field": 0.098, "wide_gap": 0.143, "steep_slope_3m": 0.702}  # s, i7-6700

_QUANTITIES = ("linear_momentum", "linear_momentum_rate", "angular_momentum", "angular_momentum_rate")
_QUANTITIES += ("force", "torque", "lateral_force", "cop_distance", "foot_cop_distance")
HEADER = (
    "world",
    "planner",
    "(1) planned",
    "(2) feasible",
    "(3) optimised for each feasible",
    "(4) objective",
    "(5) lin. momentum [kg m/s]",
    "(6) its rate [N]",
    "(7) ang. momentum [kg m²/s]",
    "(8) its rate [N m]",
    "(9) RMS force",
    "(10) torque [N m]",
    "(11) lateral force",
    "(12) CoP to edge [m]",
    "of the feet alone",
    "palm contacts",
)
PAPER = {
    "rubble_field": (
        "47/50 47/47 1.17 3498.5 12.0 12.7 0.472 0.706 0.767 0.012 0.062 0.0068",
        "50/50 50/50 1.02 3334.2 6.00 9.68 0.581 0.559 0.763 0.010 0.079 0.0079",
    ),
    "rubble_corridor": (
        "44/50 44/44 1.05 3418.7 11.5 11.16 0.523 0.618 0.768 0.013 0.082 0.0069",
        "50/50 49/50 1.59 2392.5 4.38 4.83 1.378 0.349 0.631 0.025 0.088 0.0173",
    ),
}


def summarise(kind: str, planner: str, records: Sequence[Record]) -> dict[str, Any]:
    """One row of the paper's table, and the times."""
    feasible = [record for record in records if record["feasible"]]
    found = [record for record in records if record["found"]]
    figures = pooled([MotionFigures(**record["figures"]) for record in feasible])
    return {
        "kind": kind,
        "planner": planner,
        "trials": len(records),
        "found": len(found),
        "feasible": len(feasible),
        "tested": mean(values(feasible, "tested")),
        "objective": mean(values(feasible, "objective")),
        "figures": None if figures is None else vars(figures),
        "palm_contacts": mean(values(feasible, "palm_contacts")),
        "transitions": mean(values(feasible, "transitions")),
        "first_seconds": median(values(found, "first_seconds")),
        "first_processor_seconds": median(values(found, "first_processor_seconds")),
        "first_optimiser_seconds": median(values(found, "first_optimiser_seconds")),
        "heuristic_seconds": median(values(records, "heuristic_seconds")),
        "heuristic_processor_seconds": median(values(records, "heuristic_processor_seconds")),
        "expansions_per_second": median(values(records, "expansions_per_second")),
        "optimiser_seconds": median(values(feasible, "optimiser_seconds")),
        "peak_memory": max(values(records, "peak_memory"), default=None),
        "repeatable": all(record.get("repeatable", True) for record in records),
        "repeated": sum("repeatable" in record for record in records),
    }


def paper_table(rows: Sequence[dict[str, Any]]) -> str:
    """The paper's twelve columns for each world and planner, its own figures below."""
    lines = []
    for row in rows:
        figures = row["figures"] or {}
        lines.append(
            (
                row["kind"],
                row["planner"],
                f"{row['found']}/{row['trials']}",
                f"{row['feasible']}/{row['found']}",
                number(row["tested"], ".2f"),
                number(row["objective"], ".1f"),
                *(number(figures.get(name), ".3g") for name in _QUANTITIES),
                number(row["palm_contacts"], ".1f"),
            )
        )
    for kind in dict.fromkeys(row["kind"] for row in rows if row["kind"] in PAPER):
        for planner, text in zip(("the paper, quasi-static", "the paper, learned"), PAPER[kind], strict=True):
            lines.append((kind, planner, *text.split(), "-", "-"))
    return markdown_table(HEADER, lines)


def time_table(rows: Sequence[dict[str, Any]]) -> str:
    """Times of the searches; processor times leave out what other programs took on a loaded machine."""
    header = (
        "world",
        "planner",
        "first feasible sequence, median [ms]",
        "the same, processor time [ms]",
        "its optimisation [ms]",
        "the paper [ms]",
        "heuristic [ms]",
        "the same, processor time [ms]",
        "expansions per s",
        "whole-sequence optimisation [s]",
        "peak memory [MB]",
    )
    lines = []
    for row in rows:
        paper = PAPER_FIRST.get(row["kind"]) if row["planner"] != BASELINE else None
        names = ("first_seconds", "first_processor_seconds", "heuristic_seconds", "heuristic_processor_seconds")
        first, processor, heuristic, heuristic_processor = (number(in_unit(row[name], 1e3), ".0f") for name in names)
        lines.append(
            (
                row["kind"],
                row["planner"],
                first,
                processor,
                number(in_unit(row["first_optimiser_seconds"], 1e3), ".0f"),
                number(in_unit(paper, 1e3), ".0f"),
                heuristic,
                heuristic_processor,
                number(row["expansions_per_second"], ".0f"),
                number(row["optimiser_seconds"], ".2f"),
                number(row["peak_memory"], ".0f"),
            )
        )
    return markdown_table(header, lines)


def goals_of(rows: Sequence[dict[str, Any]]) -> list[Goal]:
    """What is asked of our planner, and how it has to compare with the quasi-static one."""
    found = []
    ours = {row["kind"]: row for row in rows if row["planner"] != BASELINE}
    baseline = {row["kind"]: row for row in rows if row["planner"] == BASELINE}
    for kind, row in ours.items():
        of = 50 if kind_of(kind).random else 5
        found.append(goals.count(f"{kind}: contact sequence found", row["found"], row["trials"], of, of))
        found.append(goals.count(f"{kind}: dynamically feasible", row["feasible"], row["trials"], of, of))
        found.append(goals.at_most(f"{kind}: sequences optimised for each feasible one, average", row["tested"], 1.1))
        if kind in FIRST_SEQUENCE:
            name, limit = f"{kind}: time to first feasible sequence, median", 1e3 * FIRST_SEQUENCE[kind]
            found.append(goals.at_most(name, in_unit(row["first_seconds"], 1e3), limit, "ms"))
        found.append(goals.at_most(f"{kind}: heuristic, median", in_unit(row["heuristic_seconds"], 1e3), 150.0, "ms"))
    corridor = ours.get("rubble_corridor")
    if corridor is not None:
        found.append(goals.at_least("rubble_corridor: palm contacts, average", corridor["palm_contacts"], 0.5))
        found += _comparison(corridor["figures"], baseline.get("rubble_corridor", {}).get("figures"))
    for kind, row in baseline.items():
        if kind.startswith("steep_slope"):
            found.append(goals.at_most(f"{kind}: quasi-static plans", float(row["found"]), 0.0))
    repeated = [row for row in ours.values() if row["repeated"]]
    if repeated:
        same = sum(row["repeatable"] for row in repeated)
        found.append(goals.every("the same seed gives the same plan twice, worlds", same, len(repeated)))
    return found


def _comparison(figures: dict[str, float] | None, other: dict[str, float] | None) -> list[Goal]:
    """Goals for the motions of our plans beside those of the quasi-static ones."""
    names = {"linear_momentum": "mean linear momentum", "linear_momentum_rate": "mean linear momentum rate"}
    names |= {"angular_momentum_rate": "mean angular momentum rate", "cop_distance": "mean CoP distance to the edge"}
    names |= {"foot_cop_distance": "the same of the feet alone"}
    found = []
    for name, text in names.items():
        text = f"rubble_corridor: {text} against quasi-static"
        if figures is None or other is None:
            found.append(Goal(text, "better", "-", goals.NOT_CHECKED))
        elif name.endswith("cop_distance"):
            found.append(goals.at_least(text, figures[name], other[name]))
        else:
            found.append(goals.at_most(text, figures[name], other[name]))
    return found


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("planning", DESCRIPTION, KINDS, 50)
    parser.add_argument("--no-baseline", action="store_true", help="leave the quasi-static planner out")
    parser.add_argument("--lengths", type=cli.positive(float), nargs="*", default=[4.0, 8.0, 16.0, 32.0], metavar="M")
    parser.add_argument(
        "--growth-trials", type=cli.positive(int), default=24, metavar="N", help="trials of each length"
    )
    args = parser.parse_args(argv)
    console = make_console()
    settings = options.settings_of(args)
    planners: list[str] = list(dict.fromkeys([settings.planner, *([] if args.no_baseline else [BASELINE])]))
    cases = [(case, planner) for planner in planners for case in make_cases(args.kinds, args.trials, args.seed_offset)]
    store = TrialFile(args.out / "trials.jsonl", settings.deciding())
    jobs = [
        Job(f"{planner}-{case.name}", plan_trial, (settings, case, planner, case.seed == args.seed_offset))
        for case, planner in cases
    ]
    grown = growth.growth_jobs(settings, args)
    records = run_jobs([*jobs, *grown], store, options.pool_of(args), console, "plans")
    records, growing = records[: len(jobs)], records[len(jobs) :]
    rows = []
    for kind in args.kinds:
        for planner in planners:
            same = [
                record
                for record, (case, judged_by) in zip(records, cases, strict=True)
                if case.kind == kind and judged_by == planner
            ]
            rows.append(summarise(kind, planner, same))
    summary = growth.summarise(growing)
    limit = args.time_limit
    sections = [("The paper's table", paper_table(rows)), ("Times", time_table(rows))]
    if growing:
        sections.append(("Growth over the length of the rubble", growth.table(summary, limit)))
    path = write_results(
        args.results,
        "planning",
        title="Plans",
        sections=[*sections, ("Failures", failure_section([*records, *growing]))],
        content={"table": rows, "growth": summary, "trials": [*records, *growing]},
        goals=[*goals_of(rows), *(growth.goals_of(summary, limit) if growing else [])],
        settings={**settings.described(), "trials": args.trials, "seed_offset": args.seed_offset},
    )
    show_results(console, path)
    ours = [record for record, (_, planner) in zip(records, cases, strict=True) if planner == settings.planner]
    return 0 if all(record["passed"] for record in ours) else 1


if __name__ == "__main__":
    cli.run(main)
