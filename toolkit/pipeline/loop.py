"""The loop of a run: search, choose by the true cost among what was found, and search again without what failed."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.failure import Failure
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import PlanningError
from toolkit.execution.check import Check
from toolkit.mjcf import warnings_refused
from toolkit.pipeline.candidate import Candidate, Source, refined_solution
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.planner import Planner
from toolkit.pipeline.trial import Tester, Trial
from toolkit.refine.local_search import LocalSearch
from toolkit.robot.model import RobotModel
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.costs.plan_cost import PlanCost, plan_cost
from toolkit.search.moves.exclusion import Blame, to_blame
from toolkit.search.moves.limits import MOST_CARE
from toolkit.search.result import SearchResult, Solution
from toolkit.world.timing import Timing
from toolkit.world.world import World

_SAME = 2  # equal failures where nothing has moved yet, after which no other sequence is tried
_WORTH = 0.9  # of a cost, below which a calmer pace is worth a search; a local search saves less at any pace
_FAILURES = 2  # at one pace, after which a calmer one is searched, if there is one


@dataclass(frozen=True)
class PipelineResult:
    """The result of a run.

    Attributes:
        robot, world, config: As given to `run`.
        search: Result of the contact search that found the trial's sequence, or of the last search without a trial.
        trial: The trial that passed, or else the one that came furthest; None without a plan.
        candidates: All sequences that were optimised.
        trials: All trials of candidates with a feasible motion, in the order in which they were made.
        reason: One line where the verdict is FAIL, else "".
    """

    robot: RobotModel
    world: World
    config: PipelineConfig
    search: SearchResult
    trial: Trial | None
    candidates: tuple[Candidate, ...]
    trials: tuple[Trial, ...]
    reason: str

    @property
    def passed(self) -> bool:
        """Whether the verdict is PASS."""
        return self.trial is not None and self.trial.passed

    @property
    def stage(self) -> str:
        """The first stage that the trial did not pass, "planning" without a trial, or "done"."""
        trial = self.trial
        if trial is None:
            return "planning"
        if trial.passed:
            return "done"
        if trial.execution is not None:
            return "execution"
        return "dynamics" if trial.trajectory is None else "wholebody"

    @property
    def cost(self) -> PlanCost | None:
        """The true cost of the trial's plan; None without a plan."""
        return None if self.trial is None else self.trial.candidate.cost

    @property
    def first_feasible(self) -> Candidate | None:
        """The candidate with a feasible motion that was found first; None where there is none."""
        return min((item for item in self.candidates if item.feasible), key=lambda item: item.seconds, default=None)

    def is_chosen(self, candidate: Candidate) -> bool:
        """Whether a candidate is that of the trial."""
        return self.trial is not None and self.trial.candidate.number == candidate.number

    def reason_against(self, candidate: Candidate) -> str:
        """One line on why a candidate did not pass; "" where it passed or was not tested."""
        failures = [trial.failure for trial in self.trials if trial.candidate.number == candidate.number]
        failure = next(iter([*failures, candidate.failure]))
        return "" if failure is None else failure.reason

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks of the verdict; empty where nothing was executed."""
        return self.trial.execution.checks if self.trial is not None and self.trial.execution is not None else ()


@warnings_refused("the run", PlanningError)
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
    return _Run(robot, world, planner, config, observer or Observer()).result()


class _Run:
    """One run, and what it has found so far."""

    def __init__(self, robot: RobotModel, world: World, planner: Planner, config: PipelineConfig, observer: Observer):
        self._robot, self._world, self._planner, self._config = robot, world, planner, config
        self._observer, self._tester = observer, Tester(robot, world, config, observer)
        self._searches: list[SearchResult] = []
        self._candidates: list[Candidate] = []
        self._trials: list[Trial] = []
        self._blame = Blame(scale=robot.scale.length)
        self._at_start: Counter[str] = Counter()  # reasons of failures where nothing has moved yet
        self._known: set[bytes] = set()
        self._pace = 0  # how often the pace has yielded; -1 at a brisker one
        self._fruitful: int | None = None  # the pace of the last search that found something
        self._calmest: int | None = None  # the last pace to search at, where nothing was found at a calmer one
        self._care, self._most_care = 0, MOST_CARE  # how often the margins of the legs have grown, and may
        self._hurried = False  # whether a brisker pace than the first has been tried
        self._improved_at: dict[int, int] = {}  # number of exclusions when a candidate was improved last
        self._local: LocalSearch | None = None

    def result(self) -> PipelineResult:
        """Search and test until a trial passes, or nothing is left to try."""
        palms, aside = True, []
        while True:
            search = self._search(palms)
            found = self._optimised(search)
            if not aside and self._spares_legs(found):
                continue
            if min(_costs(aside), default=np.inf) < min(_costs(found), default=np.inf):
                found += aside  # what was found at a faster pace
            paces = self._paces_that_pay(found)
            if not paces and (better := self._refined(found)):
                found += better
                paces = self._paces_that_pay(found)
            if paces:
                aside, self._pace = found, self._pace + paces
                continue
            tested = len(self._trials)
            passed, aside = self._tried(found), []
            failed_with_palms = any(candidate.uses_palms for candidate in found)
            if passed or self._spent():
                break
            palms = palms and (self._too_fast or not failed_with_palms)
            if self._calmer and not self._keeps_pace(tested):
                self._pace += 1
            elif not found and self._fruitful is not None and self._fruitful < self._pace:
                self._pace = self._calmest = self._fruitful  # what failed there may not be all that there is
                aside = self._left_over()
            elif not found or not (self._blame.exclusions or failed_with_palms):
                break
        return self._concluded()

    def _spares_legs(self, found: list[Candidate]) -> bool:
        """Whether to search again because no sequence has a motion, most of them for the limits of the legs.

        A judge without dynamics does not know how far the CoM is from where it expects it. So the margins of the legs
        grow, as long as anything is found with them. Then a brisker pace is tried once, at which the CoM need not go as
        far over each foot.
        """
        again = self._care > 0 and not found
        if again:
            self._care = self._most_care = 0
        else:
            stretched = sum(c.failure is not None and c.failure.stretched for c in found)
            if _ranked(found) or self._spent() or 2 * stretched <= len(found):
                return False
            if self._care < self._most_care:
                self._care += 1
                return True
        if self._hurried or not self._searches[-1].brisker:
            return again
        self._care, self._most_care, self._pace, self._hurried = 0, 0, self._pace - 1, True
        return True

    def _left_over(self) -> list[Candidate]:
        """Feasible candidates that have not been tested and have no transition that failed."""
        tested = {trial.candidate.number for trial in self._trials}
        return [
            candidate
            for candidate in self._candidates
            if candidate.feasible
            and candidate.number not in tested
            and self._blame.first_in(candidate.solution.sequence) is None
        ]

    def _keeps_pace(self, tested: int) -> bool:
        """Whether a calmer pace would not help after the last trial from number `tested` on; half are left for those.

        No pace is to blame, or calmer ones have asked too much of the legs.
        """
        last = self._trials[-1].failure if len(self._trials) > tested else None
        if last is None or len(self._trials) >= self._config.candidates // 2:
            return False
        return last.at_any_pace or (self._pace < 0 and not last.too_fast)

    @property
    def _calmer(self) -> tuple[Timing, ...]:
        """The swings' longest timings at the paces to which the last search may yield."""
        return () if self._pace == self._calmest else self._searches[-1].calmer

    def _spent(self) -> bool:
        """Whether nothing more may be optimised or tested, or other sequences would make no difference."""
        spent = self._optimisations >= self._config.optimisations or len(self._trials) >= self._config.candidates
        return spent or self._hopeless

    @property
    def _hopeless(self) -> bool:
        """Whether sequences fail in the same way where nothing has moved yet: they have no part in that."""
        return max(self._at_start.values(), default=0) >= _SAME

    def _note(self, sequence: ContactSequence, failure: Failure) -> None:
        """Enter why a sequence failed.

        The sequence has the contacts as the search proposed them, not where the optimiser moved landing points.
        """
        self._blame.add(sequence, failure.transition)
        if failure.time is not None and failure.time <= 0.0:
            self._at_start[failure.reason] += 1

    @property
    def _optimisations(self) -> int:
        """Number of sequences of searches that were optimised."""
        return sum(candidate.source == Source.SEARCH for candidate in self._candidates)

    def _concluded(self) -> PipelineResult:
        """The result with the best trial; of trials that came equally far, the first."""
        trials = self._trials or [self._tester.test(candidate) for candidate in self._candidates[:1]]
        best = max(trials, key=lambda trial: trial.merit, default=None)
        search = self._searches[-1 if best is None else best.candidate.search]
        reason = search.reason if best is None else ""
        if best is not None and best.failure is not None:
            reason = best.failure.reason
        candidates, trials = tuple(self._candidates), tuple(self._trials)
        return PipelineResult(self._robot, self._world, self._config, search, best, candidates, trials, reason)

    def _search(self, palms: bool) -> SearchResult:
        """One contact search; the first one uses the seed itself."""
        config, observer, exclusions = self._config, self._observer, self._blame.exclusions
        observer.started("planning")
        search = self._planner.search(
            np.random.default_rng([config.seed, len(self._searches)]),
            config.time_limit,
            observer=lambda progress: observer.progress("planning", None, str(progress)),
            exclusions=tuple(exclusions),
            palms=palms,
            calmer=self._pace,
            care=self._care,
        )
        self._searches.append(search)
        found = len(search.solutions)
        self._fruitful = self._pace if found else self._fruitful
        detail = search.reason or f"{found} sequence{'s' if found > 1 else ''}"
        if exclusions:
            detail += f" without {len(exclusions)} transition{'s' if len(exclusions) > 1 else ''} that failed"
        if self._care:
            detail += " and with wider margins of the legs"
        if not palms:
            detail += " for the feet alone"
        if search.warning:
            detail += f"; warning: {search.warning}"
        observer.finished("planning", found > 0, search.seconds, detail)
        return search

    def _optimised(self, search: SearchResult) -> list[Candidate]:
        """New candidates of the last search, the newest (predicted cheapest) first."""
        most = (self._config.optimisations - self._optimisations + 1) // 2  # the other half is for searches to come
        order: list[Solution] = []
        for solution in reversed(search.solutions):
            if len(order) < most and self._new(solution.sequence):
                order.append(solution)
        if not order:
            return []
        began, found = time.perf_counter(), []
        self._observer.started("dynamics")
        for solution in order:
            if self._hopeless:
                break
            found.append(self._candidate(solution))
            self._observer.progress("dynamics", len(found) / len(order), f"{len(found)} of {len(order)} sequences")
        self._observer.finished("dynamics", any(c.feasible for c in found), time.perf_counter() - began, _told(found))
        return found

    def _paces_that_pay(self, found: list[Candidate]) -> int:
        """By how many paces to yield: to each that makes the cheapest candidate clearly cheaper than the last one did.

        The candidate is timed anew for that. What comes of it is a further one, since a search may find nothing better.
        """
        ranked, timings = _ranked(found), self._calmer
        if not ranked or not timings:
            return 0
        best = ranked[0]
        began, pays, plan, least = time.perf_counter(), 0, best.plan, best.cost
        self._observer.started("dynamics")
        for number, timing in enumerate(timings, 1):
            timed = self._tester.motion_of(best.plan.sequence.timed(timing))
            cost = plan_cost(timed, self._weights)
            if timed.motion.feasible and cost.total < _WORTH * least.total:
                pays, plan, least = number, timed, cost
        detail = f"true cost {best.cost.total:.0f}, and not clearly less at a calmer pace"
        if pays:
            found.append(self._made(Source.TIMED, plan, least))
            shift, swing = timings[pays - 1].shift, timings[pays - 1].swing
            detail = f"true cost {best.cost.total:.0f}, and {least.total:.0f} with {shift:g} s + {swing:g} s"
            detail += "; a calmer search follows"
        self._observer.finished("dynamics", True, time.perf_counter() - began, detail)
        return pays

    def _refined(self, found: list[Candidate]) -> list[Candidate]:
        """What the local search makes of the cheapest candidates."""
        starts = _ranked(found)[: self._starts]
        return [better for candidate in starts if self._improvable(candidate) for better in self._improved(candidate)]

    @property
    def _starts(self) -> int:
        """The number of candidates from which the local search starts."""
        return 0 if self._config.refine is None else self._config.refine.starts

    def _improvable(self, candidate: Candidate) -> bool:
        """Whether the local search has not been asked yet for a candidate without the transitions that failed."""
        known = self._improved_at.get(candidate.number) == len(self._blame.exclusions)
        return self._starts > 0 and candidate.source != Source.LOCAL and not known

    def _new(self, sequence: ContactSequence) -> bool:
        """Whether a sequence comes for the first time."""
        known = len(self._known)
        self._known.add(sequence.identity)
        return len(self._known) > known

    def _candidate(self, solution: Solution) -> Candidate:
        """A sequence of the last search, optimised."""
        plan, failure = self._tester.optimise(solution.sequence, solution.plan)
        if failure is not None:
            self._note(solution.sequence, failure)
        return self._entered(Source.SEARCH, solution, plan, plan_cost(plan, self._weights), failure)

    def _entered(
        self, source: Source, solution: Solution, plan: MotionPlan, cost: PlanCost, failure: Failure | None
    ) -> Candidate:
        """A new candidate of the last search."""
        seconds = sum(search.seconds for search in self._searches[:-1]) + solution.seconds
        number, search = len(self._candidates), len(self._searches) - 1
        self._candidates.append(Candidate(number, source, search, seconds, solution, plan, cost, failure))
        return self._candidates[-1]

    @property
    def _weights(self) -> CostConfig:
        """Weights of the true cost on the ground and at the timing of the last search."""
        search = self._searches[-1]
        return self._config.cost.where(slides=search.slides, paced=search.paced)

    def _tried(self, found: list[Candidate]) -> bool:
        """Whether a candidate passes the stages after the optimiser; the truly cheapest is tried first.

        Before a candidate is tested, it is improved, and again where a transition has been blamed since. Where the pace
        may yield, one that fails is tested once more with the transition to blame at a calmer timing unless it does no
        more than touch the world, and no other is after one that asks too much of the joints, or after a few failures
        at a pace that legs can follow when it is calmer.
        On soles that roll, calmer is harder.
        """
        blame = self._blame
        since = len(blame.exclusions)  # what the optimiser rejected concerns only searches to come
        ranked, failures = _ranked(found), 0
        while ranked:
            candidate = min(ranked, key=_rank)
            ranked.remove(candidate)
            if not self._allowed(candidate) or blame.first_in(candidate.solution.sequence, since) is not None:
                continue
            if self._improvable(candidate):
                ranked += [candidate, *self._improved(candidate)]
                continue
            failure = self._failure_of(candidate)
            if failure is None:
                return True
            slowed = self._slowed(candidate, failure)
            again = failure if slowed is None else self._failure_of(slowed)
            if again is None:
                return True
            if self._too_fast:
                break  # the next search is calmer, and no transition is to blame
            self._note(candidate.solution.sequence, failure)
            if slowed is not None and again.at_any_pace:
                self._note(candidate.solution.sequence, again)
            failures += 1 if slowed is None else 2
            if failures >= _FAILURES and self._pace >= 0 and self._calmer and self._robot.stands_on_one_foot:
                break
        return False

    def _failure_of(self, candidate: Candidate) -> Failure | None:
        """Test a candidate: why it does not pass; None where it does."""
        self._trials.append(self._tester.test(candidate))
        return self._trials[-1].failure

    def _slowed(self, candidate: Candidate, failure: Failure) -> Candidate | None:
        """A candidate with the transition to blame at the next calmer timing; None where that is not to be had."""
        sequence = candidate.plan.sequence
        index = to_blame(sequence, failure.transition)
        if index is None or failure.at_any_pace or not self._robot.stands_on_one_foot or not self._allowed(candidate):
            return None
        swing = sequence.transitions[index].timing.swing
        timing = next((each for each in self._searches[-1].calmer if each.swing > swing), None)
        if timing is None:
            return None
        plan = self._tester.motion_of(sequence.timed(timing, index))
        if not plan.motion.feasible:
            return None
        return self._made(Source.TIMED, plan, plan_cost(plan, self._weights))

    @property
    def _too_fast(self) -> bool:
        """Whether the last trial asked too much of the joints at a pace that may yield."""
        failure = self._trials[-1].failure if self._trials else None
        return failure is not None and failure.too_fast and bool(self._calmer)

    def _improved(self, candidate: Candidate) -> list[Candidate]:
        """What the local search makes of a candidate without transitions that failed; nothing where none is better."""
        config, screen = self._config.refine, self._searches[candidate.search].screen
        self._improved_at[candidate.number] = len(self._blame.exclusions)
        if config is None or screen is None:
            return []
        if self._local is None:
            self._local = LocalSearch(config, self._weights, self._optimise, self._tester.slide, self._tester.part)
        began, before = time.perf_counter(), self._local.spent
        self._observer.started("refinement")
        origin = candidate.solution.sequence
        plan = self._local.improved(candidate.plan, origin, screen, lambda each: self._blame.first_in(each) is None)
        changed = plan is not candidate.plan
        plan = self._tester.settled(plan) if changed else plan
        cost = plan_cost(plan, self._weights)
        detail = f"true cost {candidate.cost.total:.0f} to {cost.total:.0f} with {self._local.spent - before} motions"
        self._observer.finished("refinement", True, time.perf_counter() - began, detail)
        if not changed or not self._new(plan.sequence):
            return []
        return [self._made(Source.LOCAL, plan, cost)]

    def _made(self, source: Source, plan: MotionPlan, cost: PlanCost) -> Candidate:
        """A new candidate that was made from what the last search found, as if that had found it."""
        return self._entered(source, refined_solution(plan, cost, self._searches[-1].seconds), plan, cost, None)

    def _optimise(self, sequence: ContactSequence) -> MotionPlan:
        """The motion of a variant."""
        self._observer.progress("refinement", None, f"{len(sequence.transitions)} transitions")
        return self._tester.motion_of(sequence)

    def _allowed(self, candidate: Candidate) -> bool:
        """Whether one more trial may be made; half of them are for the feet alone."""
        most = 0 if self._hopeless else self._config.candidates
        return len(self._trials) < (max(1, most // 2) if candidate.uses_palms else most)


def _costs(found: list[Candidate]) -> list[float]:
    """True costs of feasible candidates."""
    return [candidate.cost.total for candidate in found if candidate.feasible]


def _ranked(found: list[Candidate]) -> list[Candidate]:
    """Feasible candidates, the truly cheapest first."""
    return sorted((candidate for candidate in found if candidate.feasible), key=_rank)


def _rank(candidate: Candidate) -> tuple[float, int]:
    """What comes first: the truly cheapest, and of equal ones the first."""
    return candidate.cost.total, candidate.number


def _told(found: list[Candidate]) -> str:
    """How the optimisation of some sequences ended, in one line."""
    feasible = _costs(found)
    count = f"{len(feasible)} of {len(found)} sequence{'s' if len(found) > 1 else ''} feasible"
    if not feasible:
        assert found[0].failure is not None
        return f"{count}; {found[0].failure.reason}"
    return f"{count}, true cost {min(feasible):.0f}" + (f" to {max(feasible):.0f}" if len(feasible) > 1 else "")
