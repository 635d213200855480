"""ReplanProblem: the quadratic program of a replan.

The states are deviations from the plan: of the CoM, of its velocity, of the angular momentum per mass about a fixed
point near it, and of the spin (about the CoM) at the knot before. Each free landing point adds two shifts along its
plane. The wrenches are deviations too, in weights. The dynamics are those of `toolkit.centroidal.problem`, exact but
for the product of a landing's shift with the change of its force. The limits of the body are linear about the plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.control.corrector import PENDULUM_RATE, Cones
from toolkit.physics.wrench import friction_rows, sole_rows
from toolkit.replanning.kernel import Program, solve
from toolkit.replanning.knot_costs import knot_costs
from toolkit.replanning.landing import Landings
from toolkit.replanning.linear_motion import Dynamics, FreeLandings, Window
from toolkit.replanning.nominal import BODY, HORIZON, Nominal
from toolkit.replanning.situation import HorizonContacts, Situation
from toolkit.replanning.sweep import GIVEN
from toolkit.robot.model import RobotModel
from toolkit.world.surface import Surface

MOVABLE = 2  # contacts to be made whose places are free, at most
DEADBAND = 0.01  # m; divergence that the controller's gains settle, where every foot is as near to its planned place
SIDES = 8
ROWS = SIDES + 12 + 10 + 1
PRICE = 10.0  # price of exceeding the body's limits, per m or rad: a small excess is better than a fall
HARD = 1e4  # price of a landing point outside its region, per m
SOFTNESS = 0.05  # m or rad; excess by which a price doubles
ROOM = 1e-3  # least distance of the plan's own wrenches to their rows
FORCE, MOMENT = 1.0, 5.0  # costs per s of the wrenches' squared deviations in weights and weights times 1 m
PALM_MOMENT = 1e3  # cost that keeps a palm's moments as planned: the controller gives palms none
MAX_ITERATIONS, TOLERANCE = 25, 1e-6  # limits of the solver

# Landing points stay where they are planned while the divergence left when the next foot lands is at most SETTLED m
# and the body's limits exceeded on the way cost at most EXCESS: the controller's gains suffice for that.
SETTLED, EXCESS = 0.01, 0.02
# Swings end early only where the objective exceeds EARLY_OBJECTIVE and falls by EARLY_GAIN; 1 s earlier costs EARLY.
EARLY_OBJECTIVE, EARLY_GAIN, EARLY = 0.3, 0.3, 3.0


@dataclass(frozen=True)
class Replan:
    """A replanned motion at N + 1 knots, as its deviation from the plan; world frame, SI units.

    Attributes:
        times: (N + 1,) s.
        com, velocity, spin, acceleration, spin_rate: Each (N + 1, 3), but (N, 3) for the last two.
        wrench: (N, 4, 6) whole wrenches in the contact frames, in weights.
        landing: By swing, the shift (3,) of its contact in m.
        ends: By swing, its end in s where that is before its planned end.
        objective, excess: The objective reached, and its part for exceeded limits of the body.
        divergence: (N + 1,) m from the plan.
        next_landing: Knot at which the next foot lands; the last one where none does.
    """

    times: np.ndarray
    com: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    acceleration: np.ndarray
    spin_rate: np.ndarray
    wrench: np.ndarray
    landing: dict[int, np.ndarray]
    ends: dict[int, float]
    objective: float
    excess: float
    divergence: np.ndarray
    next_landing: int


class ReplanProblem:
    """Builds and solves the programs of one run."""

    def __init__(self, nominal: Nominal, robot: RobotModel, surfaces: tuple[Surface, ...]):
        self._nominal = nominal
        self._landings = Landings(nominal.swings, robot.half_sizes, surfaces)
        self._cone_rows: dict[tuple, np.ndarray] = {}
        self._size = GIVEN + 2 * MOVABLE

    def solve(self, situation: Situation) -> Replan | None:
        """The best motion from a measured state; None where the solver gives no answer.

        Landing points move only where the motion cannot return to the plan otherwise. Where even that is not enough,
        swings under way may also end earlier, at one of a few times.
        """
        if not situation.displaced:
            kept = self._solve(situation, {}, movable=0)
            # This suffices if the motion is back at the plan when the next foot lands.
            if kept and kept.divergence[kept.next_landing] <= SETTLED and kept.excess <= EXCESS:
                return kept
        swings = self._nominal.swings
        decided = {event: time for event, time in situation.landing.items() if time < swings[event].end - 1e-3}
        best = self._solve(situation, decided)
        if best is None or best.objective < EARLY_OBJECTIVE:
            return best
        for event, earliest in situation.earliest.items():
            for time in self._early_times(event, earliest):
                found = self._solve(situation, {event: time})
                if found is not None and found.objective < best.objective - EARLY_GAIN:
                    best = found
        return best

    def _early_times(self, event: int, earliest: float) -> np.ndarray:
        """The first, middle and last knot between the earliest end of a swing and its planned end."""
        knots = self._nominal.times
        knots = knots[(knots >= earliest - 1e-9) & (knots < self._nominal.swings[event].end - 1e-3)]
        return knots[np.unique([0, len(knots) // 2, len(knots) - 1])] if len(knots) else knots

    def _solve(self, situation: Situation, early: dict[int, float], movable: int = MOVABLE) -> Replan | None:
        """The best motion with given earlier ends of swings, and at most so many movable landing points."""
        nominal, size = self._nominal, self._size
        window = Window.of(nominal, situation.time, HORIZON)
        contacts = HorizonContacts.of(nominal, situation, window.first, window.times, early)
        events = self._free_landings(situation, window, movable)
        planes = [self._landings.contacts[event].pose.rotation[:, :2] for event in events]
        free = FreeLandings.of(events, planes, nominal, contacts)
        span = slice(window.first, window.last)
        dynamics = Dynamics.of(window, nominal.wrench[span], contacts, free, size)
        share = nominal.share[span]
        cost, slope, constant = knot_costs(window, free, contacts.shift, share, situation.goal, size)
        rows, bound = self._contact_rows(window, contacts, dynamics, situation.cones)
        knot, soft, soft_bound, price = self._soft_rows(window, contacts, free, situation, early)
        weight = np.empty((len(dynamics.step), 6))
        duration = window.dt[dynamics.step]
        weight[:, :3] = (FORCE * duration)[:, None]
        weight[:, 3:] = (np.where(dynamics.limb < 2, MOMENT, PALM_MOMENT) * duration)[:, None]
        program = Program(
            a=dynamics.a,
            b=dynamics.b,
            drift=dynamics.drift,
            cost=cost,
            slope=slope,
            first=dynamics.first,
            spread=dynamics.spread,
            weight=weight,
            rows=rows,
            bound=bound,
            knot=knot,
            soft_rows=soft,
            soft_bound=soft_bound,
            price=price,
            softness=SOFTNESS,
            start=self._start(window, situation),
        )
        u = np.zeros((len(dynamics.step), 6))
        guess = np.zeros(size - GIVEN)
        for index, (event, plane) in enumerate(zip(events, planes, strict=True)):
            guess[2 * index : 2 * index + 2] = plane.T @ situation.goal.get(event, np.zeros(3))
        x, _, residual, gap = solve(program, u, guess, MAX_ITERATIONS, TOLERANCE)
        if not (np.isfinite(x).all() and np.isfinite(u).all() and residual < 1e-3 and gap < 1e-3):
            return None
        excess = price * np.maximum(np.einsum("ki,ki->k", soft, x[knot]) - soft_bound, 0.0)
        objective = constant + 0.5 * np.einsum("ti,tij,tj", x, cost, x) + (slope * x).sum()
        objective += 0.5 * (weight * u * u).sum() + excess.sum()
        objective += EARLY * sum(nominal.swings[k].end - t for k, t in early.items())
        wrench = np.zeros((window.steps, 4, 6))
        wrench[dynamics.step, dynamics.limb] = dynamics.wrench + u
        ends = [nominal.swings[event].end for event in self._landings.contacts]
        next_end = min((end for end in ends if end > situation.time), default=np.inf)
        times, dt, spin = window.times, window.dt[:, None], window.spin_of(x)
        return Replan(
            times=times,
            com=x[:, :3],
            velocity=x[:, 3:6],
            spin=spin,
            acceleration=np.diff(x[:, 3:6], axis=0) / dt,
            spin_rate=np.diff(spin, axis=0) / dt,
            wrench=wrench,
            landing={event: planes[index] @ x[0, free.states(index)] for index, event in enumerate(events)},
            ends=early,
            objective=float(objective),
            excess=float(excess.sum()),
            divergence=np.linalg.norm(x[:, :3] + x[:, 3:6] / PENDULUM_RATE, axis=1),
            next_landing=int(np.searchsorted(times, next_end) if next_end < times[-1] else window.steps),
        )

    def _start(self, window: Window, situation: Situation) -> np.ndarray:
        """The measured deviation (12,) from the plan, less a deadband that needs no reaction."""
        start = window.deviation(situation)
        divergence = float(np.linalg.norm(start[:3] + start[3:6] / PENDULUM_RATE))
        start *= max(1.0 - DEADBAND / max(divergence, 1e-9), 0.0)
        start[:3] += situation.com_shift
        return start

    def _free_landings(self, situation: Situation, window: Window, most: int) -> list[int]:
        """Swings of feet whose landing point is free, the next ones first."""
        nominal = self._nominal
        standing = {event for event, _, _ in situation.standing.values()}
        free = []
        for event in self._landings.contacts:
            swing = nominal.swings[event]
            if event in standing or event in situation.fixed or swing.end <= situation.time:
                continue
            if swing.end >= nominal.times[window.last] - 1e-6 or len(free) == most:
                break
            free.append(event)
        return free

    def _contact_rows(self, window: Window, contacts: HorizonContacts, dynamics: Dynamics, cones: Cones):
        """Rows (C, ROWS, 6) and bounds (C, ROWS) of the wrenches' deviations."""
        step, limb = dynamics.step, dynamics.limb
        friction = contacts.friction[step, limb]
        rows, limit = np.zeros((len(step), ROWS, 6)), np.zeros((len(step), ROWS))
        for c in range(len(step)):
            rows[c, : SIDES + 12] = self._cone(int(limb[c]), float(friction[c]), cones)
            rows[c, -1, 2], limit[c, -1] = 1.0, 3.0
            if limb[c] < 2:
                torque = self._nominal.torque[window.first + step[c], limb[c]]
                rows[c, SIDES + 12 : -1] = np.concatenate([torque, -torque])
                limit[c, SIDES + 12 : -1] = BODY.torque
        return rows, np.maximum(limit - np.einsum("cri,ci->cr", rows, dynamics.wrench), ROOM)

    def _cone(self, limb: int, friction: float, cones: Cones) -> np.ndarray:
        """Rows (SIDES + 12, 6) of a contact's cone."""
        key = limb, friction, cones.friction, cones.yaw, float(cones.half_size[limb, 0])
        rows = self._cone_rows.get(key)
        if rows is None:
            rows = np.zeros((SIDES + 12, 6))
            if limb < 2:
                rows[:] = sole_rows(friction * cones.friction, cones.half_size[limb], cones.yaw, SIDES)
            else:
                rows[:SIDES, :3] = friction_rows(friction * cones.friction, SIDES)
            self._cone_rows[key] = rows
        return rows

    def _soft_rows(self, window: Window, contacts: HorizonContacts, free: FreeLandings, situation: Situation, early):
        """Knots, rows, bounds and prices of the body's limits after the first knot, then of the landing regions."""
        nominal, size, first = self._nominal, self._size, window.first
        table = nominal.rows
        begin, end = np.searchsorted(table.knot, [first + 1, window.last + 1])
        knot, limb = table.knot[begin:end] - first, table.limb[begin:end]
        gradient, clearance = table.gradient[begin:end], table.clearance[begin:end]
        rows = np.zeros((end - begin, size))
        rows[:, :3] = -gradient
        # The contact of the step before the knot or, where there is none, of the step after it.
        step = np.where(nominal.active[first + knot - 1, limb] | (knot >= window.steps), knot - 1, knot)
        contact = limb >= 0
        bound = clearance - np.where(contact, (gradient * contacts.shift[step, limb]).sum(1), 0.0)
        for index, plane in enumerate(free.planes):
            here = contact & (free.column[step, limb] == index)
            rows[here, free.states(index)] = gradient[here] @ plane
        blocks, bounds = [rows], [bound]
        for index, event in enumerate(free.events):
            end = early.get(event, nominal.swings[event].end)
            region, room = self._landings.region(event, situation, end)
            block = np.zeros((len(region), size))
            block[:, free.states(index)] = region
            blocks.append(block)
            bounds.append(room)
        landing = sum(len(block) for block in blocks[1:])
        price = np.concatenate([np.full(len(rows), PRICE), np.full(landing, HARD)])
        knot = np.concatenate([knot, np.zeros(landing, int)]).astype(np.int64)
        return knot, np.concatenate(blocks), np.concatenate(bounds), price
