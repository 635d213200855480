"""ReplanProgram: the centroidal program of a replan.

Its dynamics, cones and limits are those of `toolkit.centroidal`, about the contacts where they are. Its objective is
the distance from the plan. The solver starts at the plan and takes the limits of the body to first order from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.layout import (
    Layout,
    contact_block,
    indices,
    side_by_side,
    single_bounds,
    slack_prices,
    start_slacks,
)
from toolkit.centroidal.stages.blocks import Block
from toolkit.centroidal.stages.method import Blocks, Options, Prices, Work, minimise
from toolkit.centroidal.stages.rows import FINAL_ROWS
from toolkit.centroidal.stages.steps import ANGULAR_RATE, STATE, WRENCH, Steps
from toolkit.control.corrector import Cones
from toolkit.replanning.landing import FreeLandings
from toolkit.replanning.nominal import Nominal
from toolkit.replanning.plan_rows import PlanRows
from toolkit.replanning.situation import HorizonContacts
from toolkit.replanning.tracking import SPIN_RATE, Tracking
from toolkit.replanning.window import Window

# Price per s, for a body of the usual size (`toolkit.robot.scale`), of taking back the body's margins: a small excess
# is better than a fall.
SLACK = 2.0
CONES = 5000.0  # price of leaving the controller's cones, in multiples of `SLACK`
MOST = 3.0  # weights; largest normal force
OPTIONS = Options(False, iterations=25, tolerance=1e-2, feasible=1e-3, gap=3e-4, least=1e-5, small=0.1, linear=True)
"""The start is near the solution and near the central path, so few iterations suffice: about three.

The gap is far below what a short first step costs: a wrong force in it would hardly show in the objective.
"""


@dataclass(frozen=True)
class ReplanProgram:
    """One program of N steps.

    Attributes:
        window: The plan at the knots.
        contacts: The contacts in the steps.
        free: Landing points that may move.
        cones: What the controller allows.
        layout: Where the variables are.
        track: The prices for leaving the plan.
        limits: Limits of legs, torques, distances and heights.
    """

    window: Window
    contacts: HorizonContacts
    free: FreeLandings
    cones: Cones
    layout: Layout
    track: Tracking
    limits: tuple[Block, Block, Block, Block]

    @classmethod
    def of(
        cls,
        nominal: Nominal,
        rows: PlanRows,
        window: Window,
        contacts: HorizonContacts,
        free: FreeLandings,
        cones: Cones,
    ) -> ReplanProgram:
        """The program of a window of a plan with these contacts."""
        layout = Layout.of(contacts.active, [item.step for item in free.items] if free.items else None)
        span, (step, limb) = slice(window.first, window.last), np.nonzero(contacts.active)
        states = np.column_stack([window.com, window.velocity, window.wrench_spin])
        wrench = nominal.wrench[span][step, limb]
        track = Tracking(layout, window.dt, states, wrench, nominal.share[span], contacts, free, nominal.scale)
        limits = rows.blocks(layout, window.first, window.dt, contacts)
        return cls(window, contacts, free, cones, layout, track, limits)

    def solve(self, deviation: np.ndarray) -> tuple[np.ndarray, float] | None:
        """Variables (N + 1, m) and objective of the best motion; None where there is none.

        The first state is the plan's with a deviation (9,) of CoM, velocity and angular momentum per mass.
        """
        y = self._guess()
        y[0, :9] += deviation
        final = Block.of(np.zeros(0), np.zeros((0, STATE), int), np.zeros((0, 0)), FINAL_ROWS)
        blocks = Blocks(self._cones(), *self.limits, final, self._bounds())
        prices = Prices.joined([slack_prices(self.layout, self._price, CONES), self.track.prices()])
        work = Work.of(len(y), self.layout.states, y.shape[1])
        given = self._steps(), prices, self.track.squares(), blocks, self.layout.size, y, work, OPTIONS
        _, _, objective = minimise(*given)
        return (y, float(objective)) if np.isfinite(objective) and np.isfinite(y).all() else None

    def excess(self, y: np.ndarray) -> float:
        """What the body's margins that variables y take back cost."""
        price, slack = self._price, y[np.arange(len(y)), self.layout.slack[:, 1]]
        return float(np.append(price, price[-1]) @ np.maximum(slack, 0.0))

    @property
    def _price(self) -> np.ndarray:
        """(N,) prices of slacks in the steps."""
        return SLACK * self.track.usual_dt

    def _guess(self) -> np.ndarray:
        """The plan (N + 1, m); slacks start where their prices balance the barrier."""
        layout, price, (step, limb) = self.layout, self._price, np.nonzero(self.contacts.active)
        y = np.zeros((len(price) + 1, int(layout.size.max())))
        y[:, :9] = self.track.states
        y[step[:, None], indices(layout.wrench[step, limb], WRENCH)] = self.track.wrench
        start_slacks(y, layout, self.contacts.active, price, CONES, OPTIONS.gap)
        for item, place in zip(self.free.items, self.free.goal, strict=True):
            y[item.step, layout.chosen(item)] = place
            y[item.step + 1 :, layout.pair(item.limb)] = place
        return y

    def _steps(self) -> Steps:
        """Dynamics of the steps, and the price of the rate of the angular momentum."""
        contacts, layout, dt = self.contacts, self.layout, self.window.dt
        step, limb = np.nonzero(contacts.active)
        weights = np.zeros((len(dt), 6))
        weights[:, ANGULAR_RATE] = SPIN_RATE * self.track.usual_dt / self.track.scale.length**2
        return Steps(
            dt=dt,
            first=np.searchsorted(step, np.arange(len(dt) + 1)),
            wrench=layout.wrench[step, limb],
            pair=layout.displaced(limb),
            rotation=contacts.rotation[step, limb],
            position=(contacts.position + contacts.shift)[step, limb],
            weights=weights,
            height=np.zeros(len(dt)),
            source=layout.sources(self.free.items),
            turning=np.diff(self.window.wrench_spin, axis=0) / dt[:, None],
        )

    def _cones(self) -> Block:
        """The controller's cones, which no slack but the excess widens."""
        contacts, cones = self.contacts, self.cones
        step, limb = np.nonzero(contacts.active)
        margins, unpriced = [cones.friction, 0.0, 0.0, cones.yaw], np.zeros(7)
        patch = contacts.friction[step, limb, None], cones.within(contacts.half_size[step, limb])
        parameters = side_by_side(len(step), *patch, margins, margins, unpriced, self._price[step, None])
        return contact_block(self.layout, contacts.active, parameters)

    def _bounds(self) -> Block:
        """Bounds of single variables, and of landing points."""
        stage, variables, parameters = single_bounds(self.layout, self.contacts.active, np.full(4, MOST))
        if not self.free.items:
            return Block.of(stage, variables, parameters, 1)
        parts = [(stage, variables.repeat(2, 1), np.insert(parameters, 1, 0.0, axis=1))]
        for item, (rows, room) in zip(self.free.items, self.free.regions, strict=True):
            places = np.tile(self.layout.chosen(item), (len(rows), 1))
            parts.append((np.full(len(rows), item.step), places, np.column_stack([-rows, -room])))
        return Block.of(*(np.concatenate(part) for part in zip(*parts, strict=True)), rows=1)
