"""ReplanProblem: the best motion over the next contacts from a measured state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.layout import indices
from toolkit.centroidal.stages.steps import WRENCH
from toolkit.control.corrector import PENDULUM_RATE
from toolkit.geometry.limb import FEET
from toolkit.replanning.landing import Landings
from toolkit.replanning.nominal import Nominal
from toolkit.replanning.plan_rows import PlanRows
from toolkit.replanning.replan_program import ReplanProgram
from toolkit.replanning.situation import HorizonContacts, Situation
from toolkit.replanning.window import Window
from toolkit.robot.model import RobotModel
from toolkit.world.surface import Surface

MOVABLE = 2  # contacts to be made whose places are free, at most
# The controller's gains settle a divergence of so many m, for a body of the usual size (`toolkit.robot.scale`), where
# every foot is as near to its planned place; but with the centre of pressure, so never more than this part of what any
# contact bears from its middle to its nearer edge: a foot that rolls has only a line to move it on.
DEADBAND, DEADBAND_PART = 0.01, 0.5
# Landing points stay where they are planned while the divergence left when the next foot lands is as small and the
# body's limits exceeded on the way cost at most EXCESS.
EXCESS = 0.02
# Swings end early only where the objective exceeds EARLY_OBJECTIVE and falls by EARLY_GAIN; 1 s earlier costs a body of
# the usual size EARLY.
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
    """Builds and solves the programs of one run.

    Attributes:
        deadband: m; divergence from the plan that needs no replan.
    """

    def __init__(self, nominal: Nominal, robot: RobotModel, surfaces: tuple[Surface, ...]):
        self._nominal = nominal
        bearing = nominal.problem.half_size[:, FEET][nominal.problem.active[:, FEET]]
        self.deadband = min(nominal.scale.length * DEADBAND, DEADBAND_PART * float(bearing.min()))
        self._landings = Landings(nominal.swings, robot.half_sizes, surfaces, robot.scale)
        self._rows = PlanRows.of(nominal.problem, robot)

    def solve(self, situation: Situation) -> Replan | None:
        """The best motion from a measured state; None where the solver gives no answer.

        Landing points move only where the motion cannot return to the plan otherwise. Where even that is not enough,
        swings under way may also end earlier, at one of a few times.
        """
        if not situation.displaced:
            kept = self._solve(situation, {}, movable=0)
            # This suffices if the motion is back at the plan when the next foot lands.
            if kept and kept.divergence[kept.next_landing] <= self.deadband and kept.excess <= EXCESS:
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
        window = Window.of(nominal, situation.time, nominal.horizon)
        contacts = HorizonContacts.of(nominal, situation, window.first, window.times, early)
        events = self._free_landings(situation, window, movable)
        free = self._landings.free(events, situation, window.times, early)
        program = ReplanProgram.of(nominal, self._rows, window, contacts, free, situation.cones)
        found = program.solve(self._deviation(window, situation))
        if found is None:
            return None
        y, objective = found
        layout, (step, limb) = program.layout, np.nonzero(contacts.active)
        wrench = np.zeros((window.steps, 4, 6))
        wrench[step, limb] = y[step[:, None], indices(layout.wrench[step, limb], WRENCH)]
        shifts = [
            plane @ y[item.step, layout.chosen(item)] for item, plane in zip(free.items, free.planes, strict=True)
        ]
        ends = [nominal.swings[event].end for event in self._landings.contacts]
        next_end = min((end for end in ends if end > situation.time), default=np.inf)
        times, off = window.times, y[:, :9] - program.track.states
        rate = PENDULUM_RATE / nominal.scale.time
        rates = np.diff(off, axis=0) / window.dt[:, None]
        hastened = sum(nominal.swings[event].end - end for event, end in early.items()) / nominal.scale.time
        return Replan(
            times=times,
            com=off[:, :3],
            velocity=off[:, 3:6],
            spin=off[:, 6:],
            acceleration=rates[:, 3:6],
            spin_rate=rates[:, 6:],
            wrench=wrench,
            landing=dict(zip(events, shifts, strict=True)),
            ends=early,
            objective=objective + EARLY * hastened,
            excess=program.excess(y),
            divergence=np.linalg.norm(off[:, :3] + off[:, 3:6] / rate, axis=1),
            next_landing=int(np.searchsorted(times, next_end) if next_end < times[-1] else window.steps),
        )

    def _deviation(self, window: Window, situation: Situation) -> np.ndarray:
        """The measured deviation (9,) from the plan, less a deadband that needs no reaction."""
        com = situation.com - window.com[0] - situation.com_shift
        velocity = situation.velocity - window.velocity[0]
        rate = PENDULUM_RATE / self._nominal.scale.time
        divergence = float(np.linalg.norm(com + velocity / rate))
        off = np.concatenate([com, velocity, situation.spin - window.spin[0]])
        off *= max(1.0 - self.deadband / max(divergence, 1e-9), 0.0)
        off[:3] += situation.com_shift
        return off

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
