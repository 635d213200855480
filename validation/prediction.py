"""How well the networks predict the centroidal optimiser: `python -m validation.prediction`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from toolkit import cli
from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.dataset import read_dataset
from toolkit.learning.evaluate import query_seconds
from toolkit.learning.samples import Samples
from toolkit.prediction.network import TransitionNetwork, training_summary
from toolkit.prediction.networks import load_networks
from toolkit.report.console import make_console
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from validation import goals, options
from validation.encodings import EncodingScore, compare_encodings
from validation.fresh_seeds import fresh_seed
from validation.fresh_transitions import DEFAULT, fresh, seed_of, test_sets
from validation.goals import Goal
from validation.score_sets import TAILS, Scores
from validation.sequence_objective import Relation, draw_relation, relation
from validation.tables import markdown_table, show_results, write_results

DESCRIPTION = """\
Score the trained networks on transitions that they have not seen, beside the paper's table: at 1 s + 1 s and friction
0.5, and over all timings and frictions. The seeds of the test sets are made from the hash of the networks; the median
and the worst set are told, and the tails of the errors. Also: the time of a query, two encodings of orientations
compared, and the sum of predictions against the objective of whole sequences.
"""

# The paper's table by category: accuracy [%], mean objective, its error, final CoM [mm], velocity [mm/s]; and the most
# that our error of the objective may be [%].
PAPER = {
    Category.MOVE_FOOT: (90.3, 1436.10, 62.45, 7.5, 6.6, 4.3),
    Category.ADD_PALM: (97.0, 740.85, 40.38, 6.0, 5.4, 5.5),
    Category.MOVE_INNER_FOOT_WITH_PALM: (95.3, 164.96, 20.70, 9.0, 5.4, 12.6),
    Category.MOVE_OUTER_FOOT_WITH_PALM: (93.5, 119.85, 11.07, 6.7, 4.7, 9.2),
    Category.BREAK_ONLY_PALM: (94.3, 516.53, 45.06, 7.1, 4.1, 8.7),
    Category.MOVE_ONLY_PALM: (95.2, 87.80, 12.39, 9.1, 4.1, 14.1),
    Category.ADD_OTHER_PALM: (98.1, 53.47, 8.10, 7.3, 4.1, 15.1),
    Category.MOVE_FOOT_WITH_PALMS: (96.6, 50.66, 17.28, 8.1, 2.4, 34.1),
    Category.BREAK_ONE_PALM: (96.1, 88.00, 15.18, 9.0, 3.0, 17.3),
    Category.MOVE_ONE_PALM: (98.3, 62.40, 7.56, 8.1, 3.7, 12.1),
}
COM, VELOCITY = 6.0, 5.0  # mm and mm/s, at most
LEAST_SHARE = 0.25  # of each label in a test set
ALONE, BATCHED, BATCH = 60.0, 10.0, 60  # us a query alone, us a transition in batches of so many
WEIGHTS = 15.0  # MB in all
TAIL_NOTE = "Tails: errors that so many percent of the transitions of all sets do not exceed."
WHOLE_NOTE = (
    "What is predicted is a transition's share of a whole motion, which depends on what follows as well: no network "
    "errs less than it spreads with that (`python -m validation.labels`). The paper's are of single "
    "transitions."
)


def score_rows(scores: Mapping[Category, Scores], *, paper: bool) -> str:
    """Our rows of each category, those of the median and of the worst set, and the paper's below."""
    header = ("category", "from", "infeasible", "accuracy", "objective", "its error", "relative")
    header += ("CoM [mm]", "velocity [mm/s]")
    lines = []
    for category, found in scores.items():
        for title, row in (("ours, median set", found.median), ("ours, worst set", found.worst)):
            lines.append(
                (
                    f"{int(category) + 1} {category.words}" if row is found.median else "",
                    title,
                    f"{100 * row.infeasible:.0f} %",
                    f"{100 * row.accuracy:.1f} %",
                    f"{row.mean_objective:.1f}",
                    f"{row.objective_error:.2f}",
                    f"{100 * row.relative_error:.1f} %",
                    f"{1e3 * row.com_error:.1f}",
                    f"{1e3 * row.velocity_error:.1f}",
                )
            )
        if paper and category in PAPER:
            accuracy, objective, error, com, velocity, _ = PAPER[category]
            relative = f"{100 * error / objective:.1f} %"
            lines.append(
                ("", "the paper", "-", f"{accuracy} %", f"{objective}", f"{error}", relative, f"{com}", f"{velocity}")
            )
    return markdown_table(header, lines)


def tail_rows(scores: Mapping[Category, Scores]) -> str:
    """Quantiles of the errors of each category, over all sets together."""
    quantities = ("objective, relative", "CoM [mm]", "velocity [mm/s]")
    header = ("category", *(f"{name}: {tail:g} %" for name in quantities for tail in TAILS))
    rows = (
        (
            f"{int(category) + 1} {category.words}",
            *(f"{100 * value:.1f} %" for value in row.relative),
            *(f"{1e3 * value:.1f}" for value in (*row.com, *row.velocity)),
        )
        for category, row in scores.items()
    )
    return markdown_table(header, rows)


def score_goals(scores: Mapping[Category, Scores]) -> list[Goal]:
    """What is asked of the median set at the paper's timing and friction."""
    found = []
    for category, scored in scores.items():
        if category not in PAPER:
            continue
        row = scored.median
        name, accuracy, error = f"category {int(category) + 1}", PAPER[category][0], PAPER[category][-1]
        rarer = min(row.infeasible, 1 - row.infeasible)
        found += [
            goals.at_least(f"{name}: accuracy", 100 * row.accuracy, accuracy, "%", 4),
            goals.at_least(f"{name}: share of the rarer label", 100 * rarer, 100 * LEAST_SHARE, "%"),
            goals.at_most(f"{name}: objective", 100 * row.relative_error, error, "%"),
            goals.at_most(f"{name}: final CoM", 1e3 * row.com_error, COM, "mm"),
            goals.at_most(f"{name}: final velocity", 1e3 * row.velocity_error, VELOCITY, "mm/s"),
        ]
    return found


def query_times(networks: Mapping[Category, TransitionNetwork]) -> dict[int, tuple[float, float]]:
    """Microseconds of a query alone and of a transition in batches, by category."""
    return {
        int(category): (1e6 * query_seconds(network, 1), 1e6 * query_seconds(network, BATCH) / BATCH)
        for category, network in networks.items()
    }


def encoding_table(scores: Mapping[str, EncodingScore]) -> str:
    """A row per encoding."""
    header = ("encoding", "inputs", "samples", "accuracy", "objective", "CoM [mm]", "velocity [mm/s]")
    rows = (
        (
            name,
            str(row.inputs),
            str(row.rows),
            f"{100 * row.accuracy:.1f} %",
            f"{100 * row.relative_objective_error:.1f} %",
            f"{1e3 * row.com_error:.1f}",
            f"{1e3 * row.velocity_error:.1f}",
        )
        for name, row in scores.items()
    )
    return markdown_table(header, rows)


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    made = argparse.ArgumentParser(
        prog="python -m validation.prediction",
        description=DESCRIPTION,
        epilog=options.GOAL_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    cli.add_robot_options(made)
    made.add_argument("--networks", type=Path, help="folder of networks (default: the robot's networks/)")
    made.add_argument("--data", type=Path, help="data set to test on (default: one is collected into --out)")
    made.add_argument(
        "--count", type=cli.positive(int), default=1000, help="transitions per category (default: %(default)s)"
    )
    made.add_argument(
        "--sets",
        type=cli.positive(int),
        default=5,
        help="test sets, each with a seed of its own (default: %(default)s)",
    )
    made.add_argument("--seed", type=int, help="first seed of the test sets (default: from the hash of the networks)")
    made.add_argument("--sequences", type=int, default=200, help="whole sequences; 0: none (default: 200)")
    made.add_argument("--train-data", type=Path, help="training data, to compare encodings on (default: left out)")
    made.add_argument("--encoding-category", type=int, choices=[int(c) for c in Category], default=9)
    made.add_argument("--encoding-samples", type=cli.positive(int), default=20_000)
    made.add_argument("--encoding-epochs", type=cli.positive(int), default=20)
    made.add_argument("--workers", type=cli.positive(int), default=cli.cores(), help="processes (default: all cores)")
    made.add_argument("--out", type=Path, default=Path("runs") / "validation" / "prediction", help="for collected data")
    options.add_results_option(made, "prediction")
    return made.parse_args(argv)


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    args, console = _arguments(argv), make_console()
    robot = load_robot(args.robot, args.robots)
    name = options.results_name("prediction", robot, args)
    networks = load_networks(robot, args.networks)
    folder = args.networks or robot.folder / "networks"
    seed = fresh_seed(folder, "prediction") if args.seed is None else args.seed
    sets, seeds = _sets(args, robot, list(networks), seed)
    scores = {
        title: {category: Scores.of(networks[category], groups) for category, groups in chosen.items()}
        for title, chosen in sets.items()
    }
    times = query_times(networks)
    found = score_goals(scores[DEFAULT])
    found.append(goals.at_most("query alone, slowest category", max(pair[0] for pair in times.values()), ALONE, "us"))
    found.append(goals.at_most(f"query in batches of {BATCH}", max(pair[1] for pair in times.values()), BATCHED, "us"))
    size = sum(path.stat().st_size for path in folder.glob("*.safetensors")) / 1e6
    found.append(goals.at_most("networks in all", size, WEIGHTS, "MB"))
    fewest = min(int(training_summary(network).get("samples", 0)) for network in networks.values())
    found.append(goals.at_least("training transitions, fewest of a category", fewest, 100_000, "", 6))

    sections = [
        (title, f"{WHOLE_NOTE}\n\n{score_rows(group, paper=title == DEFAULT)}\n\n{TAIL_NOTE}\n\n{tail_rows(group)}")
        for title, group in scores.items()
    ]
    sections.append(
        (
            "Time of a query",
            markdown_table(
                ("category", "alone [us]", f"in batches of {BATCH} [us a transition]"),
                ((str(category + 1), f"{alone:.0f}", f"{batch:.1f}") for category, (alone, batch) in times.items()),
            ),
        )
    )
    content: dict[str, Any] = {
        "scores": {
            title: {str(int(category)): asdict(row) for category, row in group.items()}
            for title, group in scores.items()
        },
        "query_microseconds": times,
    }
    if args.train_data is not None:
        first_set = {category: groups[0] for category, groups in sets[DEFAULT].items()}
        compared = _encodings(args, robot.fingerprint, first_set)
        words = Category(args.encoding_category).words
        sections.append((f"Encodings of orientations, category {args.encoding_category + 1} ({words})", compared[0]))
        content["encodings"] = compared[1]
    if args.sequences:
        result = relation(robot, count=args.sequences, seed=seed)
        draw_relation(result, args.results / f"{name}.png")
        sections.append(("Sum of predictions against whole sequences", _relation_text(result, name)))
        content["sequences"] = {"correlation": result.pearson, "ranks": result.spearman, "count": len(result.actual)}
    settings = {"robot": robot.name, "test seeds": seeds, "count": args.count, "sequences": args.sequences}
    path = write_results(
        args.results,
        name,
        title=f"What the networks of {robot.name} predict",
        sections=sections,
        content=content,
        goals=found,
        settings=settings,
    )
    show_results(console, path)
    return options.goal_code(found)


def _sets(
    args: argparse.Namespace, robot: RobotModel, categories: list[Category], seed: int
) -> tuple[dict[str, dict[Category, list[Samples]]], list[int]]:
    """Test sets by title and category, and their seeds: those of a data set that is given, else fresh ones."""
    folders = [args.data] if args.data is not None else []
    sets: dict[str, dict[Category, list[Samples]]] = {}
    for number in range(seed, seed + args.sets) if args.data is None else ():
        folders.append(args.out / f"fresh-{number}")
        fresh(folders[-1], robot, count=args.count, seed=number, workers=args.workers)
    for folder in folders:
        data, rng = read_dataset(folder, robot.fingerprint), np.random.default_rng(seed)
        for title, chosen in test_sets(data, categories, args.count, rng).items():
            for category, group in chosen.items():
                sets.setdefault(title, {}).setdefault(category, []).append(group)
    return sets, [seed_of(folder) for folder in folders]


def _encodings(args: argparse.Namespace, fingerprint: str, tests: dict) -> tuple[str, dict[str, Any]]:
    """Table and figures of the encodings on one category."""
    category = Category(args.encoding_category)
    train = read_dataset(args.train_data, fingerprint, limit=args.encoding_samples)
    if category not in train or category not in tests:
        raise DatasetError(f"{args.train_data}: holds no transitions of category {int(category)}; choose another")
    compared = compare_encodings(train[category], tests[category], category, epochs=args.encoding_epochs)
    return encoding_table(compared), {name: asdict(row) for name, row in compared.items()}


def _relation_text(result: Relation, picture: str) -> str:
    slope, intercept = result.line
    return (
        f"{len(result.actual)} contact sequences of rubble fields and corridors: correlation {result.pearson:.3f}, of "
        f"ranks {result.spearman:.3f}, robust line {slope:.2f} x + {intercept:.0f}; {result.infeasible} sequences "
        f"without a motion are left out. See {picture}.png."
    )


if __name__ == "__main__":
    cli.run(main)
