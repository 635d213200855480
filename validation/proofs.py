"""Whether "nothing leads to the goal" is a proof: `python -m validation.proofs`."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path

import numpy as np

from toolkit import cli
from toolkit.errors import PlanningError
from toolkit.report.console import make_console
from toolkit.search.ground import Ground
from toolkit.search.planner_config import PlannerConfig
from toolkit.world.loader import load_world
from validation import goals, options
from validation.goals import Goal
from validation.jobs import Job, Record, run_jobs
from validation.proof_worlds import impassable, passable
from validation.run_trial import robot_of
from validation.tables import failure_section, markdown_table, show_results, values, write_results
from validation.trial_file import TrialFile

DESCRIPTION = """\
Random worlds whose answer is known, without a search. Most of them have a way by construction (all families of the map,
and rows of gaps, ledges, slots, ceilings, bars and beams): the planner is asked whether it can prove that nothing leads
to the goal, and must not. The others have an obstacle that cannot be passed: it should prove it, and soon.
"""
WAY, NO_WAY = "a way", "no way"
SHARE, SECONDS = 0.8, 5.0  # of the worlds without a way that should be proven, each within so many s


def proof_trial(name: str, robots: Path, seed: int, kind: str) -> Record:
    """The record of one world, made from its seed."""
    rng = np.random.default_rng([seed, kind == WAY])
    told, mjcf = (passable if kind == WAY else impassable)(rng)
    robot, world = robot_of(name, robots), load_world(f"{kind}-{seed}.xml", mjcf=mjcf)
    ground = Ground(robot, world, PlannerConfig(palms=False))
    start = ground.start_stance()
    began, said = time.perf_counter(), None
    if kind == WAY:
        said = ground.obstacle(start)
    else:
        try:
            ground.way(start)
        except PlanningError as error:
            said = str(error)
    record = {"kind": kind, "told": told, "proven": said is not None, "seconds": time.perf_counter() - began}
    return record | {"passed": (kind == WAY) != record["proven"], "reason": f"{told}: {said or 'not proven'}"}


def goals_of(records: list[Record]) -> list[Goal]:
    """What is asked of the proofs."""
    ways, others = ([each for each in records if each.get("kind") == kind] for kind in (WAY, NO_WAY))
    wrong = sum(each["proven"] for each in ways)
    soon = sum(each["proven"] and each["seconds"] <= SECONDS for each in others)
    return [
        goals.at_most("worlds with a way that are called impossible", float(wrong), 0.0),
        goals.at_least(f"worlds without a way that are proven so within {SECONDS:g} s", soon / len(others), SHARE),
        goals.at_most("trials that ended in an error", float(len(records) - len(ways) - len(others)), 0.0),
    ]


def table(records: list[Record]) -> str:
    """Worlds without a way, by what keeps the robot from the goal."""
    kinds = Counter(each["told"].partition(" ")[0] for each in records if each.get("kind") == NO_WAY)
    rows = []
    for name, count in sorted(kinds.items()):
        own = [each for each in records if each.get("kind") == NO_WAY and each["told"].startswith(f"{name} ")]
        proven = [each for each in own if each["proven"]]
        rows.append((name, str(count), str(len(proven)), f"{np.median(values(own, 'seconds')):.2f}"))
    return markdown_table(("what cannot be passed", "worlds", "proven", "median time [s]"), rows)


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.plain_parser("proofs", DESCRIPTION)
    parser.add_argument(
        "--worlds", type=cli.positive(int), default=2000, help="worlds with a way (default: %(default)s)"
    )
    parser.add_argument(
        "--impossible",
        type=cli.positive(int),
        metavar="N",
        help="worlds without a way (default: a quarter of those with one)",
    )
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    console, settings = make_console(), options.trial_settings(args)
    counts = {WAY: args.worlds, NO_WAY: args.impossible or -(-args.worlds // 4)}
    jobs = [
        Job(f"{kind}-{seed}", proof_trial, (settings.robot, settings.robots, seed, kind))
        for kind, count in counts.items()
        for seed in range(args.seed_offset, args.seed_offset + count)
    ]
    store = TrialFile(args.out / "trials.jsonl", settings.deciding())
    records = run_jobs(jobs, store, options.pool_of(args), console, "worlds")
    path = write_results(
        args.results,
        "proofs",
        title="Whether impossible is a proof",
        sections=[("Worlds without a way", table(records)), ("Not as they should be", failure_section(records))],
        content={"trials": records},
        goals=goals_of(records),
        settings={
            "robot": settings.robot,
            "worlds": ", ".join(f"{count} with {kind}" for kind, count in counts.items()),
            "seed_offset": args.seed_offset,
        },
    )
    show_results(console, path)
    return options.goal_code(goals_of(records))


if __name__ == "__main__":
    cli.run(main)
