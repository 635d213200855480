"""The planner's own graph of contact transitions for other searches: the same moves, checks and costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from toolkit.geometry.limb import PALMS
from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.search.costs.delay import Delay, Facing
from toolkit.search.costs.edge_cost import EdgeCost
from toolkit.search.judging import Judging, Tally
from toolkit.search.moves.candidates import CandidateGenerator, mean_feet
from toolkit.search.moves.drift import Drift
from toolkit.search.moves.reach_check import ReachCheck
from toolkit.search.planner import ContactPlanner
from toolkit.search.problem import ContactProblem, Parts
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import CONTACTS, is_pending, unpack, unpack_all
from toolkit.search.strategies import strategy_of


@dataclass(frozen=True)
class ContactGraph:
    """The graph and how to read it.

    Attributes:
        problem: The graph.
        parts: Its parts.
        box: (2, 2) m; corners of start, goal and the world's surfaces, seen from above.
        goal: (2,) m.
    """

    problem: ContactProblem
    parts: Parts
    box: np.ndarray
    goal: np.ndarray

    def place(self, states: Sequence[bytes]) -> np.ndarray:
        """(n, 2) m; mean of the feet of states."""
        return mean_feet(self.parts.table, unpack_all(states)[:, CONTACTS])[0][:, :2]

    def sequence(self, states: Sequence[bytes], payloads: Sequence[Any]) -> ContactSequence:
        """The contacts of a path."""
        reader = self.parts.reader
        judged = [state for state in states if not is_pending(state)]
        steps = [payload for payload in payloads if payload is not None]
        transitions = tuple(reader.transition(*step) for step in zip(judged[1:], steps, strict=True))
        return ContactSequence(reader.stance(unpack(judged[:1])[0, CONTACTS]), transitions)


def contact_graph(planner: ContactPlanner, evaluator: TransitionEvaluator) -> ContactGraph:
    """The graph that a planner searches, with transitions judged by an evaluator.

    Raises:
        PlanningError: The robot cannot stand at the start, or nothing leads to the goal.
    """
    ground, world, robot = planner.ground, planner.world, planner.robot
    start = ground.start_stance()
    way = ground.way(start)
    timings, tally = planner.timings(slides=way.slides), Tally()
    scale = robot.scale
    slides, paced = way.slides, planner.paced
    strategy = strategy_of(planner.config, evaluator, way.length, slides=slides, paced=paced, scale=scale.length)
    moves = ground.moves(way)
    limbs = [limb for limb in PALMS if planner.config.palms and moves.has_palm_surfaces and limb in robot.arms]
    reader, reach = StateReader(moves.table, timings, scale), ReachCheck(moves, limbs, timings)
    cost = EdgeCost(strategy.cost, moves.table, timings, world.goal, way.distance, way.longest, scale=scale)
    facing = Facing(way.distance, strategy.cost.heading, cost.per_metre, scale.length)
    parts = Parts(
        table=moves.table,
        reader=reader,
        candidates=CandidateGenerator(moves, limbs, timings, (), tally.rejected),
        judging=Judging(strategy.judge, reader, reach, tally, math.inf),
        lazy=strategy.lazy,
        cost=cost,
        delay=Delay(Drift(robot, moves.table, timings), facing, None, cost.per_metre),
        tally=tally,
        screen=SequenceScreen(moves, limbs),
    )
    com = start.mean_feet.position + np.array([0.0, 0.0, robot.com_height])
    problem = ContactProblem(parts, reader.at_rest(start, com))
    return ContactGraph(problem, parts, _box(planner), world.goal.position[:2])


def _box(planner: ContactPlanner) -> np.ndarray:
    """(2, 2) m; see `ContactGraph`."""
    points = [planner.world.start.position[None, :2], planner.world.goal.position[None, :2]]
    for surface in planner.world.surfaces:
        if surface.serves_foot:
            ring = surface.boundary[0]
            points.append((surface.pose @ np.column_stack([ring, np.zeros(len(ring))]))[:, :2])
    everything = np.concatenate(points)
    return np.array([everything.min(0), everything.max(0)])
