"""ContactPlanner: an anytime search from a start to a goal over contact transitions of feet and palms."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.errors import PlanningError
from toolkit.geometry.limb import PALMS, Limb
from toolkit.mjcf import warnings_refused
from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStar, AnaStarResult
from toolkit.search.anytime.graph import Progress
from toolkit.search.arrival import Arrival, Finish
from toolkit.search.costs.delay import Delay, Facing, Haste
from toolkit.search.costs.edge_cost import EdgeCost
from toolkit.search.ground import Ground, Way
from toolkit.search.judging import Judging, Tally
from toolkit.search.moves.candidates import CandidateGenerator, mean_feet
from toolkit.search.moves.drift import Drift
from toolkit.search.moves.exclusion import Blame, Exclusion
from toolkit.search.moves.reach_check import ReachCheck
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.problem import ContactProblem, Parts
from toolkit.search.result import SearchResult, Solution, feet_at, reason_of
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.search.states.contact_table import ContactTable
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import CONTACTS, is_pending, unpack
from toolkit.search.strategies import Strategy, strategy_of
from toolkit.world.timing import Timing, given_timings, timings_of
from toolkit.world.world import World

_STRIKES = 2  # failures of the whole sequence in like transitions after which the search avoids them
_UNTRAINED = (
    "times or friction below what the networks were trained for, where they can only guess; what they accept wrongly "
    "is found out when a sequence is optimised"
)


class ContactPlanner:
    """Plans contact sequences for one robot in one world.

    Args:
        robot: The robot.
        world: The world.
        evaluator: Judges the dynamics of transitions.
        config: Settings; the default ones where None.
        finish: Optimises the whole sequences that reach the goal; None: they are not optimised.

    Attributes:
        ground: The world as the robot can walk it.
    """

    def __init__(
        self,
        robot: RobotModel,
        world: World,
        evaluator: TransitionEvaluator,
        config: PlannerConfig | None = None,
        finish: Finish | None = None,
    ):
        self.robot, self.world, self.config = robot, world, config or PlannerConfig()
        self._evaluator, self._finish = evaluator, finish
        self.ground = Ground(robot, world, self.config)

    def timings(self, calmer: int = 0, *, slides: bool = False) -> tuple[Timing, ...]:
        """The timings of a transition to choose from when the pace has yielded so often.

        Where the ground `slides`, standing for longer does not help, so the pace never yields, and is a run's where it
        is the planner's to choose. Judges that know no dynamics begin with the second pace (the first is that of -1),
        but not for soles that roll, which stride along first: a robot stands the worse the longer it stands on one.
        Heavy rotors make a world's own timing longer, as they do the planner's.
        """
        config, rolls = self.config, not self.robot.stands_on_one_foot
        pace = 0 if slides else calmer + self._held_back
        own = self.world.timing and self.world.timing.times(self.robot.rotor_factor)
        timings = timings_of(config.timings, own, self.robot.pace, pace, slides=slides, rolls=rolls)
        return timings[:1] if config.one_timing else timings

    @property
    def _held_back(self) -> bool:
        """Whether searches begin with the second pace."""
        return self.config.one_timing and self.robot.stands_on_one_foot

    @property
    def paced(self) -> bool:
        """Whether the timing is the planner's to choose."""
        return not given_timings(self.config.timings, self.world.timing)

    def _paces_after(self, calmer: int, *, slides: bool) -> tuple[Timing, ...]:
        """The calmest timing of every pace to which the pace may still yield."""
        found = [self.timings(calmer, slides=slides)]
        while (after := self.timings(calmer + len(found), slides=slides)) != found[-1]:
            found.append(after)
        return tuple(timings[0] for timings in found[1:])

    @warnings_refused("the contact search", PlanningError)
    def search(
        self,
        rng: np.random.Generator,
        time_limit: float,
        observer: Callable[[Progress], None] | None = None,
        exclusions: Sequence[Exclusion] = (),
        palms: bool = True,
        calmer: int = 0,
        care: int = 0,
    ) -> SearchResult:
        """Search for contact sequences until the time is up or nothing can improve.

        Args:
            rng: Generator of the random expansions.
            time_limit: Limit in s, without the time for the heuristic.
            observer: Told of progress and of every solution.
            exclusions: Transitions that later stages rejected; the search avoids them.
            palms: Whether this search may use palms, where `config.palms` allows them at all.
            calmer: How often the pace has yielded, where it is the planner's to choose; see `timings`.
                -1 where a `brisker` one was left after the search before.
            care: How often the margins of the legs have grown, up to `MOST_CARE`.

        Returns:
            Every solution, or the reason why there is none.

        Raises:
            PlanningError: The robot cannot stand at the start, or nothing leads to the goal.
        """
        start = self.ground.start_stance()
        began = time.perf_counter()
        way = self.ground.way(start)
        heuristic_seconds = time.perf_counter() - began
        com = initial_com(self.robot, start)
        tally, timings = Tally(), self.timings(calmer, slides=way.slides)
        self._warm_up(start, com, timings)
        strategy, blame = self.strategy(way), Blame(exclusions, _STRIKES, scale=self.robot.scale.length)
        deadline = time.perf_counter() + time_limit
        parts = self.parts(way, strategy, timings, tally, blame.exclusions, palms=palms, care=care, deadline=deadline)
        state = parts.reader.at_rest(start, com)
        settings, paces = replace(strategy.search, unit=parts.cost.unit), self._paces_after(calmer, slides=way.slides)
        if paces or way.slides:  # a calmer search follows, or the strategy has extended the limit
            settings = replace(settings, persistence=1)
        judge = None if self._finish is None else Arrival(self._finish, parts.reader, parts.cost, tally, blame)
        problem = ContactProblem(parts, state)
        result = AnaStar(problem, rng, settings, judge).run(time_limit, observer)
        return SearchResult(
            solutions=tuple(Solution.of(parts.reader, path) for path in result.paths),
            seconds=result.seconds,
            heuristic_seconds=heuristic_seconds,
            expansions=result.expansions,
            exhausted=result.stopped_by == "exhausted",
            expanded=_places(parts.table, result.expanded),
            reason="" if result.paths else self._reason(result, tally, _nearest(parts.table, problem, result.expanded)),
            warning=_UNTRAINED if tally.untrained else "",
            slides=way.slides,
            paced=self.paced,
            calmer=paces,
            brisker=self.paced and self._held_back and calmer == 0 and not way.slides,
            screen=parts.screen,
        )

    def _warm_up(self, start: Stance, com: np.ndarray, timings: tuple[Timing, ...]) -> None:
        """Ask the evaluator once, so that what it compiles or loads at first takes no time of the search."""
        still = [ContactTransition(Limb.LEFT_FOOT, start[Limb.LEFT_FOOT], timing) for timing in timings[:1]]
        self._evaluator.evaluate(start, com, np.zeros(3), still)

    def strategy(self, way: Way) -> Strategy:
        """How to search along a way."""
        scale = self.robot.scale.length
        return strategy_of(self.config, self._evaluator, way.length, slides=way.slides, paced=self.paced, scale=scale)

    def parts(
        self,
        way: Way,
        strategy: Strategy,
        timings: tuple[Timing, ...],
        tally: Tally,
        exclusions: Sequence[Exclusion] = (),
        *,
        palms: bool = True,
        care: int = 0,
        deadline: float = math.inf,
    ) -> Parts:
        """The parts of the graphs of one search, from which other searches than ANA* can be made.

        Args:
            way: The way to the goal.
            strategy: How to search, and the judge of transitions.
            timings: Timings to choose from.
            tally: Counts the rejections.
            exclusions: Transitions to avoid.
            palms: Whether palms may be used, where `config.palms` allows them at all.
            care: How often the margins of the legs have grown.
            deadline: `time.perf_counter()` after which the judge is not asked any more.
        """
        moves = self.ground.moves(way)
        table, palms = moves.table, palms and self.config.palms and moves.has_palm_surfaces
        limbs = [limb for limb in PALMS if palms and limb in self.robot.arms]
        candidates = CandidateGenerator(moves, limbs, timings, exclusions, tally.rejected)
        scale = self.robot.scale
        reader, reach = StateReader(table, timings, scale), ReachCheck(moves, limbs, timings, care)
        mass = 0.0 if self._finish is None else self.robot.mass
        cost = EdgeCost(strategy.cost, table, timings, self.world.goal, way.distance, way.longest, mass, scale)
        haste = None
        if strategy.haste:
            haste = Haste(table, self.robot.com_height, way.forced, cost.per_metre, scale.length)
        facing = Facing(way.distance, strategy.cost.heading, cost.per_metre, scale.length)
        delay = Delay(Drift(self.robot, table, timings), facing, haste, cost.per_metre)
        judging = Judging(strategy.judge, reader, reach, tally, deadline)
        screen = SequenceScreen(moves, limbs)
        return Parts(table, reader, candidates, judging, strategy.lazy, cost, delay, tally, screen)

    def _reason(self, result: AnaStarResult[bytes], tally: Tally, nearest: str) -> str:
        limit = self.config.search.max_expansions  # the setting, not the multiple of it that was allowed
        expansions = limit if result.stopped_by == "expansions" and limit is not None else result.expansions
        return reason_of(result.stopped_by, result.seconds, expansions, tally, self._evaluator.rejection, nearest)


def _nearest(table: ContactTable, problem: ContactProblem, states: Sequence[bytes]) -> str:
    """Where the feet are in the state with the least cost to go, in words; at the start where there are no states."""
    states = states or [problem.start()]
    nearest = states[int(np.argmin(problem.heuristic(states)))]
    return feet_at(mean_feet(table, unpack([nearest])[:, CONTACTS])[0][0])


def _places(table: ContactTable, states: Sequence[bytes]) -> np.ndarray:
    """(k, 3) x m, y m, yaw rad; mean of the feet of those states that are judged."""
    judged = [state for state in states if not is_pending(state)]
    if not judged:
        return np.zeros((0, 3))
    centre, yaw = mean_feet(table, unpack(judged)[:, CONTACTS])
    return np.column_stack([centre[:, :2], yaw])
