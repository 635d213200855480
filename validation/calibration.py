"""Whether the search believes what the motion costs: `python -m validation.calibration`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from toolkit import cli
from toolkit.errors import InputError, PlanningError
from toolkit.report.console import make_console
from toolkit.report.files import read_json
from validation import goals, options
from validation.calibration_figures import PREDICTORS, world_figures
from validation.cases import DRAWN, Case, make_cases
from validation.fresh_seeds import add_seed_option
from validation.goals import Goal
from validation.jobs import Job, Record, reason_of, run_jobs
from validation.judged_again import CHAIN, Judge
from validation.options import TrialSettings
from validation.path_bounds import BoundCheck
from validation.run_trial import robot_of
from validation.searched import completed, search, with_expansions
from validation.tables import (
    columns,
    failure_section,
    in_unit,
    largest,
    markdown_table,
    median,
    number,
    show_results,
    write_results,
)
from validation.trial_file import TrialFile
from validation.truth import Truth

DESCRIPTION = """\
Hold what the search believes against what the motion costs. In fresh worlds of every kind, every sequence that the
planners return is optimised. Told are: how well the networks' sum ranks the sequences of a world by the J that is
executed, beside two rivals, the number of contacts and the duration; the line through the origin; how far the search's
favourite is from the truly best; what the networks reject although it is feasible, and return although it is not; and
whether h is a lower bound at every state of every path.
"""
KINDS = tuple(DRAWN)
PLANNERS = ("learned", "kinematic", "quasi-static")
OURS = PLANNERS[0]
EXPANSIONS, TRIALS = 10_000, 15
SEARCHES, OTHER_SEARCHES = 6, 2  # of our planner in each world, and of each other one
MORE_EXPANSIONS = 1_000  # of all searches but our first one
FEWEST = 20  # sequences of a world
COLUMNS = (
    "seed",
    "search",
    "search_cost",
    "judged",
    "objective",
    "paper_objective",
    "true_cost",
    "transitions",
    "walking_seconds",
)
COLUMNS += ("feasible", "rejected", "h_part", "h_true_part")
RANKS, LINE, REGRET, REJECTED, INFEASIBLE = 0.8, (0.9, 1.1), 0.05, 0.05, 0.05


def calibration_trial(settings: TrialSettings, case: Case, planner: str, search_number: int) -> Record:
    """A record: every sequence that one search returns in a world, with the networks' judgement and the truth."""
    robot, world = robot_of(settings.robot, settings.robots), case.world()
    record: Record = {"kind": case.kind, "seed": case.seed, "planner": planner, "stage": "planning"}
    record["search"] = search_number
    truth, judge = Truth(robot, world, settings.planning.timing), Judge(robot, world)
    try:
        searched = search(settings, world, planner, [case.seed, search_number], truth)
        bounds = BoundCheck(searched.planner)
    except PlanningError as error:
        return record | {"found": False, "passed": False, "reason": reason_of(error), "entries": []}
    entries = []
    for tested in searched.tested:
        entry, plan = tested.record(), tested.outcome.plan
        if planner == OURS:
            path = bounds(tested)
            entry["h_violations"], entry["states"] = path.violations, len(path.h)
            entry["h_part"], entry["h_true_part"] = path.largest_part, path.largest_true_part
        if tested.outcome.feasible and plan.sequence.transitions:
            judged = judge(tested.solution.sequence, plan)
            entry |= {"judged": judged.objective, "rejected": judged.rejected, "com_error": judged.com_error}
        entries.append(entry)
    summary = searched.summary()
    reason = summary["reason"] or (entries[-1]["reason"] if entries else "")
    return record | summary | {"passed": summary["feasible"], "reason": reason, "entries": entries}


def summarise(kind: str, records: Sequence[Record], fewest: int) -> dict[str, Any]:
    """One row: medians over the worlds of a kind with at least so many comparable sequences."""
    of_world: dict[int, list[Record]] = {}
    for record in records:
        of_world.setdefault(record["seed"], []).append(record)
    worlds = [world_figures(same, OURS) for same in of_world.values()]
    counted = [world for world in worlds if world.sequences >= fewest]
    ours = [entry for record in records if record["planner"] == OURS for entry in record["entries"]]
    feasible = [entry for record in records for entry in record["entries"] if "rejected" in entry]
    judged, rejected = sum(entry["transitions"] for entry in feasible), sum(entry["rejected"] for entry in feasible)
    row: dict[str, Any] = {
        "kind": kind,
        "worlds": len(worlds),
        "counted": len(counted),
        "sequences": sum(world.sequences for world in worlds),
        "line": median([ratio for world in worlds for ratio in world.ratios]),
        "regret": median(_known(world.regret for world in worlds)),
        "worst_regret": largest(_known(world.regret for world in worlds)),
        "returned": len(ours),
        "infeasible": sum(not entry["feasible"] for entry in ours),
        "judged": judged,
        "rejected": rejected,
        "com_error": median(_known(entry["com_error"] for entry in feasible)),
        "paths": len(ours),
        "states": sum(entry["states"] for entry in ours),
        "h_violations": sum(entry["h_violations"] for entry in ours),
        "h_part": largest([entry["h_part"] for entry in ours]),
        "h_true_part": largest([entry["h_true_part"] for entry in ours]),
    }
    for name in PREDICTORS:
        row[f"ranks_{name}"] = median(_known(world.ranks[name] for world in counted))
        row[f"regret_{name}"] = median(_known(world.regrets[name] for world in worlds))
    return row


def _known(numbers: Any) -> list[float]:
    """The numbers that are there."""
    return [number for number in numbers if number is not None]


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Ranks, line and regret of each kind of world."""
    header = ("world", "worlds", "with enough sequences", "sequences", "rank correlation", "of contacts", "of duration")
    header += ("J / predicted", "favourite above the best", "worst world", "by contacts", "by duration")
    cells = (
        (
            row["kind"],
            *(str(row[name]) for name in ("worlds", "counted", "sequences")),
            *(number(row[f"ranks_{name}"], ".2f") for name in PREDICTORS),
            number(row["line"], ".2f"),
            *(number(row[name], ".1%") for name in ("regret", "worst_regret", "regret_contacts", "regret_duration")),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def feasibility_table(rows: Sequence[dict[str, Any]]) -> str:
    """What the networks reject and let pass, and the bound."""
    header = ("world", "feasible transitions judged", "rejected", "sequences returned", "infeasible")
    header += (f"CoM after {CHAIN} predictions [cm]", "states on paths", "h above cost to go", "largest h / cost to go")
    header += ("largest h / true cost to go",)
    cells = (
        (
            row["kind"],
            str(row["judged"]),
            _share(row["rejected"], row["judged"]),
            str(row["returned"]),
            _share(row["infeasible"], row["returned"]),
            number(in_unit(row["com_error"], 100), ".2f"),
            str(row["states"]),
            str(row["h_violations"]),
            number(row["h_part"], ".3f"),
            number(row["h_true_part"], ".3f"),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def _share(count: int, of: int) -> str:
    return f"{count} ({count / of:.1%})" if of else "-"


def goals_of(rows: Sequence[dict[str, Any]]) -> list[Goal]:
    """What is asked of every kind of world, and of all together."""
    found = []
    for row in rows:
        name = row["kind"]
        found += [
            goals.at_least(f"{name}: rank correlation within a world, median", row["ranks_predicted"], RANKS),
            goals.at_least(f"{name}: J over the prediction", row["line"], LINE[0]),
            goals.at_most(f"{name}: J over the prediction", row["line"], LINE[1]),
            goals.at_most(
                f"{name}: favourite above the truly best, median", in_unit(row["regret"], 100), 100 * REGRET, "%"
            ),
        ]
    for name, part, whole, limit in (
        ("transitions of feasible sequences that are rejected", "rejected", "judged", REJECTED),
        ("returned sequences that are infeasible", "infeasible", "returned", INFEASIBLE),
    ):
        of = sum(row[whole] for row in rows)
        share = 100 * sum(row[part] for row in rows) / of if of else None
        found.append(goals.at_most(name, share, 100 * limit, "%"))
    states = sum(row["states"] for row in rows)
    above = sum(row["h_violations"] for row in rows)
    found.append(goals.every("states whose h is at most the cost to go", states - above, states))
    return found


def _earlier(path: Path) -> tuple[str, str]:
    """Heading and tables of a result of another state of the code.

    Raises:
        InputError: The file is no such result.
    """
    found = read_json(path)
    try:
        text = f"{table(found['table'])}\n\n{feasibility_table(found['table'])}"
        return f"The same, measured on {found['date']} with code {found['code']}", text
    except (KeyError, TypeError, IndexError):
        raise InputError(f"{path}: is no calibration.json of this program; choose another --beside") from None


def _kept(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Every sequence of every search, as lists by kind of world and planner."""
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        rows = [{"seed": record["seed"], "search": record["search"], **entry} for entry in record["entries"]]
        groups.setdefault((record["kind"], record["planner"]), []).extend(rows)
    return [{"kind": kind, "planner": planner, **columns(rows, COLUMNS)} for (kind, planner), rows in groups.items()]


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("calibration", DESCRIPTION, KINDS, TRIALS)
    parser.set_defaults(expansions=EXPANSIONS, time_limit=600.0, planner=OURS)
    add_seed_option(parser)
    parser.add_argument(
        "--searches",
        type=cli.positive(int),
        default=SEARCHES,
        metavar="N",
        help="searches with the networks in each world; only the first one's favourite counts (default: %(default)s)",
    )
    parser.add_argument(
        "--more-expansions",
        type=cli.positive(int),
        default=MORE_EXPANSIONS,
        metavar="N",
        help="expansions of all searches but the first one with the networks (default: %(default)s)",
    )
    parser.add_argument(
        "--beside", type=cli.path, metavar="FILE", help="calibration.json of another state, shown beside this one"
    )
    parser.add_argument(
        "--fewest",
        type=cli.positive(int),
        default=FEWEST,
        metavar="N",
        help="worlds with fewer comparable sequences have no rank correlation (default: %(default)s)",
    )
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    before = None if args.beside is None else _earlier(Path(args.beside))
    console = make_console()
    settings, first = options.settings_of(args), options.first_seed(args, "calibration")
    cases = [
        (case, planner, number)
        for case in make_cases(args.kinds, args.trials, first)
        for planner in PLANNERS
        for number in range(args.searches if planner == OURS else OTHER_SEARCHES)
    ]
    less = with_expansions(settings, args.more_expansions)
    store = TrialFile(args.out / "trials.jsonl", settings.deciding() | {"more_expansions": args.more_expansions})
    jobs = [
        Job(
            f"{planner}-{case.name}-{number}",
            calibration_trial,
            (settings if (planner, number) == (OURS, 0) else less, case, planner, number),
        )
        for case, planner, number in cases
    ]
    records = run_jobs(jobs, store, options.pool_of(args), console, "searches")
    records = [
        record | {"search": number}
        for record, (*_, number) in zip(
            completed(records, [case[:2] for case in cases], {"entries": []}), cases, strict=True
        )
    ]
    rows = []
    for kind in args.kinds:
        rows.append(summarise(kind, [record for record in records if record["kind"] == kind], args.fewest))
    found = goals_of(rows)
    sections = [("Ranks, line and favourite", f"{table(rows)}\n\n{NOTE}")]
    sections.append(("Feasibility and bound", feasibility_table(rows)))
    if before is not None:
        sections.append(before)
    path = write_results(
        args.results,
        "calibration",
        title="What the search believes, and what the motion costs",
        sections=[*sections, ("Failures", failure_section(records))],
        content={"table": rows, "sequences": _kept(records)},
        goals=found,
        settings={**settings.described(), "trials": args.trials, "searches": args.searches}
        | {"more_expansions": args.more_expansions, "seed_offset": first},
    )
    show_results(console, path)
    return options.goal_code(found)


NOTE = (
    "Rank correlations (Spearman) are within a world, over the feasible sequences of all planners that the networks "
    "accept; the median over worlds is told. J / predicted is the median of the ratios, a robust line through the "
    "origin. The favourite is the feasible sequence that the search holds for the cheapest; its true cost is compared "
    "with the least of those that the same search returned. The rivals choose the sequence with the fewest contacts, "
    "or the shortest one, and of several such the one that was found first."
)

if __name__ == "__main__":
    cli.run(main)
