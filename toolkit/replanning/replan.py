"""ReplanProblem: the centroidal problem of the next contacts, from the measured state.

Its dynamics, cones and limits are those of `toolkit.centroidal`, about the contacts where they are. Its objective is
the distance from the plan. The solver starts at the plan and takes the limits of the body to first order from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.program import Landing, Layout, contact_block, indices, single_bounds, slack_prices
from toolkit.centroidal.stages.blocks import Block
from toolkit.centroidal.stages.method import Blocks, Options, Prices, Work, minimise
from toolkit.centroidal.stages.rows import FINAL_ROWS
from toolkit.centroidal.stages.steps import ANGULAR_RATE, STATE, WRENCH, Steps
from toolkit.control.corrector import PENDULUM_RATE, Cones
from toolkit.replanning.landing import Landings
from toolkit.replanning.nominal import HORIZON, Nominal
from toolkit.replanning.plan_rows import PlanRows
from toolkit.replanning.situation import HorizonContacts, Situation
from toolkit.replanning.tracking import SPIN_RATE, Tracking
from toolkit.replanning.window import Window
from toolkit.robot.model import RobotModel
from toolkit.world.surface import Surface

MOVABLE = 2  # contacts to be made whose places are free, at most
DEADBAND = 0.01  # m; divergence that the controller's gains settle, where every foot is as near to its planned place
SLACK = 0.25  # price per s of taking back the body's margins: a small excess is better than a fall
CONES = 2000.0  # price of leaving the controller's cones, in multiples of `SLACK`
MOST = 3.0  # weights; largest normal force
OPTIONS = Options(False, iterations=20, tolerance=1e-2, feasible=1e-3, gap=1e-3, least=1e-5, small=0.1, linear=True)

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
        self._rows = PlanRows.of(nominal.problem, robot)

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
        nominal = self._nominal
        window = Window.of(nominal, situation.time, HORIZON)
        contacts = HorizonContacts.of(nominal, situation, window.first, window.times, early)
        events = self._free_landings(situation, window, movable)
        planes = [self._landings.contacts[event].pose.rotation[:, :2] for event in events]
        landings = [self._landing(event, window) for event in events]
        layout = Layout.of(contacts.active, [item.step for item in landings] if events else None)
        step, limb = np.nonzero(contacts.active)
        span, dt = slice(window.first, window.last), window.dt
        wrench, planned = indices(layout.wrench[step, limb], WRENCH), nominal.wrench[span][step, limb]
        states = np.column_stack([window.com, window.velocity, window.wrench_spin])
        goal = [plane.T @ situation.goal.get(event, np.zeros(3)) for event, plane in zip(events, planes, strict=True)]
        goal = np.reshape(goal, (-1, 2))
        track = Tracking(layout, dt, states, planned, nominal.share[span], contacts, landings, events, planes)
        price = SLACK * dt

        y = np.zeros((len(dt) + 1, int(layout.size.max())))
        y[:, :9] = states
        y[0, :9] += self._deviation(window, situation)
        y[step[:, None], wrench] = planned
        # Slacks start where their prices balance the barrier.
        y[step[:, None], wrench[:, -1:] + [1, 2]] = OPTIONS.gap / price[step, None]
        y[np.arange(len(dt) + 1), layout.slack[:, 1]] = OPTIONS.gap / np.append(price, price[-1])
        y[np.arange(len(dt)), layout.slack[:-1, 0]] = OPTIONS.gap / (CONES * price)
        for item, place in zip(landings, goal, strict=True):
            y[item.step, layout.landing[item.step] + np.arange(2)] = place
            y[item.step + 1 :, layout.pair(item.limb)] = place
        blocks = Blocks(
            self._cones(layout, contacts, situation.cones, price),
            *self._rows.blocks(layout, window.first, dt, contacts),
            Block.of(np.zeros(0), np.zeros((0, STATE), int), np.zeros((0, 0)), FINAL_ROWS),
            self._bounds(layout, contacts, landings, events, situation, early),
        )
        steps = self._steps(layout, window, contacts, landings)
        prices = Prices.joined([slack_prices(layout, price, CONES), track.prices(goal)])
        work = Work.of(len(dt) + 1, layout.states, y.shape[1])
        _, _, objective = minimise(steps, prices, track.squares(), blocks, layout.size, y, work, OPTIONS)
        if not (np.isfinite(objective) and np.isfinite(y).all()):
            return None
        excess = (np.append(price, price[-1]) * np.maximum(y[np.arange(len(dt) + 1), layout.slack[:, 1]], 0.0)).sum()
        found = np.zeros((len(dt), 4, 6))
        found[step, limb] = y[step[:, None], wrench]
        shifts = [y[item.step, layout.landing[item.step] + np.arange(2)] for item in landings]
        ends = [nominal.swings[event].end for event in self._landings.contacts]
        next_end = min((end for end in ends if end > situation.time), default=np.inf)
        times, off = window.times, y[:, :9] - states
        rates = np.diff(off, axis=0) / dt[:, None]
        return Replan(
            times=times,
            com=off[:, :3],
            velocity=off[:, 3:6],
            spin=off[:, 6:],
            acceleration=rates[:, 3:6],
            spin_rate=rates[:, 6:],
            wrench=found,
            landing={event: plane @ shift for event, plane, shift in zip(events, planes, shifts, strict=True)},
            ends=early,
            objective=float(objective) + EARLY * sum(nominal.swings[k].end - t for k, t in early.items()),
            excess=float(excess),
            divergence=np.linalg.norm(off[:, :3] + off[:, 3:6] / PENDULUM_RATE, axis=1),
            next_landing=int(np.searchsorted(times, next_end) if next_end < times[-1] else len(dt)),
        )

    def _deviation(self, window: Window, situation: Situation) -> np.ndarray:
        """The measured deviation (9,) from the plan, less a deadband that needs no reaction."""
        com = situation.com - window.com[0] - situation.com_shift
        velocity = situation.velocity - window.velocity[0]
        divergence = float(np.linalg.norm(com + velocity / PENDULUM_RATE))
        off = np.concatenate([com, velocity, situation.spin - window.spin[0]])
        off *= max(1.0 - DEADBAND / max(divergence, 1e-9), 0.0)
        off[:3] += situation.com_shift
        return off

    def _landing(self, event: int, window: Window) -> Landing:
        """A landing point that may move: it is chosen as the swing begins, or now."""
        swing = self._nominal.swings[event]
        step = max(int(np.searchsorted(window.times, swing.start + 1e-6, side="right")) - 1, 0)
        return Landing(swing.limb, step, np.full(2, -np.inf), np.full(2, np.inf))

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

    def _steps(self, layout: Layout, window: Window, contacts: HorizonContacts, landings: list[Landing]) -> Steps:
        """Dynamics of the steps, and the price of the rate of the angular momentum."""
        dt, (step, limb) = window.dt, np.nonzero(contacts.active)
        weights = np.zeros((len(dt), 6))
        weights[:, ANGULAR_RATE] = SPIN_RATE * dt
        return Steps(
            dt=dt,
            first=np.searchsorted(step, np.arange(len(dt) + 1)),
            wrench=layout.wrench[step, limb],
            pair=layout.displaced(limb),
            rotation=contacts.rotation[step, limb],
            position=(contacts.position + contacts.shift)[step, limb],
            weights=weights,
            height=np.zeros(len(dt)),
            source=layout.sources(landings),
            turning=np.diff(window.wrench_spin, axis=0) / dt[:, None],
        )

    def _cones(self, layout: Layout, contacts: HorizonContacts, cones: Cones, price: np.ndarray) -> Block:
        """The controller's cones, which no slack but the excess widens."""
        step, limb = np.nonzero(contacts.active)
        margins = np.tile([cones.friction, 0.0, 0.0, cones.yaw], (len(step), 2))
        mu, free = contacts.friction[step, limb], np.zeros((len(step), 7))
        return contact_block(
            layout, contacts.active, np.column_stack([mu, cones.half_size[limb], margins, free, price[step]])
        )

    def _bounds(
        self,
        layout: Layout,
        contacts: HorizonContacts,
        landings: list[Landing],
        events: list[int],
        situation: Situation,
        early: dict[int, float],
    ) -> Block:
        """Bounds of single variables, and of landing points."""
        stage, variables, parameters = single_bounds(layout, contacts.active, np.full(4, MOST))
        if not landings:
            return Block.of(stage, variables, parameters, 1)
        parts = [(stage, variables.repeat(2, 1), np.insert(parameters, 1, 0.0, axis=1))]
        for item, event in zip(landings, events, strict=True):
            end = early.get(event, self._nominal.swings[event].end)
            region, room = self._landings.region(event, situation, end)
            places = np.tile(layout.landing[item.step] + np.arange(2), (len(region), 1))
            parts.append((np.full(len(region), item.step), places, np.column_stack([-region, -room])))
        return Block.of(*(np.concatenate(part) for part in zip(*parts, strict=True)), 1)
