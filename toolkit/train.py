"""Command line: collect labels of whole motions, train the networks, evaluate them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit import cli

if TYPE_CHECKING:
    from rich.console import Console

    from toolkit.learning.collect import Collected
    from toolkit.robot.model import RobotModel

DESCRIPTION = """\
Make the networks with which the contact search judges transitions.

  collect    draw contact sequences in random worlds by the search, optimise each as a whole, and store what each
             transition costs in it
  fit        train a classifier and a regressor per category (needs torch: pip install -e '.[train]')
  evaluate   score the trained networks on fresh transitions
"""


def run_collect(args: argparse.Namespace, console: Console) -> int:
    """Run `collect`."""
    from toolkit.learning.collect import collect
    from toolkit.learning.collect_config import CollectConfig
    from toolkit.learning.dataset import begun_with
    from toolkit.learning.jobs import executor
    from toolkit.prediction.networks import digest
    from toolkit.report.console import print_warnings, progress_bar
    from toolkit.robot.loader import load_robot

    robot = load_robot(args.robot, args.robots)
    print_warnings(console, robot)
    networks = _searching_networks(args, robot)
    per_shard = begun_with(args.out, "per_shard")
    config = CollectConfig(
        robot=robot.name,
        robots=str(robot.folder.parent.resolve()),
        seed=args.seed,
        samples_per_category=args.samples,
        per_shard=min(CollectConfig.per_shard, args.samples) if per_shard is None else per_shard,
        networks=None if networks is None else str(networks.resolve()),
        networks_digest="" if networks is None else digest(networks),
    )
    with (
        executor(args.workers, args.cluster, unencrypted=args.cluster_unencrypted) as pool,
        progress_bar(console) as progress,
    ):
        task = progress.add_task("shards", total=config.shards)

        def tick(state: Collected) -> None:
            labels = f"{state.labelled} labels"
            progress.update(task, completed=state.shards, description=f"shards ({labels})")
            if not console.is_terminal:
                console.print(f"{state.shards} of {config.shards} shards, {labels}, {state.seconds:.0f} s")

        summary = collect(args.out, robot, config, pool, tick)
    rate = (summary.labelled - summary.resumed) / max(summary.seconds, 1e-9)
    share = summary.feasible / max(summary.samples, 1)
    for category, count in summary.labels.items():
        if count < args.samples:
            console.print(
                f"category {int(category)} ({category.words}) has {count} of {args.samples} labels: few worlds give "
                "any; a collection with another --seed in another folder adds more"
            )
    console.print(
        f"{summary.labelled} labels in {summary.seconds:.0f} s ({rate:.1f} per s, {summary.resumed} found from "
        f"before), fewest of a category: {min(summary.labels.values())}; with those judged alone {summary.samples} "
        f"transitions, feasible: {share:.0%}\n{args.out}"
    )
    return 0


def _searching_networks(args: argparse.Namespace, robot: RobotModel) -> Path | None:
    """Folder of the networks that take part in the search, made sure of; None for none."""
    from toolkit.prediction.networks import load_networks

    folder = args.networks or robot.folder / "networks"
    if args.no_networks or (args.networks is None and not folder.is_dir()):
        return None
    load_networks(robot, folder)
    return folder


def run_fit(args: argparse.Namespace, console: Console) -> int:
    """Run `fit`."""
    from toolkit.contacts.category import Category
    from toolkit.errors import DatasetError, InputError
    from toolkit.learning.dataset import read_datasets
    from toolkit.report.console import progress_bar
    from toolkit.robot.loader import load_robot

    try:
        from toolkit.learning.descent import FitConfig
        from toolkit.learning.fit import check_device, fit_category, is_trained, saved_curves, threads
    except ImportError:
        raise InputError("fit needs torch: pip install -e '.[train]'") from None
    from toolkit.report.curves import draw_curves

    robot = load_robot(args.robot, args.robots)
    out = args.out or robot.folder / "networks"
    data = read_datasets(args.data, robot.fingerprint, limit=args.limit)
    wanted = [Category(index) for index in args.categories] if args.categories else list(data)
    check_device(args.device)
    config = FitConfig(
        epochs=args.epochs,
        batch=args.batch,
        learning_rate=args.learning_rate,
        device=args.device,
        seed=args.seed,
        length=robot.scale.length,
        pace=robot.pace,
    )
    with threads(args.workers), progress_bar(console) as progress:
        task = progress.add_task("epochs", total=2 * config.epochs * len(wanted))
        for number, category in enumerate(wanted):
            if category not in data:
                raise DatasetError(f"{args.data[0]}: holds no transitions of category {int(category)}; collect more")
            samples = data[category]
            if args.resume and is_trained(category, out, robot.fingerprint, config, len(samples)):
                console.print(f"category {int(category)}: trained already")
                continue

            def tick(name: str, epoch: int, training: float, held: float, number=number, category=category) -> None:
                done = (2 * number + (name == "regressor")) * config.epochs + epoch + 1
                progress.update(task, completed=done, description=f"{int(category)} {name} {training:.4f} {held:.4f}")

            curves = fit_category(
                category,
                samples,
                fingerprint=robot.fingerprint,
                folder=out,
                config=config,
                progress=tick,
                keep_classifier=args.keep_classifiers,
                refine=args.refine,
            )
            if not console.is_terminal:
                losses = {name: round(float(curve.validation.min()), 4) for name, curve in curves.items()}
                console.print(f"category {int(category)}: {len(samples)} transitions, validation {losses}")
            draw_curves(saved_curves(out, robot.fingerprint), out / "learning_curves.png")
    console.print(str(out))
    return 0


def run_evaluate(args: argparse.Namespace, console: Console) -> int:
    """Run `evaluate`."""
    import numpy as np

    from toolkit.errors import DatasetError
    from toolkit.learning.dataset import read_dataset
    from toolkit.learning.evaluate import balanced, query_seconds, score
    from toolkit.learning.samples import Split
    from toolkit.prediction.networks import load_networks
    from toolkit.report.scores import score_table
    from toolkit.robot.loader import load_robot

    robot = load_robot(args.robot, args.robots)
    networks = load_networks(robot, args.networks)
    data = read_dataset(args.data, robot.fingerprint)
    if args.split != "all":
        data = {category: samples.of(Split[args.split.upper()]) for category, samples in data.items()}
    at_default = {category: samples.at_default() for category, samples in data.items()}
    for title, chosen in (("1 s + 1 s, friction 0.5", at_default), ("all timings and frictions", data)):
        rng = np.random.default_rng(args.seed)
        scores = {}
        for category, network in networks.items():
            if category not in data or not data[category].known.any():
                raise DatasetError(f"{args.data}: too few transitions of category {int(category)}; collect more")
            if chosen[category].known.any():
                scores[category] = score(network, balanced(chosen[category], args.count, rng))
        console.print(f"{title}:")
        console.print(score_table(scores))
    network = next(iter(networks.values()))
    alone, batch = query_seconds(network, 1), query_seconds(network, 60) / 60
    console.print(f"a query: {alone * 1e6:.0f} us alone, {batch * 1e6:.1f} us a transition in batches of 60")
    return 0


def _category(text: str) -> int:
    """An argparse type: the number of a contact category."""
    from toolkit.contacts.category import Category

    numbers = [int(category) for category in Category]
    if text not in map(str, numbers):
        raise argparse.ArgumentTypeError(f"{text!r} is none of {numbers[0]} to {numbers[-1]}")
    return int(text)


def _split(text: str) -> str:
    """An argparse type: which part of the worlds of a data set."""
    from toolkit.learning.samples import Split

    names = ["all", *(split.name.lower() for split in Split)]
    if text not in names:
        raise argparse.ArgumentTypeError(f"{text!r} is none of {', '.join(names)}")
    return text


def main(argv: list[str] | None = None) -> int:
    """Run one of the subcommands; returns the exit code."""
    parser = cli.parser("train", DESCRIPTION)
    commands = parser.add_subparsers(dest="command", required=True)

    def add(name: str, help_text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=help_text, description=help_text)
        cli.add_robot_options(sub)
        sub.add_argument("--seed", type=cli.seed, default=0, help="seed of every random draw (default: %(default)s)")
        return sub

    sub = add("collect", "draw and label whole sequences; continues where it was stopped")
    sub.add_argument("--out", type=Path, required=True, help="data set folder, new or begun")
    sub.add_argument(
        "--samples",
        type=cli.positive(int),
        default=5000,
        help="labels of each category at least (default: %(default)s)",
    )
    sub.add_argument(
        "--networks", type=Path, help="folder of networks that search as well (default: the robot's networks/, if any)"
    )
    sub.add_argument("--no-networks", action="store_true", help="search without networks")
    sub.add_argument(
        "--workers", type=cli.positive(int), default=cli.cores(), help="number of processes (default: all cores)"
    )
    cli.add_cluster_options(sub)
    sub.set_defaults(run=run_collect)

    sub = add("fit", "train a classifier and a regressor per category")
    sub.add_argument("--data", type=Path, required=True, nargs="+", help="data set folder, or several")
    sub.add_argument("--out", type=Path, help="folder for the networks (default: the robot's networks/)")
    sub.add_argument("--epochs", type=cli.positive(int), default=120, help="epochs at most (default: %(default)s)")
    sub.add_argument("--batch", type=cli.positive(int), default=512, help="samples per step (default: %(default)s)")
    sub.add_argument("--limit", type=cli.positive(int), help="transitions per category at most")
    sub.add_argument("--resume", action="store_true", help="keep what was trained with the same settings before a stop")
    sub.add_argument(
        "--learning-rate",
        type=cli.positive(float, 1),
        default=4e-3,
        help="highest learning rate, at most 1 (default: %(default)s)",
    )
    sub.add_argument("--refine", action="store_true", help="train the regressors in --out further, keep classifiers")
    sub.add_argument("--keep-classifiers", action="store_true", help="keep the classifiers in --out, train regressors")
    sub.add_argument("--categories", type=_category, nargs="+", metavar="NUMBER", help="only these categories")
    sub.add_argument(
        "--workers", type=cli.positive(int), default=cli.cores(), help="number of threads (default: all cores)"
    )
    sub.add_argument("--device", default="cpu", help="where torch computes, such as cuda (default: %(default)s)")
    sub.set_defaults(run=run_fit)

    sub = add("evaluate", "score the networks on transitions that they have not seen")
    sub.add_argument("--data", type=Path, required=True, help="data set folder")
    sub.add_argument(
        "--split",
        type=_split,
        default="test",
        metavar="PART",
        help="which worlds of the data set: training, validation, test, or all, which is fair only where the networks "
        "did not learn from it (default: %(default)s)",
    )
    sub.add_argument("--networks", type=Path, help="folder of networks (default: the robot's networks/)")
    sub.add_argument(
        "--count", type=cli.positive(int), default=1000, help="transitions per category (default: %(default)s)"
    )
    sub.set_defaults(run=run_evaluate)

    args = parser.parse_args(argv)
    from toolkit.report.console import make_console

    return args.run(args, make_console())


if __name__ == "__main__":
    cli.run(main)
