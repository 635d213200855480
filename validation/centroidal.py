"""The centroidal solver against Ipopt on the same programs, and whole sequences, on one thread.

`python -m validation.centroidal` times random transitions of all categories with both solvers (building the
program and checking the motion counted in), compares their answers, and solves walks of up to 60 contacts. Times are
processor times of the process, which on an idle machine are wall-clock times.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from time import perf_counter, process_time
from typing import Any

import numpy as np
from rich.progress import Progress

from toolkit import cli
from toolkit.centroidal.build import initial_com, transition_problem
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.program import Program
from toolkit.centroidal.residual import check
from toolkit.centroidal.sequence import CONVERGED, SequenceConfig, guess, optimise, optimise_transition
from toolkit.contacts.category import Category
from toolkit.contacts.schedule import ContactSchedule
from toolkit.report.console import make_console, progress_bar
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from validation import goals, options
from validation.goals import Goal
from validation.growth import exponent
from validation.random_contacts import SamplingConfig, TransitionSample, sample_transition, sample_walk
from validation.reference.sequence import solve
from validation.tables import largest, markdown_table, median, number, show_results, write_results

SETTINGS = {
    "1 s + 1 s, friction 0.5": SamplingConfig(),
    "any timing and friction": SamplingConfig(friction=(0.3, 0.9), shift=(0.05, 1.0), swing=(0.3, 1.0)),
}
LENGTHS = (6, 9, 12, 20, 25, 31, 40, 50, 60)
LIMITS = {20: 0.15, 31: 0.25}  # s, by the number of contacts
OBJECTIVE_TOLERANCE = 0.01


def by_solver(robot: RobotModel, sample: TransitionSample) -> CentroidalMotion:
    """The motion of a transition, from the toolkit's own solver."""
    return optimise_transition(robot, sample.stance, sample.com, sample.com_velocity, sample.transition)


def by_reference(robot: RobotModel, sample: TransitionSample) -> CentroidalMotion:
    """The motion of a transition, from Ipopt: the same program and the same guess."""
    config, given = SequenceConfig(), (sample.stance, sample.com, sample.com_velocity, sample.transition)
    problem = transition_problem(robot, *given, config=config.problem)
    program = Program(problem, robot, config.body, config.regularisers)
    return solve(program, guess(program))


SOLVERS: dict[str, Callable[[RobotModel, TransitionSample], CentroidalMotion]] = {
    "solver": by_solver,
    "reference": by_reference,
}


def compare(robot: RobotModel, category: Category, index: int, seed: int, config: SamplingConfig) -> dict[str, Any]:
    """One random transition with both solvers."""
    sample = sample_transition(robot, category, np.random.default_rng([seed, category, index]), config)
    record: dict[str, Any] = {"category": int(category), "index": index}
    for name, solver in SOLVERS.items():
        start = process_time()
        motion = solver(robot, sample)
        seconds = process_time() - start
        record[name] = {
            "seconds": seconds,
            "feasible": motion.feasible,
            "status": motion.status,
            "objective": motion.objective if math.isfinite(motion.objective) else None,
            "iterations": motion.iterations,
        }
        if motion.feasible:
            record[name]["residual"] = check(motion).largest
    return record


def summarise(category: Category, records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Figures of one category."""
    quick = np.array([record["solver"]["seconds"] for record in records])
    slow = np.array([record["reference"]["seconds"] for record in records])
    both = [r for r in records if r["solver"]["feasible"] and r["reference"]["feasible"]]
    close = [
        abs(r["solver"]["objective"] / r["reference"]["objective"] - 1) <= OBJECTIVE_TOLERANCE
        for r in both
        if r["reference"]["objective"]
    ]
    return {
        "category": category.name.lower(),
        "trials": len(records),
        "feasible": float(np.mean([record["solver"]["feasible"] for record in records])),
        "solver_median": float(np.median(quick)),
        "solver_95": float(np.percentile(quick, 95)),
        "reference_median": float(np.median(slow)),
        "reference_95": float(np.percentile(slow, 95)),
        "ratio": float(np.median(slow) / np.median(quick)),
        "feasibility_agrees": float(np.mean([r["solver"]["feasible"] == r["reference"]["feasible"] for r in records])),
        "solver_stopped": stopped(records, "solver"),
        "reference_stopped": stopped(records, "reference"),
        "objective_agrees": float(np.mean(close)) if close else None,
        "largest_residual": largest([r["solver"]["residual"] for r in records if r["solver"]["feasible"]]),
    }


def stopped(records: Sequence[dict[str, Any]], name: str) -> int:
    """How often a solver ended without a solution of the program."""
    return sum(not record[name]["status"].startswith(CONVERGED) for record in records)


def walk(robot: RobotModel, contacts: int, seed: int, repeats: int) -> dict[str, Any]:
    """One random walk, everything from the contacts to the checked motion; the best of some repeats."""
    sequence = sample_walk(robot, contacts, np.random.default_rng([seed, contacts]))
    times = []
    for _ in range(repeats):
        start = process_time()
        schedule = ContactSchedule.of(sequence, initial_rest=0.5, final_rest=1.0)
        motion = optimise(robot, schedule, initial_com(robot, sequence.start), np.zeros(3))
        times.append(process_time() - start)
    return {
        "contacts": contacts,
        "steps": motion.problem.steps,
        "seconds": min(times),
        "feasible": motion.feasible,
        "iterations": motion.iterations,
        "objective": motion.objective,
    }


def transition_table(rows: Sequence[dict[str, Any]]) -> str:
    """Transitions in Markdown."""
    header = (
        "category",
        "trials",
        "feasible",
        "solver [ms]",
        "95 %",
        "reference [ms]",
        "95 %",
        "ratio",
        "feasibility agrees",
        "objective within 1 %",
        "stopped early: solver",
        "reference",
    )
    cells = [
        (
            row["category"],
            str(row["trials"]),
            f"{row['feasible']:.0%}",
            *(f"{1e3 * row[name]:.3g}" for name in ("solver_median", "solver_95", "reference_median", "reference_95")),
            f"{row['ratio']:.0f}",
            f"{row['feasibility_agrees']:.2%}",
            "-" if row["objective_agrees"] is None else f"{row['objective_agrees']:.2%}",
            str(row["solver_stopped"]),
            str(row["reference_stopped"]),
        )
        for row in rows
    ]
    return markdown_table(header, cells)


def walk_table(rows: Sequence[dict[str, Any]], fit: float | None) -> str:
    """Walks in Markdown, the median over their seeds."""
    header = ("contacts", "walks", "feasible", "steps", "iterations", "all in [ms]")
    cells = []
    for contacts in sorted({row["contacts"] for row in rows}):
        same = [row for row in rows if row["contacts"] == contacts]
        cells.append(
            (
                str(contacts),
                str(len(same)),
                str(sum(row["feasible"] for row in same)),
                str(same[0]["steps"]),
                f"{np.median([row['iterations'] for row in same]):.0f}",
                f"{1e3 * np.median([row['seconds'] for row in same]):.3g}",
            )
        )
    return f"{markdown_table(header, cells)}\n\nFitted exponent of time over contacts: {number(fit, '.2f')}."


def goals_of(tables: dict[str, list[dict[str, Any]]], walks: Sequence[dict[str, Any]], fit: float | None) -> list[Goal]:
    """What is asked of the solver."""
    found = []
    for name, rows in tables.items():
        feet = median(
            [1e3 * row["solver_median"] for row in rows if row["category"] == Category.MOVE_FOOT.name.lower()]
        )
        agree = [row["objective_agrees"] for row in rows if row["objective_agrees"] is not None]
        residual = largest([row["largest_residual"] for row in rows if row["largest_residual"] is not None])
        found += [
            goals.at_most(f"{name}: a foot's move, median", feet, 3.0, "ms"),
            goals.at_least(f"{name}: reference / solver, worst category", min(row["ratio"] for row in rows), 12.0),
            goals.at_least(
                f"{name}: feasibility agrees, worst category", min(row["feasibility_agrees"] for row in rows), 0.99
            ),
            goals.at_least(f"{name}: objective within 1 %, worst category", min(agree, default=None), 0.95),
            goals.at_most(f"{name}: residual of anything called feasible", residual, 1e-6),
        ]
    for contacts, limit in LIMITS.items():
        seconds = median([row["seconds"] for row in walks if row["contacts"] == contacts])
        found.append(goals.at_most(f"{contacts} contacts, all in", seconds, limit, "s"))
    return [*found, goals.at_most("exponent of time over contacts", fit, 1.1)]


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.centroidal",
        description="The centroidal solver against Ipopt on the same programs, and whole sequences, on one thread.",
        epilog=options.GOAL_CODES,
    )
    parser.add_argument(
        "--trials", type=cli.positive(int), default=50, help="trials per category and setting (default: %(default)s)"
    )
    parser.add_argument(
        "--walks", type=cli.positive(int), default=5, help="random walks of each length (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of every random draw (default: %(default)s)")
    options.add_results_option(parser, "centroidal")
    cli.add_robot_options(parser)
    args = parser.parse_args(argv)
    robot = load_robot(args.robot, args.robots)
    console = make_console()

    start = perf_counter()
    walk(robot, 1, args.seed, 1)
    first = perf_counter() - start
    with progress_bar(console) as progress:
        tables, records = _transitions(robot, args, progress)
        walks = _walks(robot, args, progress)
    fit = exponent([row["contacts"] for row in walks], [row["seconds"] for row in walks])
    found = goals_of(tables, walks, fit)
    sections = [(f"Transitions: {name}", transition_table(rows)) for name, rows in tables.items()]
    note = (
        "Times are processor times, everything from the contacts to the checked motion. Walks over stones tilted by "
        "up to 10 degrees, 1 s + 1 s per contact; best of 3 runs each. "
        f"The first solution in this process took {first:.1f} s (loading or compiling the solver).\n\n"
    )
    path = write_results(
        args.results,
        "centroidal",
        title="Centroidal optimiser: solver against reference",
        sections=[*sections, ("Whole sequences", note + walk_table(walks, fit))],
        content={
            "tables": tables,
            "disagreements": [r for r in records if r["solver"]["feasible"] != r["reference"]["feasible"]],
            "walks": walks,
            "exponent": fit,
            "first_solution_seconds": first,
        },
        goals=found,
        settings={"robot": robot.name, "trials": args.trials, "walks": args.walks, "seed": args.seed},
    )
    show_results(console, path)
    return options.goal_code(found)


def _transitions(
    robot: RobotModel, args: argparse.Namespace, progress: Progress
) -> tuple[dict[str, list[dict[str, Any]]], list[dict[str, Any]]]:
    """Table rows by setting, and all trials."""
    tables: dict[str, list[dict[str, Any]]] = {}
    everything = []
    task = progress.add_task("transitions", total=len(SETTINGS) * len(Category) * args.trials)
    for setting, (name, config) in enumerate(SETTINGS.items()):
        tables[name] = []
        for category in Category:
            records = []
            for index in range(args.trials):
                records.append(compare(robot, category, index, args.seed + 1000 * setting, config))
                progress.advance(task)
            tables[name].append(summarise(category, records))
            everything += [{"setting": name, **record} for record in records]
    return tables, everything


def _walks(robot: RobotModel, args: argparse.Namespace, progress: Progress) -> list[dict[str, Any]]:
    """Walks of all lengths."""
    task = progress.add_task("walks", total=len(LENGTHS) * args.walks)
    rows = []
    for index in range(args.walks):
        for contacts in LENGTHS:
            rows.append(walk(robot, contacts, args.seed + index, 3))
            progress.advance(task)
    return rows


if __name__ == "__main__":
    cli.run(main, sys.argv[1:])
