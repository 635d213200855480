"""Contact sequences for tests, in proportions of the robot."""

import numpy as np

from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.world.timing import Timing


def foot(robot, limb, x, *, friction=0.5, slope=0.0):
    """A foot below its hip at x, on a plane through the origin that falls along x by `slope` rad."""
    leg = robot.legs[limb]
    y = leg.hip_in_com[1] - leg.ankle_in_sole[1]
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    return Contact(limb, Pose(rotation_on_surface(normal, 0.0), np.array([x, y, -x * np.tan(slope)])), friction)


def walk(robot, steps, stride, timing=(1.0, 1.0), *, friction=0.5, rest=1.0):
    """Schedule of steps straight ahead, the last foot beside the other; stride in leg lengths."""
    stride = stride * robot.legs[Limb.LEFT_FOOT].max_length
    start = Stance(tuple(foot(robot, limb, 0.0, friction=friction) for limb in FEET))
    places = [min(i + 1, steps - 1) * stride for i in range(steps)]
    transitions = [
        ContactTransition(Limb(i % 2), foot(robot, Limb(i % 2), x, friction=friction), Timing(*timing))
        for i, x in enumerate(places)
    ]
    schedule = ContactSchedule.of(ContactSequence(start, tuple(transitions)), initial_rest=0.3, final_rest=rest)
    return start, schedule
