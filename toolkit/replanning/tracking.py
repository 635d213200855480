"""What a replan pays for leaving the plan: prices of its states, wrenches and landing points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.layout import Layout, indices
from toolkit.centroidal.stages.method import Prices, Squares
from toolkit.centroidal.stages.steps import STATE, WRENCH
from toolkit.control.corrector import PENDULUM_RATE
from toolkit.geometry.limb import FEET
from toolkit.replanning.landing import FreeLandings
from toolkit.replanning.situation import HorizonContacts
from toolkit.robot.scale import Scale

# All are those of a body of the usual size (`toolkit.robot.scale`).
# Weights of the CoM per m^2 s, and of its velocity per m^2/s, horizontal and vertical (no landing point helps there).
COM, VELOCITY, CLIMB = 100.0, 2.5, 20.0
# Weights of the angular momentum per mass, per (m^2/s)^2 s, and of its rate. They are high since arms and trunk, which
# the controller keeps near their plan, follow little of it; landing points move instead.
SPIN, SPIN_RATE = 250.0, 20.0
FINAL = 1000.0  # per m^2 of divergence at the end of the horizon
FINAL_SPIN = 100.0  # per (m^2/s)^2 of angular momentum per mass at the end of the horizon
FORCE, MOMENT = 0.5, 2.5  # per s of the wrenches' squared deviations in weights and weights times 1 m
PALM_MOMENT = 500.0  # the same, to keep a palm's moments as planned: the controller gives palms none
LANDING = 15.0  # per m^2 of a landing point's shift: the plan chose its places for what follows
LANDING_CHANGE = 2.0  # per m^2 of its change since the last replan, which would disturb the swing


@dataclass(frozen=True)
class Tracking:
    """The plan over the N steps of a replan, and the feet that the CoM follows.

    Attributes:
        layout: Where the variables are.
        dt: (N,) s.
        states: (N + 1, 9) CoM, its velocity and the angular momentum per mass of the plan.
        wrench: (C, 6) planned wrenches of the contacts, in their frames, in weights.
        share: (N, 2) shares of the feet in the load; each foot takes its share of the CoM along.
        contacts: The contacts, C of them active.
        free: Landing points that may move.
        scale: The robot's size.
    """

    layout: Layout
    dt: np.ndarray
    states: np.ndarray
    wrench: np.ndarray
    share: np.ndarray
    contacts: HorizonContacts
    free: FreeLandings
    scale: Scale

    @property
    def usual_dt(self) -> np.ndarray:
        """(N,) s; what the steps would last for a body of the usual size."""
        return self.dt / self.scale.time

    def prices(self) -> Prices:
        """Prices of single variables."""
        n, (step, limb) = len(self.dt), np.nonzero(self.contacts.active)
        area, speed, spin = self.scale.length**2, self.scale.speed**2, self.scale.length**3
        com, velocity, climb = COM / area, VELOCITY / speed, CLIMB / speed
        weight = self.usual_dt[:, None] * np.array([com] * 3 + [velocity, velocity, climb] + [SPIN / spin] * 3)
        if self.free.items:
            weight[:, :3] = 0.0  # see `squares`
        weight[-1, 6:] += FINAL_SPIN / spin
        wanted = self.states[1:].copy()
        wanted[:, :3] += self._led()
        moment = np.where(limb < len(FEET), MOMENT, PALM_MOMENT) / area
        pull = self.usual_dt[step, None] * np.column_stack([np.full((len(step), 3), FORCE), np.tile(moment, (3, 1)).T])
        at = np.repeat([item.step for item in self.free.items], 2).astype(int)
        total, change = (LANDING + LANDING_CHANGE) / area, LANDING_CHANGE / area
        parts = [
            (np.repeat(np.arange(1, n + 1), 9), np.tile(np.arange(9), n), weight, wanted),
            (np.repeat(step, 6), indices(self.layout.wrench[step, limb], WRENCH), pull, self.wrench),
            (
                at,
                indices(self.layout.landing[at[::2]], 2),
                np.full(len(at), total),
                change / total * self.free.goal,
            ),
        ]
        stage, variable, quadratic, wanted = (
            np.concatenate([np.ravel(entry) for entry in part]) for part in zip(*parts, strict=True)
        )
        return Prices(stage, variable, np.zeros(len(stage)), quadratic, wanted)

    def squares(self) -> Squares:
        """Prices of the divergence at the end and, where feet may move, of the CoM from the feet that it follows."""
        n, rate = len(self.dt), PENDULUM_RATE / self.scale.time
        knot = np.append(np.arange(1, n + 1) if self.free.items else np.zeros(0, np.int64), n)
        count, axis = len(knot), np.arange(3)
        variables = np.zeros((count, 3, 2 + 4 * self.layout.moving), np.int64)
        factors = np.zeros(variables.shape)
        variables[..., 0], variables[..., 1] = axis, 3 + axis
        factors[..., 0], factors[-1, :, 1] = 1.0, 1.0 / rate
        if self.free.items:
            variables[..., 2:] = np.arange(STATE, STATE + 4)
            factors[:-1, :, 2:] = self._following()
            factors[-1, :, 2:] = factors[-2, :, 2:]
        wanted = self.states[knot, :3] + self._led()[knot - 1]
        wanted[-1] += self.states[-1, 3:6] / rate
        weight = np.append(COM * self.usual_dt[knot[:-1] - 1], FINAL) / self.scale.length**2
        width = variables.shape[2]
        return Squares(
            stage=np.repeat(knot, 3),
            variables=variables.reshape(-1, width),
            factors=factors.reshape(-1, width),
            weight=np.repeat(weight, 3),
            wanted=wanted.ravel(),
        )

    def _led(self) -> np.ndarray:
        """(N, 3) m; shift of the CoM with the contacts already made."""
        return np.einsum("tf,tfk->tk", self.share, self.contacts.shift[:, : len(FEET)])

    def _following(self) -> np.ndarray:
        """(N, 3, 4) factors of the feet's displacements, less which the CoM keeps to the plan."""
        follow = np.zeros((len(self.dt), 3, len(FEET), 2))
        for item, event, plane in zip(self.free.items, self.free.events, self.free.planes, strict=True):
            here = self.contacts.event[:, item.limb] == event
            follow[here, :, item.limb] = -self.share[here, item.limb, None, None] * plane
        return follow.reshape(len(self.dt), 3, 4)
