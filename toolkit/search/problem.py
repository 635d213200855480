"""The contact search as a graph for ANA*: states, the transitions out of them, and what these cost (paper, Sec. V).

Where judging a transition takes long, transitions wait to be judged until they are the best to go on with: the graph
then has, between two states, one that stands for the transition not yet judged (`state.pack_pending`).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from copy import copy

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.geometry.limb import PALMS, Limb
from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.graph import Edge
from toolkit.search.costs.cost import CostConfig
from toolkit.search.costs.haste import Haste, HasteConfig
from toolkit.search.costs.heuristic import Distance
from toolkit.search.moves.candidates import CandidateGenerator, Candidates, mean_feet
from toolkit.search.moves.drift import Drift
from toolkit.search.moves.exclusion import Exclusion
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reach_check import ReachCheck, ReachConfig
from toolkit.search.moves.reasons import Reason
from toolkit.search.states.contact_table import ContactTable
from toolkit.search.states.state import (
    COM,
    CONTACTS,
    LAST,
    OLD,
    SIZE,
    TIMING,
    VELOCITY,
    is_pending,
    pack,
    pack_pending,
    unpack,
    unpack_all,
)
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

_LIMBS = tuple(Limb)
_CROWD, _PACE = 0.1, 0.25  # m, m/s
_LEAST_RESERVE = 0.02  # of friction; what slides costs no more than what barely holds


class ContactProblem:
    """Graph of one search; see `search.anytime.graph.SearchProblem`. Edge payloads are (objective, timing index).

    Args:
        robot: the robot.
        moves: candidates.
        table: their contacts.
        evaluator: judges dynamics.
        distance: to the goal.
        start: first stance.
        com: (3,) m; first CoM, at rest.
        goal: where to.
        longest: m; most that the mean of the feet moves in one transition.
        timings: to choose from.
        palms: whether palms may be used; those of the start are let go first where not.
        config: costs.
        reach: what legs and arms may reach.
        exclusions: transitions that later stages rejected.
        lazy: whether a transition is judged only when it is the best to go on with.
        second: judges, in the same way, what the evaluator rejects; None: nobody does.
        haste: delays states that run ahead of their feet; the second judge is then asked only where the first sees no
            way on. None: nothing is delayed.
        forced: m/s^2; most that the robot accelerates on the way whatever it does; for `haste`.

    Attributes:
        rejected: (len(Reason),) int; candidates that fell, by reason.
        deadline: s on the clock of `time.perf_counter`; no query that would end later is begun.
    """

    def __init__(
        self,
        robot: RobotModel,
        moves: MoveGenerator,
        table: ContactTable,
        evaluator: TransitionEvaluator,
        distance: Distance,
        start: Stance,
        com: np.ndarray,
        goal: Goal,
        longest: float,
        timings: tuple[Timing, ...],
        palms: bool,
        config: CostConfig,
        reach: ReachConfig,
        exclusions: Sequence[Exclusion] = (),
        *,
        lazy: bool = False,
        second: TransitionEvaluator | None = None,
        haste: HasteConfig | None = None,
        forced: float = 0.0,
    ):
        self._table, self._evaluator, self._distance, self._goal = table, evaluator, distance, goal
        self._lazy, self._second = lazy, second
        self._judge_of_pending = evaluator if lazy or second is None else second
        self._timings, self._config, self._longest = timings, config, longest
        self.rejected = np.zeros(len(Reason), np.int64)
        limbs = [limb for limb in PALMS if palms and limb in robot.arms and moves.has_palm_surfaces]
        self._candidates = CandidateGenerator(
            moves, table, limbs, timings, config.swing_speed, exclusions, self.rejected
        )
        self._reach = ReachCheck(robot, moves.legs, moves.shanks, moves.arms, table, limbs, timings, reach)
        self._drift = Drift(robot, table, timings)
        per_metre = 1.0 + config.step / longest
        self._haste = None if haste is None else Haste(table, robot.com_height, forced, per_metre, haste)
        self._shifts, self._swings = np.array([(item.shift, item.swing) for item in timings]).T
        self._durations = self._shifts + self._swings
        numbers = np.full((1, 4), -1)
        for contact in start.contacts:
            numbers[0, contact.limb] = table.add_contact(contact)
        self._start = pack(numbers, np.array([-1]), com[None], np.zeros((1, 3)))[0]
        self._asked: Sequence[bytes] | None = None
        self._answer = (np.zeros((0, SIZE), np.int32), np.zeros((0, 3)), np.zeros(0))
        self.deadline = np.inf
        self._pace: dict[int, float] = {}  # s per transition of the last query, by the evaluator's id

    def start(self) -> bytes:
        """See `SearchProblem`."""
        return self._start

    def left_first(self) -> ContactProblem:
        """The same graph without what begins with the right foot: often mirror images of what begins with the left one.

        Contacts, deadline and counts are shared with this one.
        """
        row, part = unpack([self._start]).copy(), copy(self)
        row[:, LAST] = Limb.RIGHT_FOOT
        part._start = row.tobytes()
        return part

    def stance(self, state: bytes) -> Stance:
        """Stance of a state."""
        return self._stance(unpack([state])[0])

    def _stance(self, row: np.ndarray) -> Stance:
        return Stance(tuple(self._table.contact(int(number)) for number in row[CONTACTS] if number >= 0))

    def origin(self, state: bytes) -> tuple[Stance, np.ndarray, np.ndarray]:
        """Stance, CoM (3,) m and velocity (3,) m/s of a state, or of the one that a pending state comes from."""
        row = unpack([state])[0]
        return self._stance(_before(row)), row[COM] / 1000.0, row[VELOCITY] / 1000.0

    def transition(self, state: bytes, payload: tuple[float, int]) -> ContactTransition:
        """The transition that led to a state over an edge with this payload."""
        row = unpack([state])[0]
        limb = int(row[LAST])
        return self._transition(limb, int(row[CONTACTS][limb]), payload[1])

    def _transition(self, limb: int, number: int, timing: int) -> ContactTransition:
        contact = self._table.contact(number) if number >= 0 else None
        return ContactTransition(_LIMBS[limb], contact, self._timings[timing])

    def _transitions(self, candidates: Candidates) -> TransitionRows:
        limb, number, timing = candidates.limb, candidates.number, candidates.timing
        table = self._table
        return TransitionRows(
            limb,
            number >= 0,
            table.position[number],
            table.rotation[number],
            table.friction(number),
            self._shifts[timing],
            self._swings[timing],
            lambda row: self._transition(int(limb[row]), int(number[row]), int(timing[row])),
        )

    def feet(self, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean of the feet (n, 3) m and its heading (n,) rad of contact numbers (n, 4)."""
        return mean_feet(self._table, contacts)

    def heuristic(self, states: Sequence[bytes]) -> np.ndarray:
        """See `SearchProblem`; Eq. 5 of the paper, with at least one transition where the goal is not reached."""
        return self._to_go(*self._seen(states)[1:])

    def _seen(self, states: Sequence[bytes]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows of states, and `feet` of them; kept for the next question about the same ones."""
        if states is not self._asked:
            rows = unpack_all(states)
            self._asked, self._answer = states, (rows, *self.feet(rows[:, CONTACTS]))
        return self._answer

    def _to_go(self, centre: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        distance = self._distance(centre, yaw)
        transitions = np.maximum(distance / self._longest, ~self._at_goal(centre))
        return distance + self._config.step * transitions

    def is_goal(self, states: Sequence[bytes]) -> np.ndarray:
        """See `SearchProblem`."""
        judged = np.array([not is_pending(state) for state in states])
        return judged & self._at_goal(self._seen(states)[1])

    def _at_goal(self, centre: np.ndarray) -> np.ndarray:
        radius = self._goal.radius
        inner = max(radius - self._config.arrival, 0.5 * radius)
        return np.hypot(*(centre[:, :2] - self._goal.position[:2]).T) <= inner

    def crowd(self, states: Sequence[bytes]) -> list[tuple]:
        """See `SearchProblem`: states with the mean of the feet in the same square of 0.1 m, and about as fast."""
        rows, centre, _ = self._seen(states)
        place = np.floor(centre[:, :2] / _CROWD)
        speed = np.floor(np.hypot(*rows[:, VELOCITY][:, :2].T) / (1000.0 * _PACE))
        kind = [is_pending(state) for state in states]
        return list(map(tuple, np.column_stack([place, speed, kind]).astype(int).tolist()))

    def expand(self, state: bytes, slack: float) -> list[Edge[bytes]] | None:
        """See `SearchProblem`: screens, then one query of the evaluator for all children together."""
        row = unpack([state])[0]
        if is_pending(state):
            return self._judge(row, self._pending(row), self._judge_of_pending)
        contacts = row[CONTACTS]
        candidates = self._candidates.out_of(contacts, int(row[LAST]))
        if candidates is None:
            return []
        h = self._to_go(candidates.centre, candidates.yaw)
        promising = candidates.way + self._config.step + h < slack
        self.rejected[Reason.COSTLY] += len(promising) - int(promising.sum())
        candidates = self._candidates.timed(contacts, candidates.select(promising))
        if not len(candidates):
            return []
        return self._postpone(row, candidates) if self._lazy else self._judge(row, candidates, self._evaluator)

    def _known_cost(self, candidates: Candidates) -> np.ndarray:
        """(n,) part of the edge cost that needs no dynamics."""
        cost = candidates.way + self._config.step
        if len(self._timings) > 1:
            cost = cost + self._config.time * self._durations[candidates.timing]
        if self._config.steep > 0.0:
            feet = np.flatnonzero(candidates.limb <= Limb.RIGHT_FOOT)
            reserve = np.maximum(1.0 - self._table.steepness(candidates.number[feet]), _LEAST_RESERVE)
            cost[feet] += self._config.steep * np.maximum(self._config.reserve / reserve - 1.0, 0.0)
        return cost + self._final_cost(candidates)

    def _judge(
        self, row: np.ndarray, candidates: Candidates, evaluator: TransitionEvaluator
    ) -> list[Edge[bytes]] | None:
        """Edges that the evaluator and the reach of the limbs allow; None where there is no time left to ask."""
        pending = len(row) > OLD
        contacts, com, velocity = _before(row)[CONTACTS], row[COM] / 1000.0, row[VELOCITY] / 1000.0
        transitions = self._transitions(candidates)
        began = time.perf_counter()
        if began + self._pace.get(id(evaluator), 0.0) * len(transitions) > self.deadline:
            return None
        batch = evaluator.evaluate(self._stance(_before(row)), com, velocity, transitions)
        self._pace[id(evaluator)] = (time.perf_counter() - began) / len(transitions)
        codes = np.where(batch.feasible, 0, Reason.DYNAMICS)
        rows = np.flatnonzero(batch.feasible)
        if len(rows):
            chosen = candidates.select(rows)
            codes[rows] = self._reach.codes(contacts, com, velocity, chosen, batch.com[rows], batch.com_velocity[rows])
        self.rejected += np.bincount(codes, minlength=len(Reason))
        self.rejected[0] = 0
        later: list[Edge[bytes]] = []
        if self._second is not None and not pending and (self._haste is None or (codes != 0).all()):
            doubtful = candidates.select(codes == Reason.DYNAMICS)
            later = self._postpone(row, doubtful, self._config.doubt) if len(doubtful) else []
        kept = np.flatnonzero(codes == 0)
        if not len(kept):
            return later
        candidates, objective = candidates.select(kept), batch.objective[kept]
        cost = self._config.dynamics * objective
        if not pending:
            cost = cost + self._known_cost(candidates)
        end, end_velocity = batch.com[kept], batch.com_velocity[kept]
        states = pack(candidates.contacts, candidates.limb, end, end_velocity)
        payloads = zip(objective.tolist(), candidates.timing.tolist(), strict=True)
        delay = (
            np.zeros(len(kept)) if self._haste is None else self._haste.delay(candidates.contacts, end, end_velocity)
        )
        return [Edge(*item) for item in zip(states, cost.tolist(), payloads, delay.tolist(), strict=True)] + later

    def _postpone(self, row: np.ndarray, candidates: Candidates, doubt: float = 0.0) -> list[Edge[bytes]]:
        """Edges to pending states, with the known part of the cost."""
        com, velocity = row[COM] / 1000.0, row[VELOCITY] / 1000.0
        miss = self._drift.miss(row[CONTACTS], com, velocity, candidates)
        states = pack_pending(row, candidates.contacts, candidates.limb, candidates.timing)
        cost, delay = self._known_cost(candidates), doubt + self._config.miss * miss
        if self._haste is not None:
            delay = delay + self._haste.delay(row[None, CONTACTS], com[None], velocity[None])
        return [Edge(*item) for item in zip(states, cost.tolist(), [None] * len(states), delay.tolist(), strict=True)]

    def _pending(self, row: np.ndarray) -> Candidates:
        """The one candidate of a pending state."""
        limb, after = row[LAST : LAST + 1], row[None, CONTACTS]
        centre, yaw = self.feet(after)
        way = np.hypot(*(centre - self.feet(_before(row)[None, CONTACTS])[0])[:, :2].T)
        return Candidates(limb, after[:, limb[0]], after, centre, yaw, way, row[TIMING : TIMING + 1])

    def _final_cost(self, candidates: Candidates) -> np.ndarray:
        """(n,) extra cost of ending on a stance with one foot ahead, zero where the goal is not reached."""
        at_goal = self._at_goal(candidates.centre)
        if not at_goal.any():
            return np.zeros(len(at_goal))
        apart = self._table.position[candidates.contacts[:, 0]] - self._table.position[candidates.contacts[:, 1]]
        ahead = np.abs(np.cos(candidates.yaw) * apart[:, 0] + np.sin(candidates.yaw) * apart[:, 1])
        return np.where(at_goal, self._config.stagger * ahead, 0.0)


def _before(row: np.ndarray) -> np.ndarray:
    """The row of a state, or of the one that a pending state comes from (its last limb apart)."""
    if len(row) <= OLD:
        return row
    before = row.copy()
    before[CONTACTS][row[LAST]] = row[OLD]
    return before
