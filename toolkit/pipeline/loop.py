"""The loop of a run: search, test what was found, and search again without what failed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.contacts.sequence import ContactSequence
from toolkit.execution.check import Check
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.planner import Planner
from toolkit.pipeline.trial import Tester, Trial
from toolkit.robot.model import RobotModel
from toolkit.search.moves.exclusion import Exclusion, excluded
from toolkit.search.result import SearchResult, Solution
from toolkit.world.world import World


@dataclass(frozen=True)
class PipelineResult:
    """The result of a run.

    Attributes:
        robot, world, config: As given to `run`.
        search: Result of the contact search that found the trial's sequence, or of the last search without a trial.
        trial: The trial that passed, or else the one that came furthest; None without a plan.
        tested: Number of contact sequences tested.
        reason: One line where the verdict is FAIL, else "".
    """

    robot: RobotModel
    world: World
    config: PipelineConfig
    search: SearchResult
    trial: Trial | None
    tested: int
    reason: str

    @property
    def passed(self) -> bool:
        """Whether the verdict is PASS."""
        return self.trial is not None and self.trial.passed

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks of the verdict; empty where nothing was executed."""
        return self.trial.execution.checks if self.trial is not None and self.trial.execution is not None else ()


def run(
    robot: RobotModel,
    world: World,
    planner: Planner,
    config: PipelineConfig,
    observer: Observer | None = None,
) -> PipelineResult:
    """Plan, test and execute.

    The planner is made for the same robot and world; the observer is told of every stage. The same seed gives the same
    result if the libraries of matrix products keep to one thread, as in the commands; set `OPENBLAS_NUM_THREADS=1` and
    `MKL_NUM_THREADS=1` before NumPy is imported.

    Raises:
        ToolkitError: The input cannot be used at all (no start stance, nothing leads to the goal).
    """
    observer = observer or Observer()
    tester = Tester(robot, world, config, observer)
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
            trial = tester.test(solution)
            if best is None or trial.merit > best.merit:
                best, chosen = trial, search
            if trial.failure is None:
                return PipelineResult(robot, world, config, chosen, best, tested, "")
            exclusions += _blamed(solution.sequence, trial.failure)
        if tested in (before, config.candidates) or not (exclusions or failed_with_palms):
            break
        attempt += 1
        palms = palms and not failed_with_palms
        search = _search(planner, config, observer, attempt, exclusions, palms)
    reason = best.failure.reason if best and best.failure else search.reason
    return PipelineResult(robot, world, config, chosen, best, tested, reason)


def _uses_palms(sequence: ContactSequence) -> bool:
    """Whether palms are in contact later than the transitions that could end the start's palm contacts."""
    return any(stance.palms for stance in sequence.stances[len(sequence.start.palms) :])


def _search(
    planner: Planner,
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


def _blamed(sequence: ContactSequence, failure: Failure) -> list[Exclusion]:
    """The transition at which a trial failed, for the next search to avoid; empty where it is unknown.

    The sequence has the contacts as the search proposed them, not where the optimiser moved landing points.
    """
    if failure.transition is None or not sequence.transitions:
        return []
    index = min(failure.transition, len(sequence.transitions) - 1)
    return [Exclusion.of(sequence.stances[index], sequence.transitions[index])]


def _meets(solution: Solution, exclusions: list[Exclusion]) -> bool:
    """Whether a solution contains an excluded transition."""
    sequence = solution.sequence
    for stance, transition in zip(sequence.stances, sequence.transitions, strict=False):
        own = Exclusion.of(stance, transition)
        if excluded(exclusions, own.before, np.array([own.limb]), own.target[None])[0]:
            return True
    return False
