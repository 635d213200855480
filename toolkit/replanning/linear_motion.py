"""The linear dynamics of a replan about the plan: its knots, its landing points and its contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.problem import STANDARD_GRAVITY
from toolkit.geometry.limb import FEET
from toolkit.physics.momentum import advanced, fill_wrench_map
from toolkit.replanning.nominal import Nominal
from toolkit.replanning.situation import HorizonContacts, Situation
from toolkit.replanning.sweep import GIVEN

G = STANDARD_GRAVITY


@dataclass(frozen=True)
class Window:
    """The plan at the N + 1 knots of a replan, the first one at the time of the measured state.

    Attributes:
        first, last: Knots of the plan: the one before the first time, and the last one.
        times: (N + 1,) s.
        com, velocity: Each (N + 1, 3); the planned CoM. The state's angular momentum is about the first one.
        spin, wrench_spin: Each (N + 1, 3); angular momentum about the CoM per mass, of postures and wrenches.
    """

    first: int
    last: int
    times: np.ndarray
    com: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    wrench_spin: np.ndarray

    @classmethod
    def of(cls, nominal: Nominal, time: float, horizon: float) -> Window:
        """The knots from a time on, as far as the horizon goes."""
        first = int(np.searchsorted(nominal.times, time + 1e-6, side="right")) - 1
        last = min(int(np.searchsorted(nominal.times, time + horizon, side="left")), len(nominal.times) - 1)
        knots = slice(first, last + 1)
        times, com, velocity = nominal.times[knots].copy(), nominal.com[knots].copy(), nominal.velocity[knots].copy()
        spin, made = nominal.spin[knots].copy(), nominal.wrench_spin[knots].copy()
        inside = time - nominal.times[first]
        times[0] = time
        com[0] += inside * (velocity[0] + 0.5 * inside * nominal.acceleration[first])
        velocity[0] += inside * nominal.acceleration[first]
        for each in (spin, made):
            each[0] += inside / (nominal.times[first + 1] - nominal.times[first]) * (each[1] - each[0])
        return cls(first, last, times, com, velocity, spin, made)

    @property
    def steps(self) -> int:
        """The number N of steps."""
        return self.last - self.first

    @property
    def dt(self) -> np.ndarray:
        """Lengths (N,) of the steps in s."""
        return np.diff(self.times)

    def deviation(self, situation: Situation) -> np.ndarray:
        """Deviation (12,) of a measured state from the plan, in the order of a replan's states."""
        com, velocity = situation.com - self.com[0], situation.velocity - self.velocity[0]
        spin = situation.spin - self.spin[0] + np.cross(situation.com - self.com[0], situation.velocity)
        return np.concatenate([com - situation.com_shift, velocity, spin, np.zeros(3)])

    def spin_rows(self, size: int) -> np.ndarray:
        """Rows (N + 1, 3, size) of the change of angular momentum about the CoM, linear in the states."""
        rows, axis = np.zeros((self.steps + 1, 3, size)), np.arange(3)
        rows[:, :, :3], rows[:, :, 3:6] = _skew(self.velocity), -_skew(self.com - self.com[0])
        rows[:, axis, 6 + axis] = 1.0
        return rows

    def spin_of(self, states: np.ndarray) -> np.ndarray:
        """The exact change (N + 1, 3) of angular momentum about the CoM."""
        turned = states[:, 6:9] + np.cross(self.com - self.com[0], self.velocity)
        return turned - np.cross(self.com + states[:, :3] - self.com[0], self.velocity + states[:, 3:6])


@dataclass(frozen=True)
class FreeLandings:
    """Landing points that a replan may move.

    Attributes:
        events: The swings, the next one first.
        planes: The axes (3, 2) of each landing point's plane.
        column: (N, 4) index of the landing point that a limb stands on in each step; -1 where on none.
    """

    events: list[int]
    planes: list[np.ndarray]
    column: np.ndarray

    @classmethod
    def of(
        cls, events: list[int], planes: list[np.ndarray], nominal: Nominal, contacts: HorizonContacts
    ) -> FreeLandings:
        """Find the steps in which limbs stand on the landing points of these swings."""
        column = np.full(contacts.active.shape, -1)
        for index, event in enumerate(events):
            limb = nominal.swings[event].limb
            column[contacts.event[:, limb] == event, limb] = index
        return cls(events, planes, column)

    def states(self, index: int) -> slice:
        """The states that are the shifts of a landing point."""
        return slice(GIVEN + 2 * index, GIVEN + 2 * index + 2)

    def offset_of_feet(self, shift: np.ndarray, share: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
        """The CoM less the shift of the feet that it should follow: rows (N, 3, size) and a constant (N, 3).

        Contacts already made have shifts (N, 4, 3) in m; each foot takes its share (N, 2) of the CoM along.
        """
        follow, offset = np.zeros((len(shift), 3, size)), np.zeros((len(shift), 3))
        follow[:, np.arange(3), np.arange(3)] = 1.0
        for foot in FEET:
            offset += share[:, foot, None] * shift[:, foot]
            for index, plane in enumerate(self.planes):
                here = self.column[:, foot] == index
                follow[here, :, self.states(index)] -= share[here, foot, None, None] * plane
        return follow, offset


@dataclass(frozen=True)
class Dynamics:
    """x_{t+1} = a x_t + b sum_j spread_j u_j + drift, for C contacts of N steps.

    Attributes:
        step, limb: Each (C,); step and limb of each contact.
        first: (N + 1,) first contact of each step, and C.
        wrench: (C, 6) planned wrenches in the contact frames, in weights.
        a, b, drift, spread: (N, n, n), (N, n, 6), (N, n) and (C, 6, 6).
    """

    step: np.ndarray
    limb: np.ndarray
    first: np.ndarray
    wrench: np.ndarray
    a: np.ndarray
    b: np.ndarray
    drift: np.ndarray
    spread: np.ndarray

    @classmethod
    def of(
        cls, window: Window, planned: np.ndarray, contacts: HorizonContacts, landings: FreeLandings, size: int
    ) -> Dynamics:
        """Linearise about the plan and its wrenches (N, 4, 6) in the contact frames, in weights, for n states."""
        steps, dt, origin = window.steps, window.dt, window.com[0]
        step, limb = np.nonzero(contacts.active)
        first = np.concatenate([[0], np.cumsum(contacts.active.sum(1))]).astype(np.int64)
        turn, wrench = contacts.rotation[step, limb], planned[step, limb]
        lever = contacts.position[step, limb] + contacts.shift[step, limb] - origin
        spread = np.zeros((len(step), 6, 6))
        fill_wrench_map(np.moveaxis(turn, 0, 2), lever.T, np.moveaxis(spread, 0, 2))
        spread *= G
        pull = np.einsum("cij,cj->ci", spread, wrench)
        pulls = np.zeros((steps, 6))
        np.add.at(pulls, step, pull)
        pulls[:, 2] -= G

        a, b = np.tile(np.eye(size), (steps, 1, 1)), np.zeros((steps, size, 6))
        unit = np.eye(15)[:, None]  # states, acceleration and moment
        moved = np.broadcast_arrays(*advanced(dt[:, None], G, unit[:9], unit[9:12], unit[12:]))
        a[:, :9, :9], b[:, :9] = np.split(np.stack(moved, 1), [9], 2)
        column = landings.column[step, limb]
        for c in np.flatnonzero(column >= 0):
            t, plane = step[c], landings.planes[column[c]]
            a[t, 6:9, landings.states(int(column[c]))] += dt[t] * np.cross(plane.T, pull[c, :3]).T
        a[:, 9:12] = window.spin_rows(size)[:-1]
        drift = np.einsum("tij,tj->ti", b, pulls - _planned_rates(window))
        return cls(step, limb, first, wrench, a, b, drift, spread)


def _planned_rates(window: Window) -> np.ndarray:
    """Planned acceleration, and rate of angular momentum about the first CoM as the wrenches make it (N, 6)."""
    dt, origin = window.dt, window.com[0]
    about = window.wrench_spin + np.cross(window.com - origin, window.velocity)
    rates = np.zeros((window.steps, 6))
    rates[:, :3] = np.diff(window.velocity, axis=0) / dt[:, None]
    weight_moment = np.zeros((window.steps, 3))
    mean = window.com[:-1] + dt[:, None] * (window.velocity[:-1] / 2 + dt[:, None] * rates[:, :3] / 6) - origin
    weight_moment[:, 0], weight_moment[:, 1] = -G * mean[:, 1], G * mean[:, 0]
    rates[:, 3:] = np.diff(about, axis=0) / dt[:, None] - weight_moment
    return rates


def _skew(v: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) of the cross product with vectors (n, 3)."""
    matrix = np.zeros((len(v), 3, 3))
    matrix[:, 0, 1], matrix[:, 0, 2], matrix[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    matrix[:, 1, 0], matrix[:, 2, 0], matrix[:, 2, 1] = v[:, 2], -v[:, 1], v[:, 0]
    return matrix
