"""From a world to a verdict: the only module that knows all stages.

    world -> surfaces -> contact sequence -> centroidal motion -> whole-body trajectory -> execution -> verdict

The search proposes contact sequences; each is tested from the newest (cheapest) to the oldest by the centroidal
optimiser, by inverse kinematics and by the simulation, and the first that passes everything is the plan. Where all
fail, the search starts again without the transitions at which they failed.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.sequence import SequenceConfig, optimise
from toolkit.contacts.room import RoomConfig, landing_room, moved_sequence
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.execution.check import Check, Result
from toolkit.execution.result import Execution
from toolkit.execution.run import ExecutionConfig, execute
from toolkit.execution.verdict import failure_reason
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.prediction.networks import NetworkEvaluator, load_networks
from toolkit.robot.model import RobotModel
from toolkit.search.moves.exclusion import Exclusion, excluded
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.search.result import SearchResult, Solution
from toolkit.wholebody.plan import WholeBodyConfig, whole_body
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.world import World

FRICTION_ROUNDING = 0.01  # of a friction factor: no reason to prefer one motion to another
PLANNERS = ("auto", "learned", "optimiser", "kinematic", "quasi-static")


def make_planner(robot: RobotModel, world: World, kind: str, config: PlannerConfig) -> ContactPlanner:
    """The contact planner whose transitions are judged by `kind`.

    Args:
        robot: the robot.
        world: the world.
        kind: one of `PLANNERS`; "auto" takes the networks where the robot has them, else leaves the dynamics out.
        config: settings.

    Raises:
        NetworkError: "learned" was asked for and the networks are missing or do not fit.
    """
    if kind == "quasi-static":
        from toolkit.search.quasi_static import quasi_static_planner

        return quasi_static_planner(robot, world, config)
    if kind == "auto":
        kind = "learned" if (robot.folder / "networks").is_dir() else "kinematic"
    if kind == "kinematic":
        return ContactPlanner(robot, world, KinematicEvaluator(robot), config)
    # Imported here: the fast solver takes seconds to compile where its cache is cold, and only these kinds need it.
    from toolkit.prediction.optimiser import OptimiserEvaluator

    optimiser = OptimiserEvaluator(robot)
    at_rest = OptimiserEvaluator(robot, final_at_rest=True)
    if kind == "learned":
        return ContactPlanner(robot, world, NetworkEvaluator(load_networks(robot), optimiser), config, at_rest)
    return ContactPlanner(robot, world, optimiser, config, at_rest)


class Observer(Protocol):
    """Is told how a run goes, for display; never decides anything."""

    def started(self, stage: str, detail: str = "") -> None:
        """A stage begins."""
        ...

    def progress(self, stage: str, fraction: float | None, detail: str = "") -> None:
        """A stage goes on; `fraction` in [0, 1] where known."""
        ...

    def finished(self, stage: str, passed: bool, seconds: float, detail: str = "") -> None:
        """A stage ended."""
        ...


class SilentObserver:
    """Watches without a word."""

    def started(self, stage: str, detail: str = "") -> None:
        """Ignore."""

    def progress(self, stage: str, fraction: float | None, detail: str = "") -> None:
        """Ignore."""

    def finished(self, stage: str, passed: bool, seconds: float, detail: str = "") -> None:
        """Ignore."""


@dataclass(frozen=True)
class PipelineConfig:
    """Settings of one run.

    Attributes:
        seed: of every random draw.
        time_limit: s for the contact search; the search also ends after its own number of expansions, so that the
            same seed gives the same plan on any machine fast enough.
        candidates: most contact sequences to test before giving up; those with palms at most half of them, after which
            the search is run for the feet alone.
        until: last stage that tests a sequence: "dynamics" for the plan alone, "wholebody", or "execution".
        initial_rest, final_rest: s at rest before the first transition and after the last one.
        landing: how far feet may land from where the search put them, where margins are short; None for not at all.
        sequence, wholebody, execution: settings of the stages.
    """

    seed: int = 0
    time_limit: float = 30.0
    candidates: int = 16
    until: str = "execution"
    initial_rest: float = 0.4
    final_rest: float = 1.0
    landing: RoomConfig | None = field(default_factory=RoomConfig)
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    wholebody: WholeBodyConfig = field(default_factory=WholeBodyConfig)
    execution: ExecutionConfig = field(default_factory=ExecutionConfig)


@dataclass(frozen=True)
class Trial:
    """One contact sequence and how far it came; later stages are None where an earlier one rejected it.

    Attributes:
        solution: the contact sequence.
        schedule: when its contacts hold.
        passed: whether every stage that was asked for passed; of the execution, every check.
        motion, trajectory, execution: results of the stages.
        reason: one line where it did not pass, else "".
        failure_time: s; when it failed, None where unknown or where it passed.
    """

    solution: Solution
    schedule: ContactSchedule
    passed: bool = False
    motion: CentroidalMotion | None = None
    trajectory: WholeBodyTrajectory | None = None
    execution: Execution | None = None
    reason: str = ""
    failure_time: float | None = None

    @property
    def failed_transition(self) -> int | None:
        """Index of the transition in which it failed; None where unknown or where it passed."""
        return None if self.failure_time is None else self.schedule.phase_at(self.failure_time).transition

    @property
    def merit(self) -> tuple[int, bool, int]:
        """How far it came, to keep the most telling failure: stages, then arrival, then checks passed."""
        stages = sum(stage is not None for stage in (self.motion, self.trajectory, self.execution)) + self.passed
        if self.execution is None:
            return stages, False, 0
        return stages, self.execution.goal_reached, sum(c.result == Result.PASS for c in self.execution.checks)


@dataclass(frozen=True)
class PipelineResult:
    """Everything a run made.

    Attributes:
        robot, world: what it ran on.
        search: result of the contact search.
        trial: the one that passed, or else the one that came furthest; None without a plan.
        tested: contact sequences tested.
        reason: one line where the verdict is FAIL, else "".
    """

    robot: RobotModel
    world: World
    search: SearchResult
    trial: Trial | None
    tested: int
    reason: str

    @property
    def passed(self) -> bool:
        """The verdict."""
        return self.trial is not None and self.trial.passed

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks of the verdict; empty where nothing was executed."""
        return self.trial.execution.checks if self.trial is not None and self.trial.execution is not None else ()


def test_solution(
    robot: RobotModel, world: World, solution: Solution, config: PipelineConfig, observer: Observer
) -> Trial:
    """Put one contact sequence through optimiser, inverse kinematics and simulation; stop at the first that fails."""
    observer.started("dynamics")
    solution, schedule, motion = _optimised(robot, world, solution, config)
    observer.finished("dynamics", motion.feasible, motion.seconds, motion.status)
    if not motion.feasible:
        reason = f"no feasible centroidal motion: {motion.status}"
        return Trial(solution, schedule, False, motion, reason=reason, failure_time=motion.failure_time)
    if config.until == "dynamics":
        return Trial(solution, schedule, True, motion)

    observer.started("wholebody")
    trajectory = whole_body(robot, world, schedule, motion, config.wholebody)
    observer.finished("wholebody", trajectory.feasible, trajectory.seconds, trajectory.reason)
    if not trajectory.feasible:
        reason = f"no whole-body motion: {trajectory.reason}"
        return Trial(solution, schedule, False, motion, trajectory, None, reason, trajectory.failure_time)
    if config.until == "wholebody":
        return Trial(solution, schedule, True, motion, trajectory)

    observer.started("execution")
    began = time.perf_counter()
    execution = execute(
        robot,
        world,
        solution.sequence,
        schedule,
        motion,
        trajectory,
        config=config.execution,
        rng=np.random.default_rng([config.seed, 1]),
        observer=lambda fraction, detail="": observer.progress("execution", fraction, detail),
    )
    reason = failure_reason(execution.checks, execution.fall_reason)
    when = execution.failure_time if reason else None
    trial = Trial(solution, schedule, not reason, motion, trajectory, execution, reason, when)
    observer.finished("execution", trial.passed, time.perf_counter() - began, trial.reason)
    return trial


def _optimised(
    robot: RobotModel, world: World, solution: Solution, config: PipelineConfig
) -> tuple[Solution, ContactSchedule, CentroidalMotion]:
    """The centroidal motion of a contact sequence, with the sequence and the schedule that it belongs to.

    Where the planned contacts do not allow the wanted margins, feet may land elsewhere on their surfaces; the sequence
    then has its contacts where they landed.
    """
    sequence = solution.sequence
    schedule = ContactSchedule.of(sequence, initial_rest=config.initial_rest, final_rest=config.final_rest)
    com, rest = initial_com(robot, sequence.start), np.zeros(3)
    motion = optimise(robot, schedule, com, rest, config=config.sequence)
    wanted = motion.problem.margins == config.sequence.problem.margins
    if config.landing is None or (motion.feasible and wanted):
        return solution, schedule, motion
    room = landing_room(robot, world.surfaces, sequence, config.landing, world.goal)
    if not room.any():
        return solution, schedule, motion
    moved = optimise(robot, schedule, com, rest, config=config.sequence, room=room)
    tighter = moved.problem.margins.friction < motion.problem.margins.friction + FRICTION_ROUNDING
    if not moved.feasible or (motion.feasible and not tighter):
        return solution, schedule, motion
    sequence = moved_sequence(sequence, schedule, moved.problem.times, moved.problem.position)
    schedule = ContactSchedule.of(sequence, initial_rest=config.initial_rest, final_rest=config.final_rest)
    return replace(solution, sequence=sequence), schedule, moved


def run(
    robot: RobotModel,
    world: World,
    planner: ContactPlanner,
    config: PipelineConfig,
    observer: Observer | None = None,
) -> PipelineResult:
    """Plan, test and execute.

    Args:
        robot: the robot.
        world: the world.
        planner: contact planner for both.
        config: settings.
        observer: told of every stage.

    Returns:
        The result, PASS or not; see `PipelineResult`.

    Raises:
        ToolkitError: the input cannot be used at all (no start stance, nothing leads to the goal).
    """
    observer = observer or SilentObserver()
    search = _search(planner, config, observer, 0, [])
    best: Trial | None = None
    chosen = search
    exclusions: list[Exclusion] = []
    tested = attempt = 0
    palms = True
    while search.solutions:
        before, failed_with_palms = tested, False
        for solution in reversed(search.solutions[search.hasty :]):  # newest, cheapest first
            if tested == config.candidates or _meets(solution, exclusions):
                continue
            with_palms = _uses_palms(solution.sequence)
            if with_palms and tested >= max(1, config.candidates // 2):
                continue  # the other half is for the feet alone
            tested += 1
            failed_with_palms |= with_palms
            trial = test_solution(robot, world, solution, config, observer)
            if best is None or trial.merit > best.merit:
                best, chosen = trial, search
            if trial.passed:
                return PipelineResult(robot, world, chosen, best, tested, "")
            exclusions += _blamed(solution.sequence, trial.failed_transition)
        if tested in (before, config.candidates) or not (exclusions or failed_with_palms):
            break
        attempt += 1
        palms = palms and not failed_with_palms
        search = _search(planner, config, observer, attempt, exclusions, palms)
    return PipelineResult(robot, world, chosen, best, tested, best.reason if best else search.reason)


def _uses_palms(sequence: ContactSequence) -> bool:
    """Whether palms are in contact after those of the start could have been let go."""
    return any(stance.palms for stance in sequence.stances[len(sequence.start.palms) :])


def _search(
    planner: ContactPlanner,
    config: PipelineConfig,
    observer: Observer,
    attempt: int,
    exclusions: list[Exclusion],
    palms: bool = True,
) -> SearchResult:
    """One contact search; the first attempt uses the seed itself."""
    observer.started("planning")
    search = planner.search(
        np.random.default_rng([config.seed, attempt]),
        config.time_limit,
        observer=lambda progress: observer.progress("planning", None, str(progress)),
        exclusions=exclusions,
        palms=palms,
    )
    found = len(search.solutions)
    detail = search.reason or f"{found} sequence{'s' if found > 1 else ''}"
    if exclusions:
        detail += f" without {len(exclusions)} transition{'s' if len(exclusions) > 1 else ''} that failed"
    if not palms:
        detail += " for the feet alone"
    if search.warning:
        detail += f"; warning: {search.warning}"
    observer.finished("planning", found > 0, search.seconds, detail)
    return search


def _blamed(sequence: ContactSequence, index: int | None) -> list[Exclusion]:
    """The transition at which a trial failed, to keep the next search away from it; empty where none can be blamed.

    Args:
        sequence: as the search proposed it: landing points that the optimiser moved are none of the search's.
        index: of the transition.
    """
    if index is None or not sequence.transitions:
        return []
    index = min(index, len(sequence.transitions) - 1)
    return [Exclusion.of(sequence.stances[index], sequence.transitions[index])]


def _meets(solution: Solution, exclusions: list[Exclusion]) -> bool:
    """Whether a solution contains an excluded transition."""
    sequence = solution.sequence
    for stance, transition in zip(sequence.stances, sequence.transitions, strict=False):
        own = Exclusion.of(stance, transition)
        if excluded(exclusions, own.before, np.array([own.limb]), own.target[None])[0]:
            return True
    return False
