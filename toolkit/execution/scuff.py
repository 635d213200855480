"""Scuffs: touches of a limb in its swing, apart from lift-off and touchdown, from measured forces alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.execution.slip import CONTACT_GAP
from toolkit.execution.standard import Move
from toolkit.geometry.limb import Limb

LEAVING = 0.25
"""Part of a swing in which the contact that the limb leaves may still end; what lasts longer is dragging."""
LANDING = 0.5
"""Part of a swing from which on a contact that lasts to its end is the touchdown, as touchdowns are counted."""
_INSTANT = 1e-9  # s; rounding of times


@dataclass(frozen=True)
class Scuff:
    """The touches of one swing that are neither its lift-off nor its touchdown.

    Attributes:
        transition: Index of the move.
        limb: The limb that swings.
        time: When the first of them began, s.
        duration: How long the limb touched, s.
        peak: Largest force, N.
        impulse: Integral of the force's magnitude over time, N s.
    """

    transition: int
    limb: Limb
    time: float
    duration: float
    peak: float
    impulse: float


def scuffs(moves: tuple[Move, ...], force: np.ndarray, timestep: float) -> tuple[Scuff, ...]:
    """Scuffs of a run, one for each move in which the limb touched, in the moves' order.

    Touches that are less than `CONTACT_GAP` apart are one contact. The contact in which a swing begins is its lift-off
    during the first `LEAVING` of it; the contact in which it ends is its touchdown from `LANDING` on.

    Args:
        moves: The planned moves.
        force: (S, 4) N; magnitude of the contact force on each limb in each physics step.
        timestep: Duration of a physics step in s.
    """
    found = []
    times = timestep * np.arange(len(force))
    for transition, move in enumerate(moves):
        steps = np.flatnonzero((times >= move.start) & (times < move.end))
        if not len(steps):
            continue
        swing = force[steps, move.limb]
        counted = _between(swing, move, times[steps])
        if counted.any():
            first, touched = steps[counted][0], swing[counted]
            duration, impulse = timestep * len(touched), timestep * touched.sum()
            peak = touched.max()
            each = Scuff(transition, move.limb, float(times[first]), duration, float(peak), float(impulse))
            found.append(each)
    return tuple(found)


def _between(force: np.ndarray, move: Move, times: np.ndarray) -> np.ndarray:
    """Which samples (n,) of a swing's force are touches that are neither lift-off nor touchdown, bool."""
    loaded = np.flatnonzero(force > 0.0)
    if not len(loaded):
        return force > 0.0
    when, gap = times[loaded], CONTACT_GAP + _INSTANT
    number = np.r_[0, np.cumsum(np.diff(when) > gap)]
    share = (when - move.start) / (move.end - move.start)
    leaving = (number == 0) & (when[0] - move.start <= gap) & (share < LEAVING)
    landing = (number == number[-1]) & (move.end - when[-1] <= gap) & (share >= LANDING)
    counted = np.zeros(len(force), bool)
    counted[loaded[~(leaving | landing)]] = True
    return counted
