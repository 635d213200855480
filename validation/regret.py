"""How far returned plans are from the best known: `python -m validation.regret`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit import cli
from toolkit.errors import InputError, PlanningError
from toolkit.pipeline.candidate import refined_solution
from toolkit.refine import RefineConfig
from toolkit.refine.local_search import arrives
from toolkit.refine.variants import left_out
from toolkit.report.console import make_console
from toolkit.report.plan_file import read_plan, write_plan
from validation import goals, options
from validation.ablation import TIMING
from validation.cases import Case, make_cases
from validation.fresh_seeds import add_seed_option
from validation.goals import Goal
from validation.jobs import Job, Record, reason_of, run_jobs
from validation.options import TrialSettings
from validation.run_trial import robot_of
from validation.searched import Tested, cheapest, search
from validation.tables import (
    failure_section,
    largest,
    markdown_table,
    median,
    number,
    show_results,
    values,
    write_results,
)
from validation.trial_file import TrialFile
from validation.truth import Outcome, Truth

DESCRIPTION = """\
Compare the plan of a run (one search, choice by the true cost, local search) with the best plan known: that of several
planners and many seeds, followed by a long local search from the best of them. Also leave one or two contacts out of
the plan of the run, in every way that the screens allow and that still arrives, and see whether it gets cheaper. The
best plans are kept as files; with --known, those of earlier runs in the same worlds count as well.
"""
KINDS = ("rubble_field", "rubble_corridor")
PLANNERS = ("learned", "kinematic", "quasi-static")
MEDIAN, WORST = 1.05, 1.2  # true cost of the run's plan over the best known
FEWER = 0.98  # true cost with contacts left out over that of the plan


@dataclass(frozen=True)
class Effort:
    """What the best known plan is searched with.

    Attributes:
        seeds: Searches of each planner.
        starts: The truly cheapest sequences from which the local search starts.
        motions: Most motions that it optimises from each of them.
    """

    seeds: int = 10
    starts: int = 4
    motions: int = 1000


def regret_trial(settings: TrialSettings, case: Case, effort: Effort, known: Path | None) -> Record:
    """The record of one world; `known` is a folder with the best plans of earlier runs."""
    robot, world = robot_of(settings.robot, settings.robots), case.world()
    record: Record = {"kind": case.kind, "seed": case.seed, "passed": False, "stage": "planning"}
    truth, found = Truth(robot, world, settings.planning.timing), list[tuple[str, Tested]]()
    try:
        own = search(settings, world, settings.planner, [case.seed, 0], truth)
        for planner in PLANNERS:
            for index in range(effort.seeds):
                searched = search(settings, world, planner, [case.seed, index], truth)
                found += [(planner, tested) for tested in searched.tested if tested.outcome.feasible]
    except PlanningError as error:
        return record | {"reason": reason_of(error)}
    chosen = cheapest(own.tested)
    if chosen is None:
        return record | {"stage": "dynamics", "reason": own.result.reason or "no sequence of the run is feasible"}
    returned = _improved(truth, chosen, RefineConfig().optimisations)
    best, finder = returned, "the run itself"
    ranked = {tested.solution.sequence.identity: (planner, tested) for planner, tested in found}
    order = sorted(ranked.values(), key=lambda item: item[1].outcome.cost.total)
    for planner, tested in order[: effort.starts]:
        outcome = _improved(truth, tested, effort.motions)
        if outcome.cost.total < best.cost.total:
            best, finder = outcome, planner
    if known is not None and (plan := known / f"{case.name}.json").exists():
        outcome = truth(read_plan(plan))
        if outcome.cost.total < best.cost.total:
            best, finder = outcome, "an earlier run"
    shorter = left_out(returned.plan.sequence, chosen.screen)
    fewer = [truth(variant).cost.total for variant in shorter if arrives(variant, returned.plan)]
    place = settings.out / "known"
    place.mkdir(parents=True, exist_ok=True)
    write_plan(place / f"{case.name}.json", best.plan, refined_solution(best.plan, best.cost, 0.0))
    (place / f"{case.name}.xml").write_text(case.mjcf(), encoding="utf-8")
    return record | {
        "passed": True,
        "stage": "done",
        "reason": "",
        "returned": returned.cost.total,
        "known": best.cost.total,
        "finder": finder,
        "regret": returned.cost.total / best.cost.total,
        "variants": len(fewer),
        "fewer": min(fewer) / returned.cost.total if fewer else None,
        "transitions": [len(plan.sequence.transitions) for plan in (returned.plan, best.plan)],
    }


def _improved(truth: Truth, tested: Tested, motions: int) -> Outcome:
    """What the local search makes of an optimised sequence."""
    return truth.improved(tested.outcome.plan, tested.solution.sequence, tested.screen, motions)


def check_known(folder: Path | None, cases: Sequence[Case]) -> None:
    """Make sure that the plans of earlier runs are of the same worlds.

    Raises:
        InputError: There is no plan of any of the worlds, or a world of that name was another one.
    """
    if folder is None:
        return
    worlds = [(case, folder / f"{case.name}.xml") for case in cases]
    if not any(path.exists() for _, path in worlds):
        raise InputError(f"--known {folder}: holds no plan of these worlds; choose them by --kinds and --seed-offset")
    for case, path in worlds:
        if path.exists() and path.read_text(encoding="utf-8") != case.mjcf():
            raise InputError(f"{path}: is another world than {case.name} of today; leave it out of --known")


def summarise(kind: str, records: Sequence[Record]) -> dict[str, Any]:
    """One row: a kind of world."""
    done = [record for record in records if record["passed"]]
    regrets, fewer = values(done, "regret"), values(done, "fewer")
    return {
        "kind": kind,
        "worlds": len(records),
        "feasible": len(done),
        "returned": median(values(done, "returned")),
        "known": median(values(done, "known")),
        "regret": median(regrets),
        "worst": largest(regrets),
        "fewer": min(fewer, default=None),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """A row per kind of world."""
    header = ("world", "feasible", "returned: true cost", "best known", "ratio, median", "worst", "contacts left out")
    cells = (
        (
            row["kind"],
            f"{row['feasible']}/{row['worlds']}",
            *(number(row[name], ".0f") for name in ("returned", "known")),
            *(number(row[name], ".3f") for name in ("regret", "worst", "fewer")),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def goals_of(records: Sequence[Record]) -> list[Goal]:
    """Near the best known, and no contact too many."""
    regrets, fewer = values(records, "regret"), values(records, "fewer")
    return [
        goals.at_most("true cost over the best known, median", median(regrets), MEDIAN),
        goals.at_most("true cost over the best known, worst world", largest(regrets), WORST),
        goals.at_least("true cost without any one or two contacts over that with", min(fewer, default=None), FEWER),
    ]


NOTE = (
    "Ratios are of the plan of a run over the best known; the last column is the least true cost that is left when one "
    "or two contacts are left out of a run's plan, over the plan's own."
)


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("regret", DESCRIPTION, KINDS, 10)
    parser.set_defaults(timing=(TIMING,), time_limit=600.0)
    add_seed_option(parser)
    effort = Effort()
    for name, words in (
        ("seeds", "searches of each planner"),
        ("starts", "sequences from which the long local search starts"),
        ("motions", "most motions that it optimises from each of them"),
    ):
        value = getattr(effort, name)
        parser.add_argument(
            f"--{name}", type=cli.positive(int), default=value, metavar="N", help=f"{words} (default: {value})"
        )
    parser.add_argument(
        "--known", type=Path, metavar="DIR", help="best plans of earlier runs, as this program keeps them (OUT/known)"
    )
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    console = make_console()
    settings, first = options.settings_of(args), options.first_seed(args, "regret")
    effort = Effort(args.seeds, args.starts, args.motions)
    efforts = {**vars(effort), "known": args.known and args.known.as_posix()}
    cases = make_cases(args.kinds, args.trials, first)
    check_known(args.known, cases)
    store = TrialFile(args.out / "trials.jsonl", settings.deciding() | efforts)
    jobs = [Job(case.name, regret_trial, (settings, case, effort, args.known)) for case in cases]
    records = [
        {"kind": case.kind, "seed": case.seed, "passed": False, **record}
        for record, case in zip(run_jobs(jobs, store, options.pool_of(args), console, "worlds"), cases, strict=True)
    ]
    rows = [summarise(kind, [record for record in records if record["kind"] == kind]) for kind in args.kinds]
    found = goals_of(records)
    path = write_results(
        args.results,
        "regret",
        title="Returned plans and the best known",
        sections=[("Table", f"{table(rows)}\n\n{NOTE}"), ("Failures", failure_section(records))],
        content={"table": rows, "trials": records},
        goals=found,
        settings={**settings.described(), "trials": args.trials, "seed_offset": first, **efforts},
    )
    show_results(console, path)
    return options.goal_code(found)


if __name__ == "__main__":
    cli.run(main)
