"""ContactPlanner: from a start to a goal by an anytime search over contact transitions of feet and palms."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from toolkit.contacts.arm_map import ArmMap
from toolkit.contacts.projection import Projected, ProjectionConfig, Projector
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_model import TransitionModel, steps_38, steps_60, wide_steps
from toolkit.errors import InputError, PlanningError
from toolkit.geometry.limb import FEET, Limb
from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search import screen
from toolkit.search.ana_star import AnaStar, AnaStarConfig, AnaStarResult
from toolkit.search.arrival import Arrival
from toolkit.search.contact_table import ContactTable
from toolkit.search.exclusion import Exclusion
from toolkit.search.graph import Path, Progress
from toolkit.search.heuristic import Distance, EuclideanDistance, GridConfig
from toolkit.search.moves import MoveConfig, MoveGenerator
from toolkit.search.problem import ContactProblem, CostConfig
from toolkit.search.reach_check import ReachConfig
from toolkit.search.result import SearchResult, Solution
from toolkit.search.start import place_feet
from toolkit.search.state import COM, CONTACTS, VELOCITY, is_pending, unpack
from toolkit.search.terrain_distance import TerrainDistance, resting_surfaces
from toolkit.world.timing import Timing
from toolkit.world.world import World

_UNTRAINED = (
    "timing or friction outside what the networks were trained for; the optimiser judged there instead, which is slower"
)
_DEEP = 10  # patience of a search over slippery ground, in multiples of the patience elsewhere
_LAZY = 20  # expansions with one transition judged in each that count as one with all judged


@dataclass(frozen=True)
class PlannerConfig:
    """Settings of the planner.

    Attributes:
        steps: 60 or 38; rows of the foot transition model.
        wide_steps: "on", "off", or "auto": where normal steps do not lead to the goal, or where some ground holds no
            resting foot and has to be crossed fast.
        palms: whether palms may be used.
        heuristic: "grid" or "euclidean".
        timings: of a transition, to choose from; empty: the world's.
        rest_friction: ground steeper than this part of its friction angle's tangent holds no foot at all; None: the
            evaluator decides.
        cost: edge costs.
        reach: what legs and arms may reach.
        moves: kinematic limits.
        projection: how patches find their place.
        grid: of the heuristic.
        acceptable_cost: per m of way; order of magnitude of the first solution's cost, where `search.initial_cost`
            leaves it open: the lower, the more the cost so far counts before there is a solution; inf: the search goes
            straight for the goal.
        search: of ANA*. Time decides when a search stops, so the same seed gives the same plan only as long as the
            machine gets through the same expansions; `search.max_expansions` makes it exact.
    """

    steps: int = 60
    wide_steps: str = "auto"
    palms: bool = True
    heuristic: str = "grid"
    timings: tuple[Timing, ...] = ()
    rest_friction: float | None = None
    cost: CostConfig = field(default_factory=CostConfig)
    reach: ReachConfig = field(default_factory=ReachConfig)
    moves: MoveConfig = field(default_factory=MoveConfig)
    projection: ProjectionConfig = field(default_factory=ProjectionConfig)
    grid: GridConfig = field(default_factory=GridConfig)
    acceptable_cost: float = 2500.0
    search: AnaStarConfig = field(default_factory=lambda: AnaStarConfig(max_expansions=20_000))

    def __post_init__(self):
        for name, allowed in (("steps", (60, 38)), ("wide_steps", ("auto", "on", "off"))):
            if getattr(self, name) not in allowed:
                raise InputError(f"planner setting {name} is {getattr(self, name)!r}; it must be one of {allowed}")
        if self.heuristic not in ("grid", "euclidean"):
            raise InputError(f"planner setting heuristic is {self.heuristic!r}; it must be 'grid' or 'euclidean'")


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
        projection, grid = self.config.projection, self.config.grid
        self._projector = Projector(
            robot, resting_surfaces(world.surfaces, self.config.rest_friction), world.mujoco_model, projection
        )
        self._terrain = TerrainDistance(robot, world, self._projector, grid)
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
        """Both feet on the ground below the start, at their distance in the home posture.

        Raises:
            PlanningError: they find no room, or the robot cannot stand there.
        """
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
                return stance
            reasons[screen.REASONS[code]] = reasons.get(screen.REASONS[code], 0) + 1
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
        distance, wide = self._distance(start)
        heuristic_seconds = time.perf_counter() - began
        moves, table = self._generator(wide)
        com = start.mean_feet.position + np.array([0.0, 0.0, self.robot.com_height])
        evaluator, outside = self._suited(start, com)
        lazy, slippery = getattr(evaluator, "costly", False), self._terrain.has_slippery_ground()
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
            self.config.cost,
            self.config.reach,
            exclusions,
            lazy=lazy,
            second=getattr(evaluator, "outside", None) if slippery else None,
        )
        judge = None if self._goal_evaluator is None else Arrival(problem, self._goal_evaluator, self.config.cost)
        settings = self.config.search
        if lazy and settings.max_expansions is not None:
            settings = replace(settings, max_expansions=settings.max_expansions * _LAZY)
        if slippery:  # what crosses it is rare and lies deep: less width than a way out of a cul-de-sac needs
            settings = replace(settings, patience=settings.patience * _DEEP)
        if settings.initial_cost == np.inf:
            way = float(distance(start.mean_feet.position[None], np.array([start.mean_feet.yaw]))[0])
            settings = replace(settings, initial_cost=self.config.acceptable_cost * max(way, 1.0))
        problem.deadline = time.perf_counter() + time_limit
        result = AnaStar(problem, rng, settings, judge).run(time_limit, observer)
        judged = [state for state in result.expanded if not is_pending(state)]
        expanded = problem.feet(unpack(judged)[:, CONTACTS]) if judged else (np.zeros((0, 3)), [])
        return SearchResult(
            solutions=tuple(_solution(problem, path) for path in result.paths),
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
        dynamics = getattr(self._evaluator, "rejection", screen.REASONS[screen.DYNAMICS])
        return _reason(result.stopped_by, result.seconds, result.expansions, problem.rejected, dynamics)

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

    def _distance(self, start: Stance) -> tuple[Distance, bool]:
        """Distance to the goal, and whether wide steps are to be used.

        Raises:
            PlanningError: nothing leads to the goal.
        """
        wide = self.config.wide_steps
        strides = {False: self._model(False).longest_step, True: self._model(True).longest_step}
        if self.config.heuristic == "euclidean":
            return EuclideanDistance(self.world.goal), wide != "off"
        choices = {"on": [True], "off": [False], "auto": [False, True]}[wide]
        if wide == "auto" and self._terrain.has_slippery_ground():
            choices = [True]
        for choice in choices:
            distance = self._terrain.distance(start.mean_feet, strides[choice])
            if distance is not None:
                return distance, choice
        if self.config.rest_friction is not None:
            every = Projector(self.robot, self.world.surfaces, self.world.mujoco_model, self.config.projection)
            terrain = TerrainDistance(self.robot, self.world, every, self.config.grid)
            if terrain.distance(start.mean_feet, strides[choices[-1]]) is not None:
                raise PlanningError(terrain.too_steep(self.config.rest_friction))
        raise PlanningError(self._terrain.obstacle(start.mean_feet, strides[choices[-1]]))


def _solution(problem: ContactProblem, path: Path[bytes]) -> Solution:
    """A path as a contact sequence with its predicted motion."""
    states = [state for state in path.states if not is_pending(state)]
    payloads = [payload for payload in path.payloads if payload is not None]
    rows = unpack(states)
    steps = list(zip(states[1:], payloads, strict=True))
    return Solution(
        sequence=ContactSequence(
            problem.stance(states[0]), tuple(problem.transition(state, payload) for state, payload in steps)
        ),
        cost=path.cost,
        bound=path.bound,
        seconds=path.seconds,
        com=rows[:, COM] / 1000.0,
        com_velocity=rows[:, VELOCITY] / 1000.0,
        objective=np.array([payload[0] for payload in payloads]),
    )


def _reason(stopped_by: str, seconds: float, expansions: int, rejected: np.ndarray, dynamics: str) -> str:
    """One line on why there is no solution and what rejected most candidates, the choice of palms apart."""
    how = {
        "exhausted": f"every stance that can be reached was looked at ({expansions})",
        "time": f"the time limit of {seconds:.3g} s was reached after {expansions} expansions; a longer one may help",
        "expansions": f"the limit of {expansions} expansions was reached; a higher one may help",
        "memory": f"the limit on memory was reached after {expansions} expansions",
    }[stopped_by]
    rejected = np.where(np.isin(np.arange(len(screen.REASONS)), screen.PALM_REASONS), 0, rejected)
    total = int(rejected.sum())
    if total == 0:
        return f"no contact sequence found: {how}"
    order = np.argsort(-rejected, kind="stable")[:4]
    shares = ", ".join(
        f"{dynamics if code == screen.DYNAMICS else screen.REASONS[code]} {100 * rejected[code] / total:.0f} %"
        for code in order
        if rejected[code] > 0
    )
    return f"no contact sequence found: {how}; candidates were rejected for: {shares}"
