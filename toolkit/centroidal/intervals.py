"""What each transition of a whole motion costs, and the state of the CoM before and after it.

A transition owns the time from the end of the one before to its own end: its shift and its swing. The rest before the
first transition belongs to the first one; the rest and the stop after the last one belong to the last one. The costs
come from the independent check (`toolkit.centroidal.residual`), so they are those of the objective that is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.residual import step_costs
from toolkit.contacts.schedule import ContactSchedule
from toolkit.errors import InputError

_SAME_TIME = 1e-6  # s; times of phases and knots that differ by less are the same


@dataclass(frozen=True)
class Intervals:
    """The motion of a sequence of n transitions, cut at the ends of the transitions; world frame.

    Attributes:
        objective: (n,) what each transition adds to the objective, never negative; it adds up to the motion's. All inf
            where the motion's is undefined.
        knots: (n + 1,) int; knot at which the first transition begins, then the knot at the end of each swing.
        com: (n + 1, 3) m; CoM at these knots.
        com_velocity: (n + 1, 3) m/s; its velocity.
    """

    objective: np.ndarray
    knots: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray


def intervals(motion: CentroidalMotion, schedule: ContactSchedule) -> Intervals:
    """Cut a motion at the ends of the transitions of its schedule.

    Raises:
        InputError: The schedule has no transitions, or another one was optimised.
    """
    swings = [phase for phase in schedule.phases if phase.swing is not None]
    if not swings:
        raise InputError("a schedule without transitions has no intervals")
    times, ends = motion.problem.times, np.array([phase.end for phase in swings])
    last = np.searchsorted(times, ends - _SAME_TIME)
    strange = abs(times[-1] - schedule.duration) > _SAME_TIME or (np.abs(times[last] - ends) > _SAME_TIME).any()
    if strange:
        raise InputError("the motion is not one of this schedule: no knots at the ends of its transitions")
    knots = np.concatenate([[0], last])
    objective = np.add.reduceat(step_costs(motion), knots[:-1])  # the last interval goes on to the end of the motion
    return Intervals(objective, knots, motion.com[knots], motion.linear_momentum[knots] / motion.problem.mass)
