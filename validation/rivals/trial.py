"""One trial of a rival in a world: its plan, how long it took, and what the independent checks say of the plan."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import PlanningError
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel
from toolkit.search.planner import ContactPlanner
from toolkit.world.world import World
from validation.ablation_trial import run_plan
from validation.cases import Case
from validation.jobs import Record, reason_of
from validation.options import TrialSettings
from validation.rivals.best_first import Limits, a_star
from validation.rivals.contact_graph import ContactGraph, contact_graph
from validation.rivals.footsteps import footsteps_of
from validation.rivals.linear import violation
from validation.rivals.mixed_integer import Model, mixed_program, planned
from validation.rivals.random_tree import random_tree
from validation.rivals.sl1m import relax
from validation.rivals.solvers import solver_of
from validation.run_trial import make_planner, robot_of
from validation.searched import cheapest, make_ready, search
from validation.truth import Truth

OURS, PLAIN, WEIGHTED, TREE, RELAXATION = "ANA*", "A*", "A*, h times 3", "RRT", "SL1M"
SEARCHES = (OURS, PLAIN, WEIGHTED, TREE, RELAXATION)
_WEIGHT = 3.0
_STEPS = range(6, 31)  # numbers of steps that SL1M tries, one after the other


@dataclass(frozen=True)
class Mixed:
    """A mixed-integer rival.

    Attributes:
        solver: Its name; see `solvers.solver_of`.
        count: Number of steps.
        seconds: s; limit.
        full: Whether with full dynamics.
    """

    solver: str
    count: int
    seconds: float
    full: bool = False

    @property
    def name(self) -> str:
        """Unique among rivals."""
        return f"MIP{' full' if self.full else ''} {self.solver} {self.count}"


@dataclass(frozen=True)
class Plan:
    """What a rival found.

    Attributes:
        sequence: None where there is no plan.
        seconds: s until it, what the rival itself asked the optimiser included.
        figures: Of the rival alone, as JSON can hold them.
        reason: Why there is no plan.
    """

    sequence: ContactSequence | None
    seconds: float
    figures: dict[str, Any]
    reason: str = ""


def rival_trial(settings: TrialSettings, case: Case, rival: str | Mixed, seconds: float, simulate: bool) -> Record:
    """A record of a rival in a world.

    Args:
        settings: Of the planner whose moves, judges and timing the searches share.
        case: World and seed.
        rival: One of `SEARCHES`, or a mixed-integer program with a limit of its own.
        seconds: s; limit of the searches.
        simulate: Whether the plan is carried out.
    """
    robot, world = robot_of(settings.robot, settings.robots), case.world()
    make_ready(settings, settings.planner)
    name = rival if isinstance(rival, str) else rival.name
    record: Record = {"kind": case.kind, "seed": case.seed, "rival": name, "stage": "planning"}
    record |= {"found": False, "feasible": False, "passed": False}
    truth = Truth(robot, world, settings.planning.timing)
    try:
        planner = make_planner(settings, world)
        began, worked = time.perf_counter(), time.process_time()
        if isinstance(rival, str):
            plan = _SEARCHERS[rival](_Arena(settings, robot, world, planner, truth, case.seed, seconds))
        else:
            plan = _mixed(robot, world, planner, rival)
    except PlanningError as error:
        return record | {"reason": reason_of(error)}
    share = min((time.process_time() - worked) / (time.perf_counter() - began), 1.0)
    record |= {"seconds": plan.seconds, "processor_seconds": share * plan.seconds, **plan.figures}
    if plan.sequence is None:
        return record | {"reason": plan.reason}
    return record | checked(settings, robot, world, planner, plan.sequence, truth, simulate)


def checked(
    settings: TrialSettings,
    robot: RobotModel,
    world: World,
    planner: ContactPlanner,
    sequence: ContactSequence,
    truth: Truth,
    simulate: bool,
) -> Record:
    """What the search's screens, the optimiser with its independent verdict, and the simulation say of any plan."""
    graph = contact_graph(planner)
    screened = int((graph.parts.screen.codes(sequence) == 0).sum())
    outcome = truth(sequence)
    found = {"found": True, "screened": screened, **outcome.record(), "stage": "dynamics"}
    if not outcome.feasible:
        return found
    found |= {"passed": True, "stage": "done"}
    return found | run_plan(settings, robot, world, outcome.plan) if simulate else found


@dataclass(frozen=True)
class _Arena:
    """What a search gets."""

    settings: TrialSettings
    robot: RobotModel
    world: World
    planner: ContactPlanner
    truth: Truth
    seed: int
    seconds: float

    @property
    def graph(self) -> ContactGraph:
        """The graph of the planner with its own judges."""
        return contact_graph(self.planner)

    @property
    def limits(self) -> Limits:
        """Those of our own search: seconds, and expansions where there is such a limit."""
        expansions = self.settings.planning.expansions
        return Limits(self.seconds, 10**9 if expansions is None else expansions)


def _ours(arena: _Arena) -> Plan:
    searched = search(arena.settings, arena.world, arena.settings.planner, [arena.seed, 0], arena.truth)
    first, summary, best = searched.first_feasible, searched.summary(), cheapest(searched.tested)
    figures = {
        "expansions": summary["expansions"],
        "sequences": summary["sequences"],
        "whole_seconds": searched.seconds,
    }
    if best is not None:
        figures["best_true_cost"] = best.outcome.cost.total
    if first is None:
        return Plan(None, searched.seconds, figures, summary["reason"] or "no sequence has a motion")
    return Plan(first.solution.sequence, first.ready, figures)


def _by_graph(run: Callable[[ContactGraph, Callable[..., bool], _Arena], Any]) -> Callable[[_Arena], Plan]:
    """A searcher that runs on the graph and ends with the first path whose motion is feasible."""

    def searcher(arena: _Arena) -> Plan:
        graph, refused = arena.graph, [0]

        def accept(states: Sequence[bytes], payloads: Sequence[Any]) -> bool:
            feasible = arena.truth(graph.sequence(states, payloads)).feasible
            refused[0] += not feasible
            return feasible

        found = run(graph, accept, arena)
        figures = {"expansions": found.expansions, "refused": refused[0], "stopped_by": found.stopped_by}
        if not found.states:
            return Plan(None, found.seconds, figures, f"stopped by {found.stopped_by}")
        return Plan(graph.sequence(found.states, found.payloads), found.seconds, figures)

    return searcher


def _relaxed(arena: _Arena) -> Plan:
    began, tried, reason = time.perf_counter(), 0, "no number of steps"
    for count in _STEPS:
        if time.perf_counter() - began > arena.seconds:
            reason = "stopped by time"
            break
        tried += 1
        found = relax(footsteps_of(arena.robot, arena.world, arena.planner, count))
        if found.sequence is not None:
            return Plan(found.sequence, time.perf_counter() - began, {"tried": tried, "rounds": found.rounds})
        reason = found.reason
    return Plan(None, time.perf_counter() - began, {"tried": tried}, reason)


def _mixed(robot: RobotModel, world: World, planner: ContactPlanner, rival: Mixed) -> Plan:
    solver = solver_of(rival.solver)
    task = footsteps_of(robot, world, planner, rival.count)
    model = Model.full(robot.half_sizes[Limb.LEFT_FOOT]) if rival.full else Model()
    mixed = mixed_program(task, model)
    solved = solver(mixed.program, rival.seconds)
    figures = {"limit": rival.seconds, "solution": solved.record(), **mixed.program.size}
    if solved.x is None:
        return Plan(None, solved.seconds, figures, f"{rival.solver}: {solved.status}")
    figures["violation"] = violation(mixed.program, solved.x)
    return Plan(planned(task, mixed, solved.x), solved.first_seconds or solved.seconds, figures)


_SEARCHERS: dict[str, Callable[[_Arena], Plan]] = {
    OURS: _ours,
    PLAIN: _by_graph(lambda graph, accept, arena: a_star(graph.problem, accept, arena.limits)),
    WEIGHTED: _by_graph(lambda graph, accept, arena: a_star(graph.problem, accept, arena.limits, _WEIGHT)),
    TREE: _by_graph(
        lambda graph, accept, arena: random_tree(
            graph.problem, graph.place, graph.box, graph.goal, accept, np.random.default_rng(arena.seed), arena.limits
        )
    ),
    RELAXATION: _relaxed,
}
