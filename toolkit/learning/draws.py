"""Contact sequences that searches find in a world, with random judges and weights, and variants of them."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.category import Category
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import PlanningError
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.quota import Quota
from toolkit.learning.scout import Scout
from toolkit.learning.variants import part_of, stepping_aside, timed, with_palms
from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.prediction.kinematic import KinematicConfig, KinematicEvaluator
from toolkit.prediction.network import TransitionNetwork
from toolkit.prediction.networks import NetworkEvaluator
from toolkit.prediction.optimiser import OptimiserEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner import ContactPlanner
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.quasi_static import QuasiStaticEvaluator
from toolkit.world.timing import Timing
from toolkit.world.world import World

_NOISE = 0.5  # greatest deviation of the logarithm of the noise on objectives
_TIME, _PACE = 10.0, 50.0  # middle of the costs of a second, where timings are drawn or a planner's own choice
_COSTLY = 4  # part of the expansions where the optimiser judges
_ASIDE = 0.7  # share of the variants without palms that have some other steps
_CUT = 0.2  # share of variants that are cut
_WITH_PALMS = 0.6  # share of variants with palms, while labels of such transitions are lacking; half of it otherwise
_RETIMED = 0.3  # share of variants with other timings than the search's, where these are a planner's own choice
_CHEAP = 0.05  # factor on objectives of categories of which labels are lacking, in every other search


@dataclass(frozen=True)
class Place:
    """Where sequences are drawn.

    Attributes:
        robot: The robot.
        world: The world.
        timings: Timings of transitions to choose from.
        steep: Whether no foot can rest somewhere on the way.
        networks: Networks that may judge; empty for none.
        paced: Whether the timings are a planner's own choice.
    """

    robot: RobotModel
    world: World
    timings: tuple[Timing, ...]
    steep: bool
    networks: Mapping[Category, TransitionNetwork]
    paced: bool = False


def draw_sequences(
    place: Place, quota: Quota, config: CollectConfig, rng: np.random.Generator
) -> list[tuple[ContactSequence, Scout]]:
    """Sequences of several searches in a world, each with the judge of its search; none where no way was found."""
    found = []
    for _ in range(config.searches):
        scout = Scout(_judge(place, rng), _factors(quota, rng), rng.uniform(0.0, _NOISE), rng)
        planner = ContactPlanner(place.robot, place.world, scout, _settings(place, config, rng))
        with suppress(PlanningError):  # no room at the start, or no way to the goal
            solutions = planner.search(rng, np.inf).solutions
            sequences = [solution.sequence for solution in solutions if solution.sequence.transitions]
            kept = rng.permutation(len(sequences))[: config.kept]
            sequences = [sequences[index] for index in sorted(kept)]
            sequences += [_variant(place, sequences, scout, quota, rng) for _ in range(config.variants) if sequences]
            found += [(sequence, scout) for sequence in sequences]
    return found


def _variant(
    place: Place, sequences: list[ContactSequence], scout: Scout, quota: Quota, rng: np.random.Generator
) -> ContactSequence:
    """One of the sequences, changed in a random way."""
    sequence = sequences[int(rng.integers(len(sequences)))]
    lacking = any(category.palms_before or not category.moving.is_foot for category in quota.lacking)
    if not place.steep and rng.random() < (_WITH_PALMS if lacking else _WITH_PALMS / 2):
        sequence = with_palms(place.robot, sequence, scout, quota, rng)
    elif rng.random() < _ASIDE:
        sequence = stepping_aside(sequence, scout, rng)
    if rng.random() < _CUT:
        sequence = part_of(sequence, rng)
    retimed = len(place.timings) > 1 and rng.random() < (_RETIMED if place.paced else 1.0)
    return timed(sequence, list(place.timings), rng) if retimed else sequence


def _judge(place: Place, rng: np.random.Generator) -> TransitionEvaluator:
    """A judge of one of all kinds, with random weights."""
    robot = place.robot
    if place.steep:
        return NetworkEvaluator(dict(place.networks), place.world.goal) if place.networks else OptimiserEvaluator(robot)
    kinds = ["kinematic", "kinematic", "quasi-static"] + 3 * ["learned"] * bool(place.networks)
    match kinds[int(rng.integers(len(kinds)))]:
        case "kinematic":
            weights = {name: 30.0 * _spread(rng, 5.0) for name in ("stride", "rise", "tilt", "spread")}
            relief = float(np.exp(rng.uniform(np.log(0.05), np.log(1.5))))
            return KinematicEvaluator(robot, KinematicConfig(**weights, palm_relief=relief))
        case "quasi-static":
            return QuasiStaticEvaluator(robot)
        case _:
            return NetworkEvaluator(dict(place.networks), place.world.goal)


def _factors(quota: Quota, rng: np.random.Generator) -> np.ndarray:
    """(len(Category),) factors of the categories' objectives; what is lacking is cheap in every other search."""
    factors = np.array([_spread(rng, 2.0) for _ in Category])
    if rng.random() < 0.5:
        factors[[int(category) for category in quota.lacking]] *= _CHEAP
    return factors


def _settings(place: Place, config: CollectConfig, rng: np.random.Generator) -> PlannerConfig:
    """Random settings of a search."""
    cost = CostConfig(
        step=3.0 * _spread(rng, 4.0),
        dynamics=0.1 * _spread(rng, 4.0),
        time=(_PACE if place.paced else _TIME) * _spread(rng, 3.0),
        steep=200.0 * rng.random(),
    )
    expansions = int(rng.integers(*config.expansions)) // (_COSTLY if place.steep and not place.networks else 1)
    search = AnaStarConfig(epsilon=rng.uniform(0.0, 0.4), max_expansions=expansions)
    return PlannerConfig(
        steps=int(rng.choice([38, 60])),
        timings=place.timings,
        cost=cost,
        acceptable_cost=300.0 * _spread(rng, 10.0),
        search=search,
    )


def _spread(rng: np.random.Generator, factor: float) -> float:
    """A random number between 1 / factor and factor, uniform in its logarithm."""
    return float(np.exp(rng.uniform(-1.0, 1.0) * np.log(factor)))
