"""What labels depend on, and how far predictions go astray in a row: `python -m validation.labels`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from toolkit import cli
from toolkit.contacts.category import Category, category_of
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.errors import InputError, PlanningError
from toolkit.learning.label import LabelledSequence, label
from toolkit.learning.samples import PLANNED
from toolkit.learning.scout import Scout
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.prediction.features import ahead, encode
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.prediction.network import TransitionNetwork
from toolkit.prediction.networks import load_networks
from toolkit.report.console import make_console
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import ContactPlanner
from toolkit.search.planner_config import PlannerConfig
from toolkit.world.generators import rubble_corridor, rubble_field, stepping_stones
from toolkit.world.loader import load_world
from toolkit.world.world import Goal, World
from validation import goals, options
from validation.tables import markdown_table, number, show_results, write_results

DESCRIPTION = """\
Measure what a transition's label depends on. Searches with random goals draw sequences in random worlds;
of those that begin alike, ten continuations are optimised each. Then, on the same sequences: the error of the CoM after
ten chained predictions, the share of their transitions that the networks reject, and the sum of the predictions against
the objective.
"""
CONTINUATIONS = 10  # of one prefix
CHAIN = 10  # predictions in a row
AGES = 3  # transitions before the end of the prefix that are looked at
SEARCHES = 40  # most searches for the continuations of one prefix
ASIDE, AHEAD = 0.3, 0.4  # m; deviations of the goals of one world
NOISE, EXPANSIONS = 0.3, (60, 300)  # of a search
KINDS = (rubble_field, rubble_corridor, stepping_stones)


@dataclass(frozen=True)
class Spread:
    """Labels of one transition over several continuations of its prefix.

    Attributes:
        age: Number of transitions of the prefix after it.
        objective: (k,) what it costs in each whole motion.
        com: (k, 3) m; CoM after it.
        com_velocity: (k, 3) m/s; its velocity.
    """

    age: int
    objective: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray


@dataclass(frozen=True)
class SpreadRow:
    """Labels of transitions of one age; medians over the prefixes.

    Attributes:
        age: As in `Spread`.
        prefixes: Number of prefixes.
        relative: Standard deviation of the objective over its mean.
        unexplained: Part of the variance of all objectives that is left within prefixes.
        com: Root mean square distance in m of the CoM from its mean.
        com_velocity: The same of its velocity in m/s.
    """

    age: int
    prefixes: int
    relative: float
    unexplained: float
    com: float
    com_velocity: float


@dataclass(frozen=True)
class Chained:
    """Predictions of one sequence.

    Attributes:
        com_error: Distance in m between the predicted and the optimised CoM after `CHAIN` transitions, each predicted
            from the prediction before; None where the sequence is shorter.
        rejected: Number of transitions that are called infeasible from the states of the whole motion.
        transitions: Number of transitions.
        predicted: Sum of the predicted objectives along the chain.
        objective: Objective of the whole motion.
    """

    com_error: float | None
    rejected: int
    transitions: int
    predicted: float
    objective: float


class Along(TransitionEvaluator):
    """Judges as another judge, but keeps a search on the first transitions of a sequence."""

    def __init__(self, judge: TransitionEvaluator, sequence: ContactSequence, length: int):
        self._judge = judge
        self._next = {
            _places(stance): sequence.transitions[row] for row, stance in enumerate(sequence.stances[:length])
        }

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """See `TransitionEvaluator`."""
        batch, wanted = self._judge.evaluate(stance, com, com_velocity, transitions), self._next.get(_places(stance))
        if wanted is None:
            return batch
        same = [_place(transitions[row]) == _place(wanted) for row in range(len(transitions))]
        return replace(batch, feasible=batch.feasible & same)


def drawn_sequences(
    robot: RobotModel, world: World, rng: np.random.Generator, base: ContactSequence | None = None, length: int = 0
) -> list[ContactSequence]:
    """Sequences to a random goal, of a search whose judge is a little random; they begin as `base` does, if given."""
    aside, short = rng.normal(), abs(rng.normal())
    goal = Goal(world.goal.position + [-AHEAD * short, ASIDE * aside, 0.0], world.goal.radius)
    judge: TransitionEvaluator = Scout(KinematicEvaluator(robot), np.ones(len(Category)), NOISE, rng)
    if base is not None:
        judge = Along(judge, base, length)
    search = AnaStarConfig(max_expansions=int(rng.integers(*EXPANSIONS)))
    planner = ContactPlanner(robot, replace(world, goal=goal), judge, PlannerConfig(timings=(PLANNED,), search=search))
    with suppress(PlanningError):  # no way to such a goal
        return [solution.sequence for solution in planner.search(rng, np.inf).solutions]
    return []


def continuations(
    robot: RobotModel, world: World, base: ContactSequence, length: int, rng: np.random.Generator
) -> list[LabelledSequence]:
    """Up to `CONTINUATIONS` feasible sequences that begin as `base` does and differ in the two transitions then."""
    found: dict[tuple, LabelledSequence] = {}
    for _ in range(SEARCHES):
        for sequence in drawn_sequences(robot, world, rng, base, length):
            key = tuple(map(_place, sequence.transitions[: length + 2]))
            if len(key) == length + 2 and key not in found:
                labelled = label(robot, sequence)
                if labelled is not None:
                    found[key] = labelled
            if len(found) == CONTINUATIONS:
                return list(found.values())
    return list(found.values())


def _place(item: ContactTransition) -> tuple:
    """The limb and its new place to 1 mm."""
    place = () if item.contact is None else tuple(np.round(item.contact.pose.position, 3).tolist())
    return int(item.limb), place


def _places(stance: Stance) -> tuple:
    """The limbs of a stance and their places to 1 mm."""
    return tuple((int(item.limb), *np.round(item.pose.position, 3).tolist()) for item in stance.contacts)


def spreads(length: int, labelled: Sequence[LabelledSequence]) -> list[Spread]:
    """Labels of the last transitions of a prefix of at least `AGES`, over sequences that begin with it."""
    found = []
    for age in range(AGES):
        outcomes = [item.outcome(length - 1 - age) for item in labelled]
        objective, com, velocity = (np.array(column) for column in zip(*outcomes, strict=True))
        found.append(Spread(age, objective, com, velocity))
    return found


def spread_rows(found: Sequence[Spread]) -> list[SpreadRow]:
    """One row per age."""
    rows = []
    for age in range(AGES):
        same = [item for item in found if item.age == age]
        if not same:
            continue
        every = np.concatenate([item.objective for item in same])
        within = np.mean([item.objective.var() for item in same])
        rows.append(
            SpreadRow(
                age,
                len(same),
                float(np.median([item.objective.std() / item.objective.mean() for item in same])),
                float(within / every.var()),
                float(np.median([_deviation(item.com) for item in same])),
                float(np.median([_deviation(item.com_velocity) for item in same])),
            )
        )
    return rows


def _deviation(points: np.ndarray) -> float:
    """Root mean square distance of points (k, 3) from their mean."""
    return float(np.sqrt(((points - points.mean(0)) ** 2).sum(1).mean()))


def chained(labelled: LabelledSequence, networks: Mapping[Category, TransitionNetwork]) -> Chained:
    """Predictions along a sequence, each from the one before."""
    count, rejected, predicted, error = len(labelled.sequence.transitions), 0, 0.0, None
    com, velocity = labelled.parts.com[0], labelled.parts.com_velocity[0]
    goal = labelled.goal
    for index in range(count):
        problem = labelled.problem(index)
        network = networks[category_of(problem.stance, problem.transition)]
        _, true = encode(problem.stance, problem.com, problem.com_velocity, [problem.transition])
        rejected += int(not network.feasible(true)[0])
        frame, features = encode(problem.stance, com, velocity, [problem.transition])
        outputs = network.predict(features, ahead(frame.point(goal)))[0].astype(float)
        predicted += outputs[0]
        com, velocity = frame.point_back(outputs[1:4]), frame.vector_back(outputs[4:7])
        if index + 1 == CHAIN:
            error = float(np.linalg.norm(com - labelled.parts.com[CHAIN]))
    return Chained(error, rejected, count, predicted, float(labelled.parts.objective.sum()))


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    made = argparse.ArgumentParser(
        prog="python -m validation.labels",
        description=DESCRIPTION,
        epilog=options.GOAL_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    cli.add_robot_options(made)
    made.add_argument("--networks", type=Path, help="folder of networks (default: the robot's networks/)")
    made.add_argument("--no-networks", action="store_true", help="measure the labels alone")
    made.add_argument("--worlds", type=cli.positive(int), default=12, help="random worlds (default: %(default)s)")
    made.add_argument("--prefixes", type=cli.positive(int), default=3, help="of each world (default: %(default)s)")
    made.add_argument("--seed", type=cli.seed, default=1001, help="seed of worlds and searches (default: %(default)s)")
    options.add_results_option(made, "labels")
    return made.parse_args(argv)


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    args, console = _arguments(argv), make_console()
    robot = load_robot(args.robot, args.robots)
    networks = {} if args.no_networks else load_networks(robot, args.networks)
    found: list[Spread] = []
    chains: list[Chained] = []
    for index in range(args.worlds):
        rng = np.random.default_rng([args.seed, index])
        kind = KINDS[index % len(KINDS)]
        world = load_world(f"{kind.__name__}.xml", mjcf=kind(rng))
        base = next(iter(drawn_sequences(robot, world, rng)), None)
        if base is None or len(base.transitions) < AGES + 3:
            continue
        before = len(found)
        lengths = rng.permutation(np.arange(AGES, len(base.transitions) - 2))[: args.prefixes]
        for length in lengths.tolist():
            labelled = continuations(robot, world, base, length, rng)
            if len(labelled) == CONTINUATIONS:
                found += spreads(length, labelled)
            chains += [chained(item, networks) for item in labelled if networks]
        console.print(f"{index + 1} of {args.worlds} worlds: {(len(found) - before) // AGES} prefixes")
    if not found:
        raise InputError("no prefix has ten continuations; ask for more --worlds")
    rows = spread_rows(found)
    sections = [("Labels of one prefix over its continuations", _spread_table(rows))]
    wanted, content = [], {"spread": [asdict(row) for row in rows]}
    if chains:
        errors = [item.com_error for item in chains if item.com_error is not None]
        share = 100.0 * sum(item.rejected for item in chains) / sum(item.transitions for item in chains)
        ratio = np.array([item.predicted / item.objective for item in chains])
        astray = _percentiles(1e3 * np.array(errors))
        text = (
            f"{len(errors)} sequences of at least {CHAIN} transitions: CoM error {astray} mm; {len(chains)} "
            f"sequences: sum of predictions over the objective {_percentiles(ratio)} (median, 90 %, largest); "
            f"{share:.1f} % of their transitions are called infeasible."
        )
        sections.append((f"{CHAIN} predictions in a row", text))
        content["chains"] = [asdict(item) for item in chains]
        wanted.append(goals.at_most("CoM after ten predictions, median", 1e3 * float(np.median(errors)), 20.0, "mm"))
        wanted.append(goals.at_most("rejected transitions of feasible sequences", share, 5.0, "%"))
    settings = {"robot": robot.name, "worlds": args.worlds, "prefixes": args.prefixes, "seed": args.seed}
    path = write_results(
        args.results,
        "labels",
        title="What labels depend on",
        sections=sections,
        content=content,
        goals=wanted,
        settings=settings,
    )
    show_results(console, path)
    return options.goal_code(wanted)


def _percentiles(figures: np.ndarray) -> str:
    """Median, 90 % and largest of figures."""
    return " / ".join(number(float(value)) for value in np.percentile(figures, [50, 90, 100])) if len(figures) else "-"


def _spread_table(rows: Sequence[SpreadRow]) -> str:
    """The rows in Markdown."""
    header = (
        "transitions of the prefix after it",
        "prefixes",
        "objective: deviation [%]",
        "variance within prefixes [%]",
        "CoM [mm]",
        "velocity [mm/s]",
    )
    lines = (
        (
            str(row.age),
            str(row.prefixes),
            f"{100 * row.relative:.1f}",
            f"{100 * row.unexplained:.1f}",
            f"{1e3 * row.com:.1f}",
            f"{1e3 * row.com_velocity:.1f}",
        )
        for row in rows
    )
    return markdown_table(header, lines)


if __name__ == "__main__":
    cli.run(main)
