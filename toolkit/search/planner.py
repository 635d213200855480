"""ContactPlanner: from a start to a goal by an anytime search over contact transitions of feet and palms."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from toolkit.contacts.arm_map import ArmMap
from toolkit.contacts.projection import Projected, Projector
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_model import TransitionModel, steps_38, steps_60, wide_steps
from toolkit.errors import InputError, PlanningError
from toolkit.geometry.limb import FEET, Limb
from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig, AnaStarResult
from toolkit.search.anytime.graph import Progress
from toolkit.search.anytime.restart import search_in_turn
from toolkit.search.arrival import Arrival
from toolkit.search.costs.heuristic import Distance, EuclideanDistance
from toolkit.search.costs.terrain_distance import TerrainDistance, resting_surfaces
from toolkit.search.moves.exclusion import Exclusion
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.start_palms import with_palms
from toolkit.search.outcome import reason_of, solution_of
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.problem import ContactProblem
from toolkit.search.result import SearchResult
from toolkit.search.states.contact_table import ContactTable
from toolkit.search.states.start import place_feet
from toolkit.search.states.state import CONTACTS, is_pending, unpack
from toolkit.world.world import PALM_SITES, World

_UNTRAINED = (
    "timing or friction outside what the networks were trained for; the optimiser judged there instead, which is slower"
)
_DEEP = 10  # patience of a search over slippery ground, in multiples of the patience elsewhere
_LAYER, _EPSILON, _CROWDING = 1.5, 0.15, 0.6  # of a search that has to slide: see `AnaStarConfig`
_HASTY_LAYER, _HASTY_EPSILON, _HASTY_CROWDING = 1.0, 0.3, 0.1  # of the one before, to find a first sequence soon
_HASTY_SHARE, _HASTY_EXPANSIONS = 5, 600  # which has a fifth of the other's expansions, or so many
_SLIDING = 3  # times the expansions, of such a search: most of them see that they have come too fast
_LAZY = 20  # expansions with one transition judged in each that count as one with all judged


class ContactPlanner:
    """Plans contact sequences for one robot in one world.

    Args:
        robot: the robot.
        world: the world.
        evaluator: judges the dynamics of transitions. Where it has an attribute `outside`, another evaluator, that one
            has a say on ground that holds no resting foot, where the last bit of feasibility counts.
        config: settings.
        goal_evaluator: judges the transition that reaches the goal, as one after which the robot rests; None: it is
            judged like any other.
    """

    def __init__(
        self,
        robot: RobotModel,
        world: World,
        evaluator: TransitionEvaluator,
        config: PlannerConfig | None = None,
        goal_evaluator: TransitionEvaluator | None = None,
    ):
        self.robot, self.world, self.config = robot, world, config or PlannerConfig()
        self._evaluator, self._goal_evaluator = evaluator, goal_evaluator
        self._projector = self._ground(self.config.rest_friction)
        self._terrain = self._distances(self._projector)
        self._timings = self.config.timings or (world.timing,)
        walls = self.config.palms and bool(self._projector.table.palm.any())
        self._arms = {limb: ArmMap.of(robot, limb) for limb in robot.arms if walls}
        self._warm_up()

    def _warm_up(self) -> None:
        """Compile or load what is compiled."""
        moves, table = self._generator(wide=False)
        ground = self._projector.table
        surface = np.zeros(1, int)
        sole = Projected(surface, ground.origin[surface], ground.rotation[surface])
        moves.warm_up(int(table.add(Limb.RIGHT_FOOT, sole)[0]))

    def start_stance(self) -> Stance:
        """Both feet on the ground below the start, at their distance in the home posture, and palms at their sites.

        Raises:
            PlanningError: they find no room, or the robot cannot stand there.
            InputError: the world asks for a palm that no arm can hold there, or that the settings forbid.
        """
        names = [PALM_SITES[limb] for limb in self.world.start_palms]
        if names and not self.config.palms:
            raise InputError(
                f"{self.world.path}: palms are switched off, but the world asks for palms in contact at the "
                f"start; leave out --no-palms, or remove the site{'s' * (len(names) > 1)} {' and '.join(names)}"
            )
        moves, table = self._generator(wide=False)
        reasons: dict[str, int] = {}
        for stance in place_feet(self.robot, self.world, self._projector):
            left, right = (stance[limb] for limb in FEET)
            code = int(
                moves.screen(
                    Limb.LEFT_FOOT,
                    np.array([left.surface]),
                    left.pose.position[None],
                    left.pose.rotation[None],
                    np.array([left.pose.yaw]),
                    table.add_contact(right),
                )[0]
            )
            if code == 0:
                return with_palms(self.robot, self.world, stance, moves, table)
            reasons[Reason(code).words] = reasons.get(Reason(code).words, 0) + 1
        most = max(reasons, key=lambda reason: reasons[reason])
        raise PlanningError(
            f"{self.world.path}: the robot cannot stand at the start ({most}); move the site 'start' to more even or "
            "more open ground"
        )

    def search(
        self,
        rng: np.random.Generator,
        time_limit: float,
        observer: Callable[[Progress], None] | None = None,
        exclusions: Sequence[Exclusion] = (),
        palms: bool = True,
    ) -> SearchResult:
        """Search for contact sequences until the time is up or nothing can improve.

        Args:
            rng: for random expansions.
            time_limit: s, the heuristic not counted.
            observer: told of progress and of every solution.
            exclusions: transitions that later stages rejected; the search keeps away from them.
            palms: whether this search may use palms, where `config.palms` allows them at all.

        Returns:
            Every solution found, and why there is none where there is none.

        Raises:
            PlanningError: the robot cannot stand at the start, or nothing leads to the goal.
        """
        start = self.start_stance()
        began = time.perf_counter()
        distance, wide, slides = self._way(start)
        heuristic_seconds = time.perf_counter() - began
        moves, table = self._generator(wide)
        com = start.mean_feet.position + np.array([0.0, 0.0, self.robot.com_height])
        evaluator, outside = self._suited(start, com)
        lazy = getattr(evaluator, "costly", False)
        cost = replace(self.config.cost, steep=0.0) if slides else self.config.cost
        problem = ContactProblem(
            self.robot,
            moves,
            table,
            evaluator,
            distance,
            start,
            com,
            self.world.goal,
            self._model(wide).longest_step + self.config.projection.shift,
            self._timings,
            palms and self.config.palms,
            cost,
            self.config.reach,
            exclusions,
            lazy=lazy,
            second=getattr(evaluator, "outside", None) if slides else None,
            haste=self.config.haste if slides and not lazy else None,
            forced=self._terrain.forced_acceleration(),
        )
        judge = None if self._goal_evaluator is None else Arrival(problem, self._goal_evaluator, cost)
        settings = self._settings(slides, lazy)
        if settings.initial_cost == np.inf and (lazy or not slides):
            way = float(distance(start.mean_feet.position[None], np.array([start.mean_feet.yaw]))[0])
            settings = replace(settings, initial_cost=self.config.acceptable_cost * max(way, 1.0))
        problem.deadline = time.perf_counter() + time_limit
        searches = [(problem, settings)]
        if slides and not lazy:
            limit = _HASTY_EXPANSIONS if settings.max_expansions is None else settings.max_expansions // _HASTY_SHARE
            hasty = replace(settings, layer=_HASTY_LAYER, epsilon=_HASTY_EPSILON, crowding=_HASTY_CROWDING)
            searches.insert(0, (problem.left_first(), replace(hasty, max_expansions=limit, first_only=True)))
        result, early = search_in_turn(searches, rng, judge, time_limit, observer)
        judged = [state for state in result.expanded if not is_pending(state)]
        expanded = problem.feet(unpack(judged)[:, CONTACTS]) if judged else (np.zeros((0, 3)), [])
        return SearchResult(
            solutions=tuple(solution_of(problem, path) for path in result.paths),
            hasty=early if early < len(result.paths) else 0,
            seconds=result.seconds,
            heuristic_seconds=heuristic_seconds,
            expansions=result.expansions,
            exhausted=result.stopped_by == "exhausted",
            expanded=np.column_stack([expanded[0][:, :2], expanded[1]]),
            reason="" if result.paths else self._reason(result, problem),
            warning=_UNTRAINED if getattr(self._evaluator, "outside_count", 0) > outside else "",
        )

    def _suited(self, start: Stance, com: np.ndarray) -> tuple[TransitionEvaluator, int]:
        """The evaluator for the timings, and how many transitions it had found untrained before it was asked for them.

        Where none of the timings is one that it was trained for, its stand-in judges from the outset. What an evaluator
        compiles or loads at its first query is no part of the search: so it is asked here.
        """
        evaluator = self._evaluator
        before = getattr(evaluator, "outside_count", 0)
        still = [ContactTransition(Limb.LEFT_FOOT, start[Limb.LEFT_FOOT], timing) for timing in self._timings]
        evaluator.evaluate(start, com, np.zeros(3), still)
        stand_in = getattr(evaluator, "outside", None)
        for other in (stand_in, self._goal_evaluator):
            if other is not None:
                other.evaluate(start, com, np.zeros(3), still[:1])
        if stand_in is not None and getattr(evaluator, "outside_count", 0) - before == len(still):
            evaluator = stand_in
        return evaluator, before

    def _reason(self, result: AnaStarResult[bytes], problem: ContactProblem) -> str:
        dynamics = getattr(self._evaluator, "rejection", Reason.DYNAMICS.words)
        limit = self.config.search.max_expansions  # as it was asked for, whatever the search made of it
        expansions = limit if result.stopped_by == "expansions" and limit is not None else result.expansions
        return reason_of(result.stopped_by, result.seconds, expansions, problem.rejected, dynamics)

    def _model(self, wide: bool) -> TransitionModel:
        steps = steps_60() if self.config.steps == 60 else steps_38()
        return TransitionModel.of(self.robot, np.concatenate([steps, wide_steps()]) if wide else steps)

    def _generator(self, wide: bool) -> tuple[MoveGenerator, ContactTable]:
        table = ContactTable(self._projector.table.friction)
        terrain = self._terrain
        moves = MoveGenerator(
            self.robot,
            self._projector,
            table,
            self._model(wide),
            terrain.occupancy,
            terrain.box,
            self.config.moves,
            self._arms,
        )
        return moves, table

    def _settings(self, slides: bool, lazy: bool) -> AnaStarConfig:
        """Settings of a search that has to cross ground on which no foot rests, or not."""
        settings, limit = self.config.search, self.config.search.max_expansions
        if lazy and limit is not None:
            settings = replace(settings, max_expansions=limit * _LAZY)
        if slides:  # what crosses such ground is rare and lies deep: less width than a way out of a cul-de-sac needs
            settings = replace(settings, patience=settings.patience * _DEEP)
        if slides and not lazy:  # whoever gets that far has paid for it: the cost so far only leads back
            limit = None if limit is None else limit * _SLIDING
            settings = replace(settings, max_expansions=limit, layer=_LAYER, epsilon=_EPSILON, crowding=_CROWDING)
        return settings

    def _ground(self, friction: float | None) -> Projector:
        """Projector onto the ground that holds a resting foot with this part of its friction; None: onto all of it."""
        surfaces = resting_surfaces(self.world.surfaces, friction)
        return Projector(self.robot, surfaces, self.world.mujoco_model, self.config.projection)

    def _distances(self, projector: Projector) -> TerrainDistance:
        return TerrainDistance(self.robot, self.world, projector, self.config.grid)

    def _way(self, start: Stance) -> tuple[Distance, bool, bool]:
        """Distance to the goal, whether wide steps are to be used, and whether no way leads over resting ground alone.

        Raises:
            PlanningError: nothing leads to the goal.
        """
        wide, feet = self.config.wide_steps, start.mean_feet
        strides = {False: self._model(False).longest_step, True: self._model(True).longest_step}
        choices = {"on": [True], "off": [False], "auto": [False, True]}[wide]
        slides = False
        if self._terrain.forced_acceleration() > 0.0:
            projector = self._ground(1.0)
            resting = self._distances(projector) if projector.table.foot.any() else None
            rests = [c for c in choices if resting is not None and resting.distance(feet, strides[c]) is not None]
            slides, choices = not rests, rests or choices[-1:]
        if self.config.heuristic == "euclidean":
            return EuclideanDistance(self.world.goal), wide != "off", slides
        for choice in choices:
            distance = self._terrain.distance(feet, strides[choice])
            if distance is not None:
                return distance, choice, slides
        if self.config.rest_friction is not None:
            terrain = self._distances(self._ground(None))
            if terrain.distance(feet, strides[choices[-1]]) is not None:
                raise PlanningError(terrain.too_steep(self.config.rest_friction))
        raise PlanningError(self._terrain.obstacle(feet, strides[choices[-1]]))
