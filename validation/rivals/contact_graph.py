"""The planner's own graph of contact transitions for other searches: the same moves, checks and costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.contacts.sequence import ContactSequence
from toolkit.search.judging import Tally
from toolkit.search.moves.candidates import mean_feet
from toolkit.search.planner import ContactPlanner
from toolkit.search.problem import ContactProblem, Parts
from toolkit.search.states.state import CONTACTS, is_pending, unpack, unpack_all


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


def contact_graph(planner: ContactPlanner) -> ContactGraph:
    """The graph that a planner searches.

    Raises:
        PlanningError: The robot cannot stand at the start, or nothing leads to the goal.
    """
    ground, robot = planner.ground, planner.robot
    start = ground.start_stance()
    way = ground.way(start)
    parts = planner.parts(way, planner.strategy(way), planner.timings(slides=way.slides), Tally())
    com = initial_com(robot, start)
    problem = ContactProblem(parts, parts.reader.at_rest(start, com))
    return ContactGraph(problem, parts, _box(planner), planner.world.goal.position[:2])


def _box(planner: ContactPlanner) -> np.ndarray:
    """(2, 2) m; see `ContactGraph`."""
    points = [planner.world.start.position[None, :2], planner.world.goal.position[None, :2]]
    for surface in planner.world.surfaces:
        if surface.serves_foot:
            points.append(surface.rings[0][:, :2])
    everything = np.concatenate(points)
    return np.array([everything.min(0), everything.max(0)])
