"""What a longer search buys: `python -m validation.budgets`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toolkit import cli
from toolkit.errors import PlanningError
from toolkit.report.console import make_console
from validation import goals, options
from validation.cases import Case, make_cases
from validation.fresh_seeds import add_seed_option
from validation.goals import Goal
from validation.jobs import Job, Record, reason_of, run_jobs
from validation.options import TrialSettings
from validation.path_bounds import BoundCheck
from validation.run_trial import robot_of
from validation.searched import Searched, cheapest, completed, favourite, search, with_expansions
from validation.tables import (
    failure_section,
    in_unit,
    largest,
    markdown_table,
    median,
    number,
    show_results,
    values,
    write_results,
)
from validation.trial_file import TrialFile
from validation.truth import Truth

DESCRIPTION = """\
Search fresh worlds with ever larger budgets, the same seed each time, and price what comes out: the true cost of the
search's favourite and of the choice among all that it returned, the bound of ANA*, and how long the first sequence
takes that the whole-sequence optimiser calls feasible.
"""
KINDS = ("rubble_field", "rubble_corridor", "any_stairs", "any_stones", "any_gap", "any_slope", "steep_slope_3m")
BUDGETS = (100, 1_000, 10_000)
BOUND_AT, BOUND = 1_000, 4.0
BETTER, WORSE = 0.95, 1.02  # true cost with the largest budget over that with the least; with a larger one in any world
FIRST_FEASIBLE = {"rubble_field": 0.15, "rubble_corridor": 0.25, "any_gap": 0.1, "steep_slope_3m": 0.7}  # s
CHOICES = {"favourite": favourite, "choice": cheapest}


def budget_trial(settings: TrialSettings, case: Case, budgets: Sequence[int]) -> Record:
    """A record: searches of one world with several budgets."""
    robot, world = robot_of(settings.robot, settings.robots), case.world()
    record: Record = {"kind": case.kind, "seed": case.seed, "planner": settings.planner, "stage": "planning"}
    truth, by_budget, violations, states = Truth(robot, world, settings.planning.timing), {}, 0, 0
    for budget in budgets:
        try:
            searched = search(with_expansions(settings, budget), world, settings.planner, [case.seed, 0], truth)
            check = BoundCheck(searched.planner)
        except PlanningError as error:
            record |= {"found": False, "feasible": False, "passed": False, "budgets": {}}
            return record | {"reason": reason_of(error)}
        by_budget[str(budget)] = _described(searched)
        paths = [check(tested) for tested in searched.tested]
        violations, states = violations + sum(p.violations for p in paths), states + sum(len(p.h) for p in paths)
    last = searched.summary()
    reason = last["reason"] or ("" if last["feasible"] else searched.tested[-1].outcome.record()["reason"])
    return (
        record
        | last
        | {
            "passed": last["feasible"],
            "stage": "done" if last["feasible"] else "dynamics" if last["found"] else "planning",
            "reason": reason,
            "budgets": by_budget,
            "h_violations": violations,
            "states": states,
        }
    )


def _described(searched: Searched) -> dict[str, Any]:
    """Figures of one search; true costs are None where no sequence is feasible."""
    chosen = {name: choose(searched.tested) for name, choose in CHOICES.items()}
    costs = {name: None if item is None else item.outcome.cost.total for name, item in chosen.items()}
    return searched.summary() | costs


def summarise(kind: str, budget: int, records: Sequence[Record], budgets: Sequence[int]) -> dict[str, Any]:
    """One row: a budget in a kind of world; ratios are over the next smaller and over the smallest budget."""
    found = [record["budgets"].get(str(budget), {}) for record in records]
    row: dict[str, Any] = {"kind": kind, "budget": budget, "trials": len(records)}
    row["feasible"] = sum(bool(item.get("feasible")) for item in found)
    for name in ("sequences", "bound", "first_feasible_seconds", "first_feasible_processor_seconds", "search_seconds"):
        row[name] = median(values(found, name))
    row["heuristic_seconds"] = median(values(found, "heuristic_seconds"))
    smaller = [other for other in budgets if other < budget]
    for name in CHOICES:
        row[name] = median(values(found, name))
        row[f"{name}_over_smallest"] = median(_ratios(records, budget, min(budgets), name))
        row[f"{name}_worst"] = largest([ratio for other in smaller for ratio in _ratios(records, budget, other, name)])
    return row


def _ratios(records: Sequence[Record], budget: int, other: int, name: str) -> list[float]:
    """True cost with a budget over that with another one, in the worlds that have both."""
    pairs = [[record["budgets"].get(str(each), {}).get(name) for each in (budget, other)] for record in records]
    return [mine / theirs for mine, theirs in pairs if mine is not None and theirs is not None]


def table(rows: Sequence[dict[str, Any]]) -> str:
    """A row per kind of world and budget."""
    header = ("world", "expansions", "feasible", "sequences", "bound", "search [s]")
    for name in CHOICES:
        header += (f"{name}: true cost", "over the smallest budget", "over any smaller, worst world")
    header += ("first feasible sequence [ms]", "the same, processor time [ms]", "heuristic [ms]")
    cells = (
        (
            row["kind"],
            str(row["budget"]),
            f"{row['feasible']}/{row['trials']}",
            *(number(row[name], form) for name, form in (("sequences", ".0f"), ("bound", ".1f"))),
            number(row["search_seconds"], ".2f"),
            *(
                number(row[name + end], form)
                for name in CHOICES
                for end, form in (("", ".0f"), ("_over_smallest", ".3f"), ("_worst", ".3f"))
            ),
            *(
                number(in_unit(row[name], 1e3), ".0f")
                for name in ("first_feasible_seconds", "first_feasible_processor_seconds", "heuristic_seconds")
            ),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def goals_of(rows: Sequence[dict[str, Any]], records: Sequence[Record]) -> list[Goal]:
    """Longer is better, the bound is tight, and the first feasible sequence comes soon."""
    found, budgets = [], sorted({row["budget"] for row in rows})
    for name in CHOICES if len(budgets) > 1 else ():
        ratio = median(_ratios(records, budgets[-1], budgets[0], name))
        text = f"{name}: true cost at {budgets[-1]} expansions over that at {budgets[0]}, median"
        found.append(goals.at_most(text, ratio, BETTER))
        worst = largest([row[f"{name}_worst"] for row in rows if row[f"{name}_worst"] is not None])
        found.append(goals.at_most(f"{name}: true cost over that of any smaller budget, worst world", worst, WORSE))
    bounds = [record["budgets"].get(str(BOUND_AT), {}) for record in records]
    text = f"bound of ANA* at {BOUND_AT} expansions, median of all worlds"
    found.append(goals.at_most(text, median(values(bounds, "bound")), BOUND))
    for row in rows:
        if row["budget"] == budgets[-1] and row["kind"] in FIRST_FEASIBLE:
            name, limit = f"{row['kind']}: first feasible sequence, median", 1e3 * FIRST_FEASIBLE[row["kind"]]
            found.append(goals.at_most(name, in_unit(row["first_feasible_seconds"], 1e3), limit, "ms"))
    states = sum(record.get("states", 0) for record in records)
    above = sum(record.get("h_violations", 0) for record in records)
    return [*found, goals.every("states on paths whose h is at most the cost to go", states - above, states)]


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("budgets", DESCRIPTION, KINDS, 20)
    parser.set_defaults(time_limit=600.0)
    add_seed_option(parser)
    parser.add_argument(
        "--expansions",
        type=cli.positive(int),
        nargs="+",
        default=list(BUDGETS),
        metavar="N",
        help=f"budgets of the search (default: {' '.join(map(str, BUDGETS))})",
    )
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    budgets, args.expansions = sorted(set(args.expansions)), None
    console = make_console()
    settings, first = options.settings_of(args), options.first_seed(args, "budgets")
    cases = make_cases(args.kinds, args.trials, first)
    store = TrialFile(args.out / "trials.jsonl", settings.deciding() | {"budgets": budgets})
    jobs = [Job(case.name, budget_trial, (settings, case, budgets)) for case in cases]
    records = run_jobs(jobs, store, options.pool_of(args), console, "worlds")
    records = completed(records, [(case, settings.planner) for case in cases], {"budgets": {}})
    rows = [
        summarise(kind, budget, [record for record in records if record["kind"] == kind], budgets)
        for kind in args.kinds
        for budget in budgets
    ]
    found = goals_of(rows, records)
    path = write_results(
        args.results,
        "budgets",
        title="What a longer search buys",
        sections=[("Budgets", f"{table(rows)}\n\n{NOTE}"), ("Failures", failure_section(records))],
        content={"table": rows, "trials": records},
        goals=found,
        settings={**settings.described(), "budgets": budgets, "trials": args.trials, "seed_offset": first},
    )
    show_results(console, path)
    return options.goal_code(found)


NOTE = (
    "The favourite is the feasible sequence that the search holds for the cheapest, the choice the truly cheapest of "
    "all that it returned. Bound: of the last sequence, when it was found. First feasible sequence: search and "
    "optimisations in turn until the optimiser calls a sequence feasible, without the heuristic, "
    "whose time stands beside it."
)

if __name__ == "__main__":
    cli.run(main)
