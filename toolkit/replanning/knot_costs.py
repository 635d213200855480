"""The costs of a replan for deviating from the plan at its knots."""

from __future__ import annotations

import numpy as np

from toolkit.control.corrector import PENDULUM_RATE
from toolkit.replanning.linear_motion import FreeLandings, Window
from toolkit.replanning.sweep import GIVEN

# Weights of the CoM per m^2 s, and of its velocity per m^2/s, horizontal and vertical (no landing point helps there).
COM, VELOCITY, CLIMB = 200.0, 5.0, 40.0
# Weights of the angular momentum per mass, per (m^2/s)^2 s, and of its rate, which arms and trunk must follow.
SPIN, SPIN_RATE = 100.0, 8.0
FINAL = 2000.0  # per m^2 of divergence at the end of the horizon
LANDING = 30.0  # per m^2 of a landing point's shift: the plan chose its places for what follows
LANDING_CHANGE = 4.0  # per m^2 of its change since the last replan, which would disturb the swing


def knot_costs(
    window: Window, free: FreeLandings, shift: np.ndarray, share: np.ndarray, goal: dict[int, np.ndarray], size: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Quadratic costs of n states: Hessians (N + 1, n, n), gradients (N + 1, n) and a constant.

    Args:
        window: The plan at the knots.
        free: The landing points that may move.
        shift: Shifts (N, 4, 3) in m of contacts already made.
        share: Shares (N, 2) of the feet in the load.
        goal: By swing, the shift (3,) in m that was decided last.
        size: Number n of states.
    """
    dt = window.dt
    spin = window.spin_rows(size)[1:]
    follow, offset = free.offset_of_feet(shift, share, size)
    cost, slope = np.zeros((window.steps + 1, size, size)), np.zeros((window.steps + 1, size))
    duration = dt[:, None, None]
    cost[1:] += COM * duration * np.einsum("tki,tkj->tij", follow, follow)
    slope[1:] -= COM * dt[:, None] * np.einsum("tki,tk->ti", follow, offset)
    axis = np.arange(3)
    cost[1:, 3 + axis, 3 + axis] += dt[:, None] * [VELOCITY, VELOCITY, CLIMB]
    cost[1:] += SPIN * duration * np.einsum("tki,tkj->tij", spin, spin)
    change = spin.copy()
    change[:, axis, 9 + axis] -= 1.0
    cost[1:] += SPIN_RATE / duration * np.einsum("tki,tkj->tij", change, change)
    end = follow[-1].copy()
    end[axis, 3 + axis] += 1.0 / PENDULUM_RATE
    cost[-1] += FINAL * end.T @ end + 0.1 * FINAL * spin[-1].T @ spin[-1]
    slope[-1] -= FINAL * end.T @ offset[-1]
    cost[0, GIVEN:, GIVEN:] += 1e-3 * np.eye(size - GIVEN)
    for index, (event, plane) in enumerate(zip(free.events, free.planes, strict=True)):
        own = free.states(index)
        cost[0, own, own] += (LANDING + LANDING_CHANGE) * np.eye(2)
        slope[0, own] -= LANDING_CHANGE * plane.T @ goal.get(event, np.zeros(3))
    constant = 0.5 * (COM * dt @ (offset**2).sum(1) + FINAL * (offset[-1] ** 2).sum())
    return cost, slope, float(constant)
