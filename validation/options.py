"""What the experiments' command lines share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from toolkit import cli
from toolkit.errors import RobotError
from toolkit.execution.config import ExecutionConfig
from toolkit.pipeline import planner_kind
from toolkit.prediction.networks import load_networks
from toolkit.robot.loader import default_robot, load_robot
from toolkit.robot.model import RobotModel
from validation.cases import kind_of
from validation.fresh_seeds import fresh_seed
from validation.goals import NOT_MET, Goal
from validation.jobs import PoolOptions
from validation.machine import ROOT, code_fingerprint, folder_fingerprint

RESULTS = ROOT / "validation" / "results"
EXIT_CODES = "exit codes: 0 every trial passed, 1 one failed (see the results), 2 bad input"
GOAL_CODES = "exit codes: 0 every goal that was checked is met, 1 one is not (see the results), 2 bad input"


def parser(module: str, description: str, kinds: Sequence[str], trials: int) -> argparse.ArgumentParser:
    """Parser of `python -m validation.<module>` with everything that a trial and the pool need."""
    made = plain_parser(module, description)
    made.add_argument(
        "--trials",
        type=cli.positive(int),
        default=trials,
        help="trials of each random kind of world (default: %(default)s)",
    )
    made.add_argument("--kinds", nargs="+", default=list(kinds), metavar="KIND", help=f"default: {' '.join(kinds)}")
    return made


def plain_parser(module: str, description: str) -> argparse.ArgumentParser:
    """The same without the options that choose the worlds."""
    made = argparse.ArgumentParser(
        prog=f"python -m validation.{module}",
        description=description,
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        conflict_handler="resolve",
    )
    cli.add_robot_options(made)
    cli.add_planning_options(made)
    # A trial's own number seeds everything in it: the option of a single run gives way to this one.
    made.add_argument("--seed-offset", "--seed", type=int, default=0, metavar="N", help="first seed (default: 0)")
    made.add_argument(
        "--workers", type=count, default=cli.cores(), help="processes, one thread each; 0: this one (default: cores)"
    )
    cli.add_cluster_options(made)
    made.add_argument(
        "--out",
        type=Path,
        default=Path("runs") / "validation" / module,
        metavar="DIR",
        help="trials and the runs of those that failed; trials found there are not run again (default: %(default)s)",
    )
    add_results_option(made, module)
    return made


def add_results_option(target: argparse.ArgumentParser, module: str) -> None:
    """Add `--results`."""
    target.add_argument(
        "--results",
        type=Path,
        default=RESULTS,
        metavar="DIR",
        help=f"where {module}.json and {module}.md go (default: validation/results)",
    )


def count(text: str) -> int:
    """An argparse type: a whole number from 0 on."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below zero")
    return value


@dataclass(frozen=True)
class TrialSettings:
    """What every trial of an experiment is told; can be sent to another process.

    Attributes:
        robot: name. robots: folder that holds it.
        planner: who judges transitions, "auto" already resolved.
        planning: the planning options of the command line; their `planner` gives way to this one.
        out: folder for runs.
        recording: whether runs are kept with a recording.
        replanning: whether runs replan.
    """

    robot: str
    robots: Path
    planner: str
    planning: cli.PlanningOptions
    out: Path
    recording: bool = True
    replanning: bool = True

    @property
    def execution(self) -> ExecutionConfig:
        """How plans are carried out."""
        return ExecutionConfig(replanning=self.replanning)

    def described(self) -> dict[str, Any]:
        """As JSON can hold it, for results: what decides them."""
        names = ("timing", "time_limit", "expansions", "no_palms", "steps", "heuristic")
        own = {"robot": self.robot, "planner": self.planner, "replanning": self.replanning}
        planning = asdict(self.planning) | {"timing": self.planning.timing or None}
        return own | {name: planning[name] for name in names}

    def deciding(self) -> dict[str, Any]:
        """What a trial's record depends on, the code and the robot's files included."""
        return {
            **{name: str(value) for name, value in self.described().items()},
            "code": code_fingerprint(),
            "robot_files": folder_fingerprint(self.robots / self.robot),
        }


def settings_of(args: argparse.Namespace) -> TrialSettings:
    """Settings of the trials.

    Raises:
        InputError: a kind of world is unknown, the robot cannot be loaded, or the networks that were asked for are not
            there.
    """
    for kind in args.kinds:
        kind_of(kind)
    return trial_settings(args)


def trial_settings(args: argparse.Namespace) -> TrialSettings:
    """Settings of the trials of a program that has kinds of worlds of its own.

    Raises:
        InputError: the robot cannot be loaded, or the networks that were asked for are not there.
    """
    robot = load_robot(args.robot, args.robots)
    planner = planner_kind(robot, args.planner)
    if planner == "learned":
        load_networks(robot)  # a planner that lacks its networks is refused before the first trial
    folder = robot.folder.resolve()
    replanning = getattr(args, "replanning", True)  # not every experiment executes
    planning = cli.PlanningOptions.of(args)
    return TrialSettings(folder.name, folder.parent, planner, planning, args.out.resolve(), replanning=replanning)


def results_name(program: str, robot: RobotModel, args: argparse.Namespace) -> str:
    """Name of a program's results: the program's for the robot that is used if none is named, else with the robot's."""
    try:
        default = args.robot is None or robot.name == default_robot(args.robots)
    except RobotError:  # a folder of several robots, of which one was named
        default = False
    return program if default else f"{program}_{robot.name}"


def first_seed(args: argparse.Namespace, purpose: str) -> int:
    """The seed that the options ask for, else the one that is made from the robot's networks.

    Raises:
        InputError: the robot has no networks.
    """
    if args.seed_offset is not None:
        return args.seed_offset
    return fresh_seed(load_robot(args.robot, args.robots).folder / "networks", purpose)


def goal_code(found: Sequence[Goal]) -> int:
    """Exit code of an experiment that has goals; see `GOAL_CODES`."""
    return int(any(goal.result == NOT_MET for goal in found))


def pool_of(args: argparse.Namespace) -> PoolOptions:
    """Where trials run."""
    return PoolOptions(args.workers, args.cluster, args.cluster_unencrypted)
