"""One trial of the ablation: a planner, a world, and an effort that is the same for every planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.errors import PlanningError
from toolkit.execution.run import execute
from toolkit.robot.model import RobotModel
from toolkit.wholebody.plan import whole_body
from toolkit.world.scene import compose_scene
from toolkit.world.world import World
from validation.cases import Case
from validation.jobs import Record, reason_of
from validation.options import TrialSettings
from validation.run_trial import executed, robot_of
from validation.searched import Searched, Tested, cheapest, favourite, search
from validation.truth import Truth

RAW, BY_COUNT, BY_TIME = "raw favourite", "choice, equal optimisations", "choice, equal seconds"
LOCAL = {RAW: "favourite, local search", BY_COUNT: "choice, local search"}
"""What the local search makes of a variant."""
BEST = LOCAL[BY_COUNT]
VARIANTS = (RAW, LOCAL[RAW], BY_COUNT, BEST, BY_TIME)


@dataclass(frozen=True)
class Effort:
    """What every planner is given.

    Attributes:
        optimisations: Number of sequences that are optimised for the choice.
        seconds: s; of searches and optimisations for the choice.
        motions: Most motions that a local search may optimise beyond that; 0: there is no local search.
        rounds: Most searches, each with a seed of its own.
    """

    optimisations: int = 20
    seconds: float = 5.0
    motions: int = 60
    rounds: int = 10

    @property
    def variants(self) -> tuple[str, ...]:
        """The variants that the effort allows."""
        return tuple(name for name in VARIANTS if self.motions or name not in LOCAL.values())


@dataclass(frozen=True)
class Spent:
    """A sequence that was optimised, and when.

    Attributes:
        tested: The sequence.
        at: s that had been spent on heuristics, searches and optimisations until then.
    """

    tested: Tested
    at: float


def spend(effort: Effort, searches: Sequence[Searched]) -> tuple[Tested | None, Tested | None]:
    """The truly cheapest of as many optimisations, and of as many seconds, as the effort allows.

    Of each search, the sequences that it holds for the cheapest are optimised first where their number counts. Where
    the seconds count, each is optimised when it is found. No sequence is optimised twice.
    """
    ledger = accounts(searches)
    counted, known = [], set()
    for searched in searches:
        for tested in searched.by_cost:
            key = tested.solution.sequence.identity
            if key not in known and len(counted) < effort.optimisations:
                known.add(key)
                counted.append(tested)
    in_time = [spent.tested for spent in ledger if spent.at <= effort.seconds]
    return cheapest(counted), cheapest(in_time)


def accounts(searches: Sequence[Searched]) -> list[Spent]:
    """Every different sequence of searches in turn, and when it was optimised."""
    ledger, known, before = [], set(), 0.0
    for searched in searches:
        before += searched.result.heuristic_seconds
        for tested in searched.tested:
            key = tested.solution.sequence.identity
            if key not in known:
                known.add(key)
                before += tested.outcome.seconds
                ledger.append(Spent(tested, before + tested.solution.seconds))
        before += searched.result.seconds
    return ledger


def ablation_trial(settings: TrialSettings, case: Case, planner: str, effort: Effort, execution: bool) -> Record:
    """A record: what each variant of a planner achieves in a world.

    Args:
        settings: Of the planner.
        case: World and seed.
        planner: Who judges transitions.
        effort: What it may spend.
        execution: Whether the chosen plans are simulated.
    """
    robot, world = robot_of(settings.robot, settings.robots), case.world()
    record: Record = {"kind": case.kind, "seed": case.seed, "planner": planner, "stage": "planning", "variants": {}}
    truth = Truth(robot, world, settings.planning.timing)
    searches: list[Searched] = []
    try:
        while len(searches) < effort.rounds and _left(effort, searches):
            searches.append(search(settings, world, planner, [case.seed, len(searches)], truth))
    except PlanningError as error:
        return record | {"found": False, "feasible": False, "passed": False, "reason": reason_of(error)}
    first = searches[0]
    chosen = dict(zip((RAW, BY_COUNT, BY_TIME), (favourite(first.tested), *spend(effort, searches)), strict=True))
    plans: dict[str, MotionPlan] = {}
    variants: dict[str, Any] = {}
    for name, item in chosen.items():
        if item is None:
            continue
        plans[name], variants[name] = item.outcome.plan, item.outcome.record()
        if effort.motions and name in LOCAL:
            origin = item.solution.sequence
            better = truth.improved(item.outcome.plan, origin, item.screen, effort.motions)
            plans[LOCAL[name]], variants[LOCAL[name]] = better.plan, better.record()
    if execution:
        _execute(settings, robot, world, plans, variants)
    summary = first.summary()
    passed = all(variants.get(name, {}).get("executed", name in variants) for name in effort.variants)
    reasons = [item["execution_reason"] for item in variants.values() if item.get("execution_reason")]
    return record | {
        **summary,
        "searches": len(searches),
        "optimised": len(accounts(searches)),
        "spent": sum(searched.seconds for searched in searches),
        "variants": variants,
        "passed": passed,
        "stage": "done" if passed else "execution" if reasons else "dynamics" if summary["found"] else "planning",
        "reason": summary["reason"] or next(iter(reasons), "" if passed else "no variant of all has a feasible plan"),
    }


def _left(effort: Effort, searches: Sequence[Searched]) -> bool:
    """Whether another search may help: effort is left, and the last two searches did not both find nothing new."""
    if not searches:
        return True
    ledger = accounts(searches)
    spent = sum(searched.seconds for searched in searches)
    if len(ledger) >= effort.optimisations and spent >= effort.seconds:
        return False
    return len(searches) < 3 or len(accounts(searches[:-2])) < len(ledger)


def _execute(
    settings: TrialSettings,
    robot: RobotModel,
    world: World,
    plans: dict[str, MotionPlan],
    variants: dict[str, Any],
) -> None:
    """Simulate the plans, each different one once, and enter what came of it."""
    known: dict[bytes, dict[str, Any]] = {}
    for name, plan in plans.items():
        key = plan.sequence.identity
        if key not in known:
            known[key] = run_plan(settings, robot, world, plan)
        variants[name] |= known[key]


def run_plan(settings: TrialSettings, robot: RobotModel, world: World, plan: MotionPlan) -> dict[str, Any]:
    """Whole-body motion and simulation of a plan: whether every check passes, and else why not."""
    whole = whole_body(plan, compose_scene(robot, world))
    if not whole.trajectory.feasible:
        return {"executed": False, "execution_reason": f"no whole-body motion: {whole.trajectory.reason}"}
    run = execute(whole, config=settings.execution, rng=np.random.default_rng(0))
    reason = "" if run.failure is None else run.failure.reason
    figures = executed(run)
    return {"executed": run.failure is None, "held": figures["held"], "execution_reason": reason}
