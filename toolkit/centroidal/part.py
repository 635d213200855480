"""What a part of a sequence costs by itself, from the state in which a plan comes there.

A contact that changes moves the CoM for a few transitions before and after it. Motions of that part alone tell what the
change costs, in a time that does not grow with the sequence.
"""

from __future__ import annotations

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.sequence import SequenceConfig, optimise
from toolkit.centroidal.surroundings import Surroundings
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition


def part_motion(
    plan: MotionPlan,
    part: ContactSequence,
    first: int,
    following: ContactTransition | None,
    config: SequenceConfig,
    surroundings: Surroundings | None = None,
) -> CentroidalMotion:
    """The motion of a part of a sequence, from the state in which a plan comes there.

    It ends when the limb of the transition that follows would lift off, in any state near the middle of the feet, or at
    rest where it is the sequence's end.

    Args:
        plan: A plan with a feasible motion, whose transitions before the part are those of the sequence.
        part: The part.
        first: Number of its first transition.
        following: The transition after it; None where it ends the sequence.
        config: Settings of the optimiser.
        surroundings: What limits where the body may be; None: nothing does.
    """
    motion, schedule = plan.motion, plan.schedule
    times, transitions = schedule.stance_times, plan.sequence.transitions
    initial = 0.0 if first else schedule.phases[0].duration - transitions[0].timing.shift
    final = schedule.duration - times[-1] if following is None else following.timing.shift
    knot = int(np.searchsorted(motion.problem.times, times[first] - 1e-9))
    return optimise(
        plan.robot,
        ContactSchedule.of(part, initial_rest=initial, final_rest=final),
        motion.com[knot],
        motion.linear_momentum[knot] / plan.robot.mass,
        spin=motion.angular_momentum[knot],
        config=config,
        surroundings=surroundings,
        at_rest=following is None,
    )
