"""The contact search as a graph for ANA*: states, the transitions out of them, and what these cost (paper, Sec. V)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search import screen
from toolkit.search.ana_star import Edge
from toolkit.search.contact_table import ContactTable
from toolkit.search.exclusion import Exclusion, excluded
from toolkit.search.heuristic import Distance
from toolkit.search.legs import stances_violated
from toolkit.search.moves import MoveGenerator
from toolkit.search.state import COM, CONTACTS, LAST, VELOCITY, pack, unpack
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

_LIMBS = tuple(Limb)
_CROWD = 0.1  # m


@dataclass(frozen=True)
class CostConfig:
    """Edge cost d + step + dynamics * objective (+ time * duration), and the limits that hold on edges.

    Attributes:
        step: w_s of the paper.
        dynamics: w_dyn of the paper.
        time: per s; counts only where the planner may choose between timings, lest slower always look better.
        stagger: per m that one foot is ahead of the other in the final stance.
        swing_speed: m/s; a foot may not have to fly faster on average.
        com_drops: m; the predicted CoM may be lower by any of these for the legs to reach.
        lift_off: parts of the shift time at whose CoM the legs may reach at lift-off, since when the CoM moves is the
            optimiser's choice.
        arm_slack: m; an arm may reach further by this much, since the torso can lean.
    """

    step: float = 3.0
    dynamics: float = 0.1
    time: float = 5.0
    stagger: float = 5.0
    swing_speed: float = 4.0
    com_drops: tuple[float, ...] = (0.0, 0.03, 0.06, 0.1)
    lift_off: tuple[float, ...] = (1.0, 0.5)
    arm_slack: float = 0.03


@dataclass(frozen=True)
class _Candidates:
    """Transitions out of one state.

    Attributes:
        limb: (n,) int.
        number: (n,) int; new contact, -1 where a palm breaks.
        contacts: (n, 4) int; contact numbers afterwards.
        centre: (n, 3) m; mean of the feet afterwards.
        yaw: (n,) rad; its heading.
        cost: (n,) known part of the edge cost.
    """

    limb: np.ndarray
    number: np.ndarray
    contacts: np.ndarray
    centre: np.ndarray
    yaw: np.ndarray
    cost: np.ndarray

    def select(self, rows: np.ndarray) -> _Candidates:
        return _Candidates(
            self.limb[rows], self.number[rows], self.contacts[rows], self.centre[rows], self.yaw[rows], self.cost[rows]
        )


class ContactProblem:
    """Graph of one search; see `toolkit.search.ana_star.SearchProblem`. Edge payloads are (objective, timing index).

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
        palms: whether palms may be used.
        config: costs.
        exclusions: transitions that later stages rejected.

    Attributes:
        rejected: (len(REASONS),) int; candidates that fell, by reason.
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
        exclusions: Sequence[Exclusion] = (),
    ):
        self._robot, self._moves, self._table = robot, moves, table
        self._evaluator, self._distance, self._goal = evaluator, distance, goal
        self._timings, self._config, self._exclusions = timings, config, exclusions
        self._palms = [limb for limb in PALMS if palms and limb in robot.arms and moves.has_palm_surfaces]
        self._longest = longest
        numbers = np.full((1, 4), -1)
        for contact in start.contacts:
            numbers[0, contact.limb] = table.add_contact(contact)
        self._start = pack(numbers, np.array([-1]), com[None], np.zeros((1, 3)))[0]
        self._drops = np.array(config.com_drops)
        self.rejected = np.zeros(len(screen.REASONS), np.int64)
        self.deadline = np.inf
        self._pace = 0.0  # s per transition of the last query

    def start(self) -> bytes:
        """See `SearchProblem`."""
        return self._start

    def stance(self, state: bytes) -> Stance:
        """Stance of a state."""
        return self._stance(unpack([state])[0])

    def _stance(self, row: np.ndarray) -> Stance:
        return Stance(tuple(self._table.contact(int(number)) for number in row[CONTACTS] if number >= 0))

    def transition(self, state: bytes, payload: tuple[float, int]) -> ContactTransition:
        """The transition that led to a state over an edge with this payload."""
        row = unpack([state])[0]
        limb = Limb(int(row[LAST]))
        number = int(row[CONTACTS][limb])
        contact = self._table.contact(number) if number >= 0 else None
        return ContactTransition(limb, contact, self._timings[payload[1]])

    def feet(self, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean of the feet (n, 3) m and its heading (n,) rad of contact numbers (n, 4)."""
        table, left, right = self._table, contacts[:, 0], contacts[:, 1]
        a, b = table.yaw[left], table.yaw[right]
        yaw = np.arctan2(np.sin(a) + np.sin(b), np.cos(a) + np.cos(b))
        return (table.position[left] + table.position[right]) / 2, yaw

    def heuristic(self, states: Sequence[bytes]) -> np.ndarray:
        """See `SearchProblem`; Eq. 5 of the paper, with at least one transition where the goal is not reached."""
        return self._to_go(*self.feet(unpack(states)[:, CONTACTS]))

    def _to_go(self, centre: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        distance = self._distance(centre, yaw)
        transitions = np.maximum(distance / self._longest, ~self._at_goal(centre))
        return distance + self._config.step * transitions

    def is_goal(self, states: Sequence[bytes]) -> np.ndarray:
        """See `SearchProblem`."""
        return self._at_goal(self.feet(unpack(states)[:, CONTACTS])[0])

    def _at_goal(self, centre: np.ndarray) -> np.ndarray:
        return np.hypot(*(centre[:, :2] - self._goal.position[:2]).T) <= self._goal.radius

    def crowd(self, states: Sequence[bytes]) -> list[tuple[int, int]]:
        """See `SearchProblem`: states with the mean of the feet in the same square of 0.1 m."""
        centre = self.feet(unpack(states)[:, CONTACTS])[0]
        return list(map(tuple, np.floor(centre[:, :2] / _CROWD).astype(int).tolist()))

    def expand(self, state: bytes, slack: float) -> list[Edge[bytes]] | None:
        """See `SearchProblem`: screens, then one query of the evaluator for all children together."""
        row = unpack([state])[0]
        candidates = self._candidates(row)
        if candidates is None:
            return []
        promising = candidates.cost + self._to_go(candidates.centre, candidates.yaw) < slack
        self.rejected[screen.COSTLY] += len(promising) - int(promising.sum())
        candidates = candidates.select(promising)
        if not len(candidates.limb):
            return []
        com, velocity = row[COM] / 1000.0, row[VELOCITY] / 1000.0
        chosen, timing = self._times(row, candidates)
        candidates = candidates.select(chosen)
        if not len(chosen):
            return []
        stance = self._stance(row)
        transitions = [
            ContactTransition(_LIMBS[limb], self._table.contact(number) if number >= 0 else None, self._timings[choice])
            for limb, number, choice in zip(
                candidates.limb.tolist(), candidates.number.tolist(), timing.tolist(), strict=True
            )
        ]
        began = time.perf_counter()
        if began + self._pace * len(transitions) > self.deadline:
            return None
        batch = self._evaluator.evaluate(stance, com, velocity, transitions)
        self._pace = (time.perf_counter() - began) / len(transitions)
        codes = np.where(batch.feasible, 0, screen.DYNAMICS)
        rows = np.flatnonzero(batch.feasible)
        if len(rows):
            codes[rows] = self._reach_codes(row, com, velocity, candidates.select(rows), batch, rows, timing[rows])
        self.rejected += np.bincount(codes, minlength=len(screen.REASONS))
        self.rejected[0] = 0
        kept = np.flatnonzero(codes == 0)
        if not len(kept):
            return []
        candidates, objective, timing = candidates.select(kept), batch.objective[kept], timing[kept]
        cost = candidates.cost + self._config.dynamics * objective
        if len(self._timings) > 1:
            durations = np.array([item.shift + item.swing for item in self._timings])
            cost = cost + self._config.time * durations[timing]
        cost = cost + self._final_cost(candidates)
        states = pack(candidates.contacts, candidates.limb, batch.com[kept], batch.com_velocity[kept])
        payloads = zip(objective.tolist(), timing.tolist(), strict=True)
        return [Edge(*item) for item in zip(states, cost.tolist(), payloads, strict=True)]

    def _candidates(self, row: np.ndarray) -> _Candidates | None:
        """All transitions that pass the screens, dynamics apart."""
        contacts, last = row[CONTACTS], int(row[LAST])
        limbs: list[np.ndarray] = []
        numbers: list[np.ndarray] = []
        for foot in FEET:
            if foot == last:
                continue
            old, standing = int(contacts[foot]), int(contacts[foot.mirrored])
            moves = self._moves.steps(foot, standing)
            self.rejected += moves.rejected
            if len(moves.numbers):
                longest = self._config.swing_speed * max(timing.swing for timing in self._timings)
                codes = self._moves.swings(foot, moves.numbers, old, standing, longest)
                self.rejected += np.bincount(codes, minlength=len(screen.REASONS))
                limbs.append(np.full(int((codes == 0).sum()), foot))
                numbers.append(moves.numbers[codes == 0])
        for palm in self._palms:
            if palm == last:
                continue
            moves = self._moves.palms(palm, int(contacts[0]), int(contacts[1]))
            self.rejected += moves.rejected
            places = moves.numbers[moves.numbers != contacts[palm]]
            if contacts[palm] >= 0:
                places = np.append(places, -1)
            limbs.append(np.full(len(places), palm))
            numbers.append(places)
        limb = np.concatenate(limbs) if limbs else np.zeros(0, int)
        n = len(limb)
        if n == 0:
            return None
        number = np.concatenate(numbers)
        after = np.repeat(contacts[None], n, axis=0)
        after[np.arange(n), limb] = number
        if self._exclusions:
            position = np.vstack([self._table.position, np.full(3, np.nan)])  # number -1: no contact
            allowed = ~excluded(self._exclusions, position[contacts], limb, position[number])
            self.rejected[screen.EXCLUDED] += n - int(allowed.sum())
            limb, number, after, n = limb[allowed], number[allowed], after[allowed], int(allowed.sum())
            if n == 0:
                return None
        centre, yaw = self.feet(after)
        before = self.feet(contacts[None])[0][0]
        cost = np.hypot(*(centre[:, :2] - before[:2]).T) + self._config.step
        return _Candidates(limb, number, after, centre, yaw, cost)

    def _times(self, row: np.ndarray, candidates: _Candidates) -> tuple[np.ndarray, np.ndarray]:
        """Indices of candidates and of timings: each candidate once for every timing that its swing allows."""
        n, count = len(candidates.limb), len(self._timings)
        if count == 1:  # the speed was screened
            return np.arange(n), np.zeros(n, int)
        table, old = self._table, row[CONTACTS][candidates.limb]
        way = np.hypot(*(table.position[candidates.number] - table.position[old])[:, :2].T)
        way[(candidates.limb > Limb.RIGHT_FOOT) | (candidates.number < 0)] = 0.0
        swing = np.array([timing.swing for timing in self._timings])
        chosen, timing = np.nonzero(way[:, None] <= self._config.swing_speed * swing)
        return chosen, timing

    def _reach_codes(
        self,
        row: np.ndarray,
        com: np.ndarray,
        velocity: np.ndarray,
        candidates: _Candidates,
        batch: TransitionBatch,
        rows: np.ndarray,
        timing: np.ndarray,
    ) -> np.ndarray:
        """Codes (n,) of candidates by what legs and arms reach with the CoM at lift-off and after touch-down."""
        table, after = self._table, candidates.contacts
        end, end_velocity = batch.com[rows], batch.com_velocity[rows]
        n = len(rows)
        codes = np.zeros(n, np.int64)
        # Touch-down: the new stance under the predicted CoM.
        broken = self._legs(end, candidates.yaw, after[:, 0], after[:, 1])
        codes[broken >= 0] = screen.LEG + broken[broken >= 0]
        # Lift-off: the old stance under the CoM at the end of the shift, on the cubic between the known ends.
        shift = np.array([item.shift for item in self._timings])[timing]
        total = shift + np.array([item.swing for item in self._timings])[timing]
        feet = row[CONTACTS]
        yaw, left, right = np.full(n, self.feet(feet[None])[1][0]), np.full(n, feet[0]), np.full(n, feet[1])
        broken = np.full(n, 0)
        for lag in self._config.lift_off:
            lift = _cubic(com, velocity, end, end_velocity, lag * shift / total, total)
            broken = np.where(broken >= 0, self._legs(lift, yaw, left, right), -1)
        codes[broken >= 0] = screen.LEG + broken[broken >= 0]
        for palm in self._palms:
            held = np.flatnonzero(after[:, palm] >= 0)
            if len(held):
                arm = self._robot.arms[palm]
                c, s = np.cos(candidates.yaw[held]), np.sin(candidates.yaw[held])
                x, y, z = arm.shoulder_in_com
                shoulder = end[held] + np.stack([c * x - s * y, s * x + c * y, np.full(len(held), z)], axis=-1)
                distance = np.linalg.norm(table.position[after[held, palm]] - shoulder, axis=1)
                slack = self._config.arm_slack
                codes[held[(distance < arm.min_reach - slack) | (distance > arm.max_reach + slack)]] = screen.ARM
        return codes

    def _legs(self, com: np.ndarray, yaw: np.ndarray, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        table = self._table
        return stances_violated(
            self._moves.legs,
            com,
            self._drops,
            yaw,
            table.position[left],
            table.rotation[left],
            table.position[right],
            table.rotation[right],
        )

    def _final_cost(self, candidates: _Candidates) -> np.ndarray:
        """(n,) extra cost of ending on a stance with one foot ahead, zero where the goal is not reached."""
        at_goal = self._at_goal(candidates.centre)
        if not at_goal.any():
            return np.zeros(len(at_goal))
        apart = self._table.position[candidates.contacts[:, 0]] - self._table.position[candidates.contacts[:, 1]]
        ahead = np.abs(np.cos(candidates.yaw) * apart[:, 0] + np.sin(candidates.yaw) * apart[:, 1])
        return np.where(at_goal, self._config.stagger * ahead, 0.0)


def _cubic(
    start: np.ndarray, velocity: np.ndarray, end: np.ndarray, end_velocity: np.ndarray, s: np.ndarray, time: np.ndarray
) -> np.ndarray:
    """Points (n, 3) at the part s (n,) of Hermite cubics of duration `time` (n,) between positions and velocities."""
    s, time = s[:, None], time[:, None]
    rise = s * s * (3.0 - 2.0 * s)
    return (
        start * (1.0 - rise)
        + end * rise
        + velocity * time * s * (1.0 - s) ** 2
        - end_velocity * time * s * s * (1.0 - s)
    )
