"""One trial of a planner: search, then the centroidal optimiser until a sequence is feasible."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.centroidal.problem import Weights
from toolkit.centroidal.residual import objective
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import ToolkitError
from toolkit.pipeline import PipelineConfig, run
from toolkit.pipeline import make_planner as make_pipeline_planner
from toolkit.search.anytime.ana_star import Progress
from toolkit.search.moves.exclusion import Exclusion
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.search.result import SearchResult
from validation.cases import Case
from validation.jobs import reason_of
from validation.machine import memory
from validation.motion_figures import motion_figures
from validation.options import TrialSettings
from validation.run_trial import StageLog, make_planner, robot_of


@dataclass
class SearchClock:
    """Watches a search: when the first sequence came, in wall-clock and in processor time, and with what memory.

    Attributes:
        wall, processor: s; at the start of the search.
        first_seconds: s; wall-clock of the search alone until the first sequence; None before there is one.
        first_expansions: states expanded until then.
        processor_share: of the wall-clock until then that this process had a processor; below 1 on a loaded machine.
        first_memory: MB that the process holds then.
        peak_memory: MB; most that it held whenever the search reported.
    """

    wall: float
    processor: float
    first_seconds: float | None = None
    first_expansions: int | None = None
    processor_share: float | None = None
    first_memory: float | None = None
    peak_memory: float = 0.0

    @classmethod
    def start(cls) -> SearchClock:
        """A clock that starts now."""
        return cls(time.perf_counter(), time.process_time())

    def __call__(self, progress: Progress) -> None:
        """The search's observer."""
        held = memory()
        self.peak_memory = max(self.peak_memory, held)
        if self.first_seconds is None and np.isfinite(progress.cost):
            self.first_seconds, self.first_expansions = progress.seconds, progress.expansions
            self.processor_share = self.share()
            self.first_memory = held

    def share(self) -> float:
        """Processor time over wall-clock since the start."""
        elapsed = time.perf_counter() - self.wall
        return min((time.process_time() - self.processor) / max(elapsed, 1e-9), 1.0)


@dataclass(frozen=True)
class WarmUp:
    """What a process has to be ready for: robot (name and folder) and kind of planner."""

    robot: str
    robots: Path
    planner: str


class TimedPlanner:
    """A planner that times its first search; to the pipeline it is a planner like any other.

    Args:
        planner: the planner.

    Attributes:
        search_result: of the first search; None before it.
        figures: of the first search.
        first_share: of the wall-clock until the first sequence that this process had a processor.
    """

    def __init__(self, planner: ContactPlanner):
        self._planner, self.first_share = planner, 1.0
        self.search_result: SearchResult | None = None
        self.figures: dict[str, Any] = {}

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
        """See `ContactPlanner.search`."""
        if self.search_result is not None:
            return self._planner.search(rng, time_limit, observer, exclusions, palms, calmer, care)
        before = memory()
        clock = SearchClock.start()
        search = self._planner.search(rng, time_limit, clock, exclusions, palms, calmer, care)
        share, after = clock.share(), memory()
        first = search.solutions[0].seconds if search.solutions else None
        first_share = self.first_share = clock.processor_share or share
        self.search_result = search
        self.figures = {
            "first_seconds": first,
            "first_processor_seconds": None if first is None else first * first_share,
            "first_expansions": clock.first_expansions,
            "heuristic_seconds": search.heuristic_seconds,
            "heuristic_processor_seconds": search.heuristic_seconds * first_share,
            "search_seconds": search.seconds,
            "expansions": search.expansions,
            "expansions_per_second": search.expansions / max(search.seconds, 1e-9),
            "processor_share": share,
            "memory_before": before,
            "first_memory": clock.first_memory,
            "first_memory_gain": None if clock.first_memory is None else clock.first_memory - before,
            "peak_memory": max(clock.peak_memory, after),
        }
        return search


@lru_cache(maxsize=4)
def warm_up(settings: WarmUp) -> None:
    """Compile and load in this process what a search needs, so that no trial's time contains it."""
    world = Case("rubble_field", 0).world()
    robot = robot_of(settings.robot, settings.robots)
    planner = make_pipeline_planner(robot, world, settings.planner, PlannerConfig())
    planner.search(np.random.default_rng(0), 0.2)


def plan_trial(settings: TrialSettings, case: Case, planner_kind: str, repeat: bool) -> dict[str, Any]:
    """A record of the experiment `validation.planning`.

    Args:
        settings: of the experiment.
        case: world and seed.
        planner_kind: see `toolkit.pipeline.make_planner`.
        repeat: search a second time and compare the plans.
    """
    world, log = case.world(), StageLog()
    record: dict[str, Any] = {
        "kind": case.kind,
        "seed": case.seed,
        "planner": planner_kind,
        "found": False,
        "feasible": False,
        "passed": False,
        "stage": "planning",
    }
    limit = settings.planning.time_limit
    config = replace(PipelineConfig(), seed=case.seed, time_limit=limit, until="dynamics")
    warm_up(WarmUp(settings.robot, settings.robots, planner_kind))
    try:
        planner = TimedPlanner(make_planner(settings, world, planner_kind))
        result = run(robot_of(settings.robot, settings.robots), world, planner, config, log)
    except ToolkitError as error:
        return record | {"reason": reason_of(error)}
    first, trial = planner.search_result, result.trial
    assert first is not None
    feasible, count = result.first_feasible, sum(candidate.feasible for candidate in result.candidates)
    record |= planner.figures | {
        "found": bool(first.solutions),
        "sequences": len(first.solutions),
        "optimised": len(result.candidates),
        "tested": None if count == 0 else len(result.candidates) / count,
        "searched_first_seconds": planner.figures["first_seconds"],
        "first_seconds": None if feasible is None else feasible.seconds,
        "first_processor_seconds": None if feasible is None else feasible.seconds * planner.first_share,
        "first_optimiser_seconds": None if feasible is None else feasible.plan.motion.seconds,
        "stages": log.entries,
        "feasible": result.passed,
        "passed": result.passed,
        "reason": result.reason,
    }
    if repeat:
        again = make_planner(settings, world, planner_kind)
        second = again.search(np.random.default_rng([case.seed, 0]), limit)
        record["repeatable"] = signature(first) == signature(second)
    if trial is None:
        return record
    if not result.passed:
        return record | {"stage": "dynamics"}
    transitions, motion = trial.plan.sequence.transitions, trial.plan.motion
    return record | {
        "stage": "done",
        "true_cost": trial.candidate.cost.total,
        "cost_terms": trial.candidate.cost.terms,
        "walking_seconds": trial.plan.sequence.duration,
        "objective": motion.objective,
        "paper_objective": objective(motion, Weights()),
        "optimiser_seconds": motion.seconds,
        "transitions": len(transitions),
        "palm_contacts": sum(not t.limb.is_foot and t.contact is not None for t in transitions),
        "figures": asdict(motion_figures(motion)),
    }


def growth_trial(settings: TrialSettings, case: Case, length: float, whole: bool) -> dict[str, Any]:
    """A search without a limit on expansions: how time and memory grow with the world.

    Args:
        settings: of the planner.
        case: the world.
        length: m; of its rubble.
        whole: search for the whole time limit, not only until the first sequence.
    """
    world = case.world()
    record = {"kind": case.kind, "seed": case.seed, "found": False, "passed": False, "stage": "planning"}
    record["length"] = length
    record["way"] = float(np.hypot(*(world.goal.position - world.start.position)[:2]))
    limit = settings.planning.time_limit
    warm_up(WarmUp(settings.robot, settings.robots, settings.planner))
    try:
        planner = TimedPlanner(make_planner(settings, world, first_only=not whole))
        search = planner.search(np.random.default_rng(case.seed), limit)
    except ToolkitError as error:
        return record | {"reason": reason_of(error)}
    found = bool(search.solutions)
    late = search.seconds / limit - 1.0 if whole else None
    return record | planner.figures | {"found": found, "passed": found, "overtime": late, "reason": search.reason}


def signature(search: SearchResult) -> list[tuple]:
    """Every sequence of a search as something that compares exactly."""
    return [_steps(solution.sequence) for solution in search.solutions]


def _steps(sequence: ContactSequence) -> tuple:
    """Limbs and places of a sequence, bit by bit."""
    return tuple(
        (
            int(transition.limb),
            b""
            if transition.contact is None
            else transition.contact.pose.position.tobytes() + transition.contact.pose.rotation.tobytes(),
        )
        for transition in sequence.transitions
    )
