"""One trial of a planner: search, then the centroidal optimiser until a sequence is feasible."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import ToolkitError
from toolkit.pipeline import PipelineConfig, SilentObserver, test_solution
from toolkit.search.ana_star import Progress
from toolkit.search.planner import ContactPlanner
from toolkit.search.result import SearchResult
from toolkit.world.world import World
from validation.cases import Case
from validation.machine import memory
from validation.motion_figures import motion_figures
from validation.options import TrialSettings
from validation.run_trial import make_planner, robot_of


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


def timed_search(planner: ContactPlanner, seed: int, time_limit: float) -> tuple[SearchResult, dict[str, Any]]:
    """Search, with the figures that a table of times needs.

    Raises:
        PlanningError: as `ContactPlanner.search`.
    """
    before = memory()
    clock = SearchClock.start()
    search = planner.search(np.random.default_rng(seed), time_limit, clock)
    share = clock.share()
    after = memory()
    first = search.solutions[0].seconds if search.solutions else None
    first_share = clock.processor_share or share
    return search, {
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


def plan_trial(settings: TrialSettings, case: Case, planner_kind: str, repeat: bool) -> dict[str, Any]:
    """A record of the experiment `validation.planning`.

    Args:
        settings: of the experiment.
        case: world and seed.
        planner_kind: see `toolkit.pipeline.make_planner`.
        repeat: search a second time and compare the plans.
    """
    world = case.world()
    record: dict[str, Any] = {
        "kind": case.kind,
        "seed": case.seed,
        "planner": planner_kind,
        "found": False,
        "feasible": False,
        "passed": False,
    }
    try:
        planner = make_planner(settings, world, planner_kind)
        search, figures = timed_search(planner, case.seed, settings.planning.time_limit)
    except ToolkitError as error:
        return record | {"stage": "planning", "reason": " ".join(str(error).split())}
    record |= figures | {"found": bool(search.solutions), "sequences": len(search.solutions)}
    if repeat:
        again = make_planner(settings, world, planner_kind)
        second = again.search(np.random.default_rng(case.seed), settings.planning.time_limit)
        record["repeatable"] = signature(search) == signature(second)
    if not search.solutions:
        return record | {"stage": "planning", "reason": search.reason}
    return record | tested(settings, case, world, search)


def tested(settings: TrialSettings, case: Case, world: World, search: SearchResult) -> dict[str, Any]:
    """Optimise the sequences of a search, newest first, until one is feasible."""
    config = replace(PipelineConfig(), seed=case.seed, until="dynamics")
    robot, observer, reasons = robot_of(settings.robot, settings.robots), SilentObserver(), []
    for count, solution in enumerate(reversed(search.solutions), 1):
        trial = test_solution(robot, world, solution, config, observer)
        if trial.passed and trial.motion is not None:
            transitions = solution.sequence.transitions
            return {
                "feasible": True,
                "passed": True,
                "stage": "done",
                "reason": "",
                "tested": count,
                "rejected": reasons,
                "objective": trial.motion.objective,
                "optimiser_seconds": trial.motion.seconds,
                "transitions": len(transitions),
                "palm_contacts": sum(not t.limb.is_foot and t.contact is not None for t in transitions),
                "figures": asdict(motion_figures(trial.motion)),
            }
        reasons.append(trial.reason)
    return {
        "tested": len(reasons),
        "rejected": reasons,
        "stage": "dynamics",
        "reason": f"none of {len(reasons)} sequences is dynamically feasible; the cheapest: {reasons[0]}",
    }


def growth_trial(settings: TrialSettings, case: Case) -> dict[str, Any]:
    """A search for its whole time limit, without a limit on expansions: how time and memory grow with the world."""
    world = case.world()
    record = {"kind": case.kind, "seed": case.seed, "found": False, "passed": False, "stage": "planning"}
    record["length"] = float(np.hypot(*(world.goal.position - world.start.position)[:2]))
    limit = settings.planning.time_limit
    try:
        search, figures = timed_search(make_planner(settings, world), case.seed, limit)
    except ToolkitError as error:
        return record | {"reason": " ".join(str(error).split())}
    found = bool(search.solutions)
    late = search.seconds / limit - 1.0
    return record | figures | {"found": found, "passed": found, "overtime": late, "reason": search.reason}


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
