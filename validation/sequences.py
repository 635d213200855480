"""The solver of whole sequences against the reference: `python -m validation.sequences`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from toolkit import cli
from toolkit.contacts.room import landing_room
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import PlanningError
from toolkit.report.console import make_console
from toolkit.world.timing import Timing
from validation import goals, options
from validation.cases import DRAWN, Case, make_cases
from validation.fresh_seeds import add_seed_option
from validation.goals import Goal
from validation.growth import exponent
from validation.jobs import Job, Record, reason_of, run_jobs
from validation.options import TrialSettings
from validation.plan_trial import WarmUp, warm_up
from validation.random_contacts import sample_walk
from validation.run_trial import make_planner, robot_of
from validation.sequence_solvers import Solution, solve
from validation.tables import failure_section, in_unit, markdown_table, median, number, show_results, write_results
from validation.trial_file import TrialFile

DESCRIPTION = """\
Optimise whole sequences with the solver and with the reference: sequences drawn from searches of fresh worlds, with and
without free landing points, and random walks, some of which no robot can walk. Told are where they agree that there is
a motion, the ratio of the objectives, the times by number of contacts, and how the time grows up to 300 contacts.
"""
KINDS = tuple(DRAWN)
WALK, GROWTH = "random walk", "growth"
PLANNERS = ("learned", "kinematic")  # who searches, in turn
EXPANSIONS, TRIALS, WALKS = 600, 20, 60
LENGTHS = (20, 31, 60, 100, 200, 300)
BINS = (10, 20, 31, 60, 100, 200, 300)  # contacts, upper ends
SAME = 1.01  # objectives with a smaller ratio are the same
TIGHTER = 0.01  # parts of the friction that differ by less are the same
LIMITS = {20: 0.15, 31: 0.25}  # s, median by number of contacts
AGREES, EXPONENT = 0.95, 1.1


def search_trial(settings: TrialSettings, case: Case) -> Record:
    """A record: one sequence of a search, with contacts as they are and with free landing points."""
    robot, world = robot_of(settings.robot, settings.robots), case.world()
    planner = PLANNERS[case.seed % len(PLANNERS)] if settings.planner == "learned" else settings.planner
    warm_up(WarmUp(settings.robot, settings.robots, planner))
    record: Record = {"kind": case.kind, "planner": planner, "passed": False, "stage": "planning"}
    rng = np.random.default_rng([case.seed, 0])
    try:
        found = make_planner(settings, world, planner).search(rng, settings.planning.time_limit)
    except PlanningError as error:
        return record | {"reason": reason_of(error)}
    if not found.solutions:
        return record | {"reason": found.reason}
    sequence = found.solutions[int(rng.integers(len(found.solutions)))].sequence
    room = landing_room(robot, world.surfaces, sequence, goal=world.goal)
    _ready(settings)
    compared = {"fixed": _compared(settings, sequence, None), "free": _compared(settings, sequence, room)}
    return _finished(record, sequence, compared)


def walk_trial(settings: TrialSettings, seed: int) -> Record:
    """A record: a random walk of any timing, friction and tilt, which may have no motion."""
    robot, rng = robot_of(settings.robot, settings.robots), np.random.default_rng([seed, 1])
    timing = Timing(float(rng.uniform(0.1, 1.0)), float(rng.uniform(0.3, 1.0)))
    sequence = sample_walk(
        robot,
        int(rng.integers(4, 32)),
        rng,
        timing=timing,
        tilt=math.radians(rng.uniform(0.0, 35.0)),
        friction=float(rng.uniform(0.3, 0.8)),
    )
    _ready(settings)
    return _finished({"kind": WALK}, sequence, {"fixed": _compared(settings, sequence, None)})


def growth_trial(settings: TrialSettings, seed: int, contacts: int, reference: bool) -> Record:
    """A record: a long walk, the reference only where it is asked for."""
    robot, rng = robot_of(settings.robot, settings.robots), np.random.default_rng([seed, contacts])
    sequence = sample_walk(robot, contacts, rng, timing=Timing(0.6, 0.8), tilt=math.radians(8.0))
    _ready(settings)
    return _finished({"kind": GROWTH}, sequence, {"fixed": _compared(settings, sequence, None, reference=reference)})


def _ready(settings: TrialSettings) -> None:
    """Load what both solvers need, so that no trial's time contains it."""
    robot = robot_of(settings.robot, settings.robots)
    sequence = sample_walk(robot, 2, np.random.default_rng(0))
    for by_reference in (False, True):
        solve(robot, sequence, by_reference=by_reference)


def _compared(
    settings: TrialSettings, sequence: ContactSequence, room: np.ndarray | None, *, reference: bool = True
) -> dict[str, Any]:
    """Figures of both solvers; of the reference only where it is wanted."""
    robot = robot_of(settings.robot, settings.robots)
    found = {"solver": _described(solve(robot, sequence, room))}
    if reference:
        found["reference"] = _described(solve(robot, sequence, room, by_reference=True))
    return found


def _described(solution: Solution) -> dict[str, Any]:
    """Figures of one solution."""
    motion = solution.motion
    return {
        "feasible": motion.feasible,
        "outcome": motion.outcome,
        "objective": motion.objective if motion.feasible else None,
        "friction": motion.solved.margins.friction,
        "iterations": motion.iterations,
        "seconds": solution.seconds,
    }


def _finished(record: Record, sequence: ContactSequence, compared: dict[str, dict[str, Any]]) -> Record:
    """The record with its comparisons: it passes where the solver is feasible wherever the reference is."""
    missed = [item["solver"]["outcome"] for item in compared.values() if _feasible(item) == (False, True)]
    return record | {
        "contacts": len(sequence.transitions),
        "palm_contacts": sum(not t.limb.is_foot for t in sequence.transitions),
        "compared": compared,
        "passed": not missed,
        "stage": "dynamics" if missed else "done",
        "reason": next(iter(missed), ""),
    }


def _feasible(compared: dict[str, Any]) -> tuple[bool, bool | None]:
    """What solver and reference say; None where the reference was not asked."""
    return compared["solver"]["feasible"], compared.get("reference", {}).get("feasible")


def summarise(title: str, compared: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One row of figures of comparisons."""
    asked = [item for item in compared if "reference" in item]
    both = [item for item in asked if _feasible(item) == (True, True)]
    ratios = [item["solver"]["objective"] / item["reference"]["objective"] for item in both]
    kept = [item["solver"]["friction"] - item["reference"]["friction"] for item in both]
    times = [item["solver"]["seconds"] for item in compared]
    speed = [item["reference"]["seconds"] / max(item["solver"]["seconds"], 1e-9) for item in asked]
    return {
        "title": title,
        "count": len(compared),
        "asked": len(asked),
        "reference_feasible": sum(bool(_feasible(item)[1]) for item in asked),
        "missed": sum(_feasible(item) == (False, True) for item in asked),
        "gained": sum(_feasible(item) == (True, False) for item in asked),
        "same_or_better": float(np.mean(np.array(ratios) <= SAME)) if ratios else None,
        "ratio": median(ratios),
        "ratio_95": _quantile(ratios, 95),
        "margins_kept": float(np.mean(np.array(kept) <= TIGHTER)) if kept else None,
        "iterations": median([item["solver"]["iterations"] for item in compared]),
        "median": median(times),
        "quantile_95": _quantile(times, 95),
        "speed": median(speed),
    }


def _quantile(numbers: Sequence[float], percent: float) -> float | None:
    return float(np.percentile(numbers, percent)) if len(numbers) else None


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Rows of `summarise` in Markdown."""
    header = ("sequences", "number", "compared", "reference feasible", "missed", "gained", "same or better objective")
    header += ("objective ratio, median", "95 %", "margins as tight", "iterations", "median [ms]", "95 % [ms]")
    header += ("reference / solver, median",)
    cells = (
        (
            row["title"],
            *(str(row[name]) for name in ("count", "asked", "reference_feasible", "missed", "gained")),
            number(row["same_or_better"], ".1%"),
            number(row["ratio"], ".4f"),
            number(row["ratio_95"], ".4f"),
            number(row["margins_kept"], ".1%"),
            number(row["iterations"], ".0f"),
            *(number(in_unit(row[name], 1e3), ".3g") for name in ("median", "quantile_95")),
            number(row["speed"], ".1f"),
        )
        for row in rows
    )
    return markdown_table(header, cells)


def by_kind(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Rows by origin of the sequences and by what may move, and one row of all."""
    rows, everything = [], []
    kinds = dict.fromkeys(record["kind"] for record in records if record["kind"] != GROWTH)
    for kind in kinds:
        for name in ("fixed", "free"):
            same = [r["compared"][name] for r in records if r["kind"] == kind and name in r["compared"]]
            everything += same
            if same:
                rows.append(summarise(f"{kind}, {'free landing points' if name == 'free' else 'fixed contacts'}", same))
    return [*rows, summarise("all", everything)]


def by_contacts(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Rows by number of contacts, of everything that was solved."""
    rows, lower = [], 0
    for upper in BINS:
        same = [item for r in records if lower < r["contacts"] <= upper for item in r["compared"].values()]
        if same:
            rows.append(summarise(f"{lower + 1} to {upper} contacts", same))
        lower = upper
    return rows


def goals_of(rows: Sequence[dict[str, Any]], records: Sequence[Record], fit: float | None) -> list[Goal]:
    """Never worse than the reference, fast, and linear."""
    whole = rows[-1]
    feasible = whole["reference_feasible"]
    found = [
        goals.every("feasible where the reference is", feasible - whole["missed"], feasible),
        goals.at_least("same or better objective", in_unit(whole["same_or_better"], 100), 100 * AGREES, "%", 4),
    ]
    for contacts, limit in LIMITS.items():
        times = [
            record["compared"]["fixed"]["solver"]["seconds"]
            for record in records
            if record["kind"] == GROWTH and record["contacts"] == contacts
        ]
        found.append(goals.at_most(f"{contacts} contacts, median", in_unit(median(times), 1e3), 1e3 * limit, "ms"))
    return [*found, goals.at_most("exponent of time over contacts", fit, EXPONENT)]


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.parser("sequences", DESCRIPTION, KINDS, TRIALS)
    parser.set_defaults(expansions=EXPANSIONS, time_limit=600.0)
    add_seed_option(parser)
    parser.add_argument("--walks", type=cli.positive(int), default=WALKS, metavar="N", help="random walks")
    parser.add_argument(
        "--lengths",
        type=cli.positive(int),
        nargs="+",
        default=list(LENGTHS),
        metavar="N",
        help="contacts of long walks",
    )
    parser.add_argument(
        "--growth-trials", type=cli.positive(int), default=5, metavar="N", help="long walks of each length"
    )
    parser.add_argument(
        "--reference-up-to",
        type=int,
        default=60,
        metavar="N",
        help="longer walks are solved without the reference (default: %(default)s)",
    )
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    console = make_console()
    settings, first = options.settings_of(args), options.first_seed(args, "sequences")
    store = TrialFile(args.out / "trials.jsonl", settings.deciding())
    jobs = [Job(case.name, search_trial, (settings, case)) for case in make_cases(args.kinds, args.trials, first)]
    jobs += [Job(f"walk-{first + index}", walk_trial, (settings, first + index)) for index in range(args.walks)]
    jobs += [
        Job(
            f"growth-{contacts}-{first + index}",
            growth_trial,
            (settings, first + index, contacts, contacts <= args.reference_up_to),
        )
        for contacts in args.lengths
        for index in range(args.growth_trials)
    ]
    records = run_jobs(jobs, store, options.pool_of(args), console, "sequences")
    solved = [record for record in records if "compared" in record]
    rows, lengths = by_kind(solved), by_contacts(solved)
    grown = [record for record in solved if record["kind"] == GROWTH]
    times = [record["compared"]["fixed"]["solver"]["seconds"] for record in grown]
    fit = exponent([record["contacts"] for record in grown], times)
    found = goals_of(rows, grown, fit)
    note = f"Fitted exponent of time over contacts, of the long walks: {number(fit, '.2f')}."
    path = write_results(
        args.results,
        "sequences",
        title="Whole sequences: solver against reference",
        sections=[
            ("By origin", f"{table(rows)}\n\n{NOTE}"),
            ("By number of contacts", f"{table(lengths)}\n\n{note}"),
            ("Failures", failure_section(records)),
        ],
        content={"by_kind": rows, "by_contacts": lengths, "exponent": fit, "trials": records},
        goals=found,
        settings={**settings.described(), "trials": args.trials, "walks": args.walks, "seed_offset": first},
    )
    show_results(console, path)
    return options.goal_code(found)


NOTE = (
    "Times are processor times of everything from the contacts to the checked motion. Missed: feasible to the "
    "reference alone; gained: to the solver alone. Objectives within 1 % are the same. Margins are as tight where the "
    "part of the friction that the solver's motion needs is at most 0.01 above the reference's. Reference / solver: of "
    "the times."
)

if __name__ == "__main__":
    cli.run(main)
