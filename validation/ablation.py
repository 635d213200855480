"""What the networks, the choice by truth and the local search buy: `python -m validation.ablation`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from toolkit import cli
from toolkit.report.console import make_console
from toolkit.world.timing import Timing
from validation import goals, options
from validation.ablation_trial import BEST, BY_TIME, LOCAL, RAW, Effort, ablation_trial
from validation.cases import make_cases
from validation.fresh_seeds import add_seed_option
from validation.goals import Goal
from validation.growing import add_growing_options, growth_note, stamped, state_of, take_over
from validation.jobs import Job, Record, run_jobs
from validation.searched import PLANNERS, completed
from validation.tables import (
    failure_section,
    in_unit,
    markdown_table,
    median,
    number,
    show_results,
    values,
    write_results,
)
from validation.trial_file import TrialFile

DESCRIPTION = """\
One table of what the networks buy: learned, optimiser as judge, kinematic and quasi-static planners, each as its search
has it and with the truly cheapest of equally many optimisations, or of equal seconds, each with and without the local
search. All worlds are fresh, the timing is the same for all, and plans are compared by their true cost, world by world.
"""
FIELD, CORRIDOR = "rubble_field", "rubble_corridor"
KINDS = (FIELD, CORRIDOR, "any_stairs", "any_stones", "any_gap", "any_slope")
TIMING = Timing(0.6, 0.8)
JUDGE, OURS, KINEMATIC, BASELINE = "optimiser", "learned", "kinematic", "quasi-static"
QUANTITIES: dict[str, tuple[str, ...]] = {
    "true cost": ("true_cost",),
    "J": ("objective",),
    "J, paper's weights": ("paper_objective",),
    "seconds of walking": ("walking_seconds",),
    "transitions": ("transitions",),
    "lin. momentum rate": ("figures", "linear_momentum_rate"),
    "ang. momentum rate": ("figures", "angular_momentum_rate"),
    "CoP to edge": ("figures", "cop_distance"),
    "CoP to edge, feet": ("figures", "foot_cop_distance"),
}
COST, PAPER_J, SECONDS = "true cost", "J, paper's weights", "seconds of walking"
MOST = {(FIELD, RAW): 1.0, (CORRIDOR, RAW): 0.8, (FIELD, BEST): 0.95, (CORRIDOR, BEST): 0.75}
"""Most that the true cost may be over the quasi-static planner's, median of the worlds' ratios."""
PAPER_RATIO = {FIELD: 0.95, CORRIDOR: 0.70}  # of J
OVER_KINEMATIC, LONGER = 0.92, 1.15


def summarise(kind: str, planner: str, variant: str, records: Sequence[Record]) -> dict[str, Any]:
    """One row: a variant of a planner in a kind of world."""
    chosen = [record["variants"][variant] for record in records if variant in record["variants"]]
    simulated = [item for item in chosen if "executed" in item]
    return {
        "kind": kind,
        "planner": planner,
        "variant": variant,
        "trials": len(records),
        "found": sum(record["found"] for record in records),
        "feasible": len(chosen),
        "executed": sum(item["executed"] for item in simulated),
        "simulated": len(simulated),
        "palm_contacts": median(values(chosen, "palm_contacts")),
        "first_feasible_seconds": median(values(records, "first_feasible_seconds")),
        "optimised": median(values(records, "optimised")),
        "spent": median(values(records, "spent")),
        "local_seconds": median(values(chosen, "optimiser_seconds")) if variant in LOCAL.values() else None,
        **{name: median(values(chosen, *path)) for name, path in QUANTITIES.items()},
    }


def ratios(kind: str, variant: str, records: Sequence[Record], ours: str, other: str) -> dict[str, Any]:
    """Medians over the worlds of a kind of one planner's figures over another's, where both have a plan."""
    chosen = {
        (record["planner"], record["seed"]): record["variants"][variant]
        for record in records
        if variant in record["variants"]
    }
    pairs = [
        (item, chosen[other, seed])
        for (planner, seed), item in chosen.items()
        if planner == ours and (other, seed) in chosen
    ]
    found = {"kind": kind, "variant": variant, "planner": ours, "over": other, "worlds": len(pairs)}
    for name, path in QUANTITIES.items():
        both = [(values([mine], *path), values([theirs], *path)) for mine, theirs in pairs]
        found[name] = median([mine[0] / theirs[0] for mine, theirs in both if mine and theirs and theirs[0]])
    return found


def compare(
    kind: str, variants: Sequence[str], records: Sequence[Record], planners: Sequence[str]
) -> list[dict[str, Any]]:
    """The ratios of every planner's figures over those of the others that are there, the baseline as `other` alone."""
    return [
        ratios(kind, variant, records, ours, other)
        for other in (BASELINE, KINEMATIC, JUDGE)
        if other in planners
        for ours in planners
        if ours not in (other, BASELINE)
        for variant in variants
    ]


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The table of all planners."""
    header = ("world", "planner", "variant", "found", "feasible", "PASS", "true cost", "J", "J, paper's weights")
    header += ("transitions", "palms", "first feasible sequence [ms]", "seconds of walking", "optimised", "spent [s]")
    header += ("local search [s]",)
    cells = (
        (
            row["kind"],
            row["planner"],
            row["variant"],
            f"{row['found']}/{row['trials']}",
            f"{row['feasible']}/{row['trials']}",
            f"{row['executed']}/{row['simulated']}" if row["simulated"] else "-",
            *(number(row[name], ".0f") for name in ("true cost", "J", "J, paper's weights", "transitions")),
            number(row["palm_contacts"], ".0f"),
            number(in_unit(row["first_feasible_seconds"], 1e3), ".0f"),
            number(row["seconds of walking"], ".1f"),
            number(row["optimised"], ".0f"),
            number(row["spent"], ".1f"),
            number(row["local_seconds"], ".1f"),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def ratio_table(rows: Sequence[dict[str, Any]]) -> str:
    """Ratios of planners, world by world."""
    header = ("world", "variant", "planner", "over", "worlds", *QUANTITIES)
    cells = (
        (
            *(str(row[name]) for name in ("kind", "variant", "planner", "over", "worlds")),
            *(number(row[name], ".3f") for name in QUANTITIES),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def goals_of(found: Sequence[dict[str, Any]]) -> list[Goal]:
    """What is asked of the learned planner beside the two without networks."""
    wanted = []
    row = {(item["kind"], item["variant"], item["over"]): item for item in found if item["planner"] == OURS}
    for (kind, variant), limit in MOST.items():
        pair = row.get((kind, variant, BASELINE), {})
        wanted.append(goals.at_most(f"{kind}, {variant}: true cost over quasi-static", pair.get(COST), limit))
    for kind in (FIELD, CORRIDOR):
        pair = row.get((kind, RAW, KINEMATIC), {})
        wanted.append(goals.at_most(f"{kind}, {RAW}: true cost over kinematic", pair.get(COST), OVER_KINEMATIC))
        pair = row.get((kind, BEST, BASELINE), {})
        text = f"{kind}, {BEST}, over quasi-static"
        wanted.append(goals.at_most(f"{text}: {PAPER_J}, as in the paper", pair.get(PAPER_J), PAPER_RATIO[kind]))
        if kind == FIELD:
            wanted.append(goals.at_most(f"{text}: {SECONDS}", pair.get(SECONDS), LONGER))
        for name in ("lin. momentum rate", "ang. momentum rate"):
            wanted.append(goals.at_most(f"{text}: {name}", pair.get(name), 1.0))
        for name in ("CoP to edge", "CoP to edge, feet"):
            wanted.append(goals.at_least(f"{text}: {name}", pair.get(name), 1.0))
    return wanted


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("ablation", DESCRIPTION, KINDS, 50)
    parser.set_defaults(timing=(TIMING,), time_limit=600.0, planner=OURS)
    add_seed_option(parser)
    effort = Effort()
    parser.add_argument("--planners", nargs="+", choices=PLANNERS, default=list(PLANNERS), help="default: all four")
    parser.add_argument(
        "--other-trials",
        type=cli.positive(int),
        default=10,
        metavar="N",
        help="trials of each kind of world but fields and corridors (default: %(default)s)",
    )
    parser.add_argument(
        "--optimiser-trials",
        type=cli.positive(int),
        metavar="N",
        help="most trials of each kind with the optimiser as judge, which takes minutes each (default: no limit)",
    )
    parser.add_argument(
        "--optimisations",
        type=cli.positive(int),
        default=effort.optimisations,
        metavar="N",
        help="sequences that a planner may have optimised (default: %(default)s)",
    )
    parser.add_argument(
        "--seconds",
        type=cli.positive(float),
        default=effort.seconds,
        metavar="S",
        help="of searches and optimisations that a planner may spend (default: %(default)s)",
    )
    parser.add_argument(
        "--local-search",
        type=options.count,
        default=effort.motions,
        metavar="N",
        help="motions that a local search may optimise beyond that; 0: no local search (default: %(default)s)",
    )
    parser.add_argument(
        "--execute",
        action="store_true",
        help="simulate the chosen plans of new trials as well, which takes long",
    )
    add_growing_options(parser)
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    console = make_console()
    settings, first = options.settings_of(args), options.first_seed(args, "ablation")
    effort = Effort(args.optimisations, args.seconds, args.local_search)
    worlds = [
        case
        for kind in args.kinds
        for case in make_cases([kind], args.trials if kind in (FIELD, CORRIDOR) else args.other_trials, first)
    ]
    cases = {
        f"{planner}-{case.name}": (case, planner)
        for case in sorted(worlds, key=lambda case: case.seed)  # so that what ends early has worlds of every kind
        for planner in args.planners
        if planner != JUDGE or case.seed - first < (args.optimiser_trials or math.inf)
    }
    chosen = {"optimisations": args.optimisations, "seconds": args.seconds, "local_search": args.local_search}
    chosen |= {"execute": args.execute}
    described = {**settings.described(), **chosen, "trials": args.trials, "seed_offset": first}
    store = TrialFile(args.out / "trials.jsonl", settings.deciding() | chosen)
    if args.grow:
        take_over(store, args.results / "ablation.json", described, cases)
    jobs = [Job(name, ablation_trial, (settings, *case, effort, args.execute)) for name, case in cases.items()]
    found = run_jobs(jobs, store, options.pool_of(args), console, "plans", args.minutes)
    ended = [cases[record["name"]] for record in found]
    records = stamped(completed(found, ended, {"variants": {}}), state_of(settings))
    growth = growth_note(records, len(cases), state_of(settings))
    rows, compared = [], []
    for kind in args.kinds:
        same = [record for record in records if record["kind"] == kind]
        for planner in args.planners:
            own = [record for record in same if record["planner"] == planner]
            rows += [summarise(kind, planner, variant, own) for variant in effort.variants]
        compared += compare(kind, effort.variants, same, args.planners)
    reached = goals_of(compared)
    path = write_results(
        args.results,
        "ablation",
        title="What the networks buy",
        sections=[
            ("Planners", "\n\n".join(filter(None, (table(rows), growth, NOTE)))),
            ("Over other planners, median of the worlds' ratios", ratio_table(compared)),
            ("Failures", failure_section(records)),
        ],
        content={"table": rows, "ratios": compared, "trials": records},
        goals=reached,
        settings=described,
    )
    show_results(console, path)
    return options.goal_code(reached)


NOTE = (
    f"Medians over the worlds with a plan. The {RAW} is the feasible sequence that the first search holds for the "
    "cheapest. A planner that has effort left searches again with another seed. First feasible sequence: search and "
    "optimisations in turn until the optimiser calls a sequence feasible, without the heuristic. "
    f"In the variant '{BY_TIME}' every sequence is optimised as soon as it is found. Neither 'optimised' nor 'spent' "
    "counts the local search, which may optimise the same number of motions for every planner. PASS: of the plans that "
    "were simulated, as they are."
)

if __name__ == "__main__":
    cli.run(main)
