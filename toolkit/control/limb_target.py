"""LimbTargets: where limbs should be now, given their measured poses."""

from __future__ import annotations

import numpy as np

from toolkit.control.dynamics import RobotDynamics
from toolkit.control.sampled_plan import Reference, Swing
from toolkit.control.touchdown import ContactTracker, LimbState

FADE = 0.7  # part of a swing over which the offset that it started with fades away
SWING_SHARE = 0.05  # part of a foot's weights until it prepares to land: a foot that is too slow does not move the body
REST_SPEED = 0.05  # m/s; speed at which a foot that bounced off goes back along the inward normal


class LimbTargets:
    """Task errors and feed-forward of the limbs that are not in contact; zeros for those that are.

    A swing starts from where the limb rests, not from where it was planned to rest: that offset fades away during the
    first part of the swing. A limb that has not met its surface in time goes on along the inward normal.

    Attributes:
        tracker: Which limbs are in contact.
        error: (4, 6) m and rad, from the limb to its target, in the world frame.
        velocity, acceleration: Each (4, 6).
        authority: (4,) in [0, 1]; how binding the target is (palms blend to and from their free posture).
        shift, shift_velocity: (4, 3) displacement of the landing point in m, and its rate in m/s.
    """

    def __init__(self, reference: Reference, tracker: ContactTracker):
        self._reference, self.tracker = reference, tracker
        self.error, self.velocity, self.acceleration = np.zeros((4, 6)), np.zeros((4, 6)), np.zeros((4, 6))
        self.authority = np.ones(4)
        self.shift, self.shift_velocity = np.zeros((4, 3)), np.zeros((4, 3))
        self._offset = np.zeros((4, 3))
        self._period = float(reference.times[1] - reference.times[0]) if len(reference.times) > 1 else 1.0

    def update(self, index: int, dynamics: RobotDynamics) -> None:
        """Evaluate at a row of the reference and the measured limbs."""
        reference, tracker = self._reference, self.tracker
        for limb in dynamics.limbs:
            state, swing = tracker.state[limb], tracker.current[limb]
            self.error[limb] = self.velocity[limb] = self.acceleration[limb] = 0.0
            self.authority[limb] = reference.authority[index, limb]
            if tracker.loose[limb]:
                self.velocity[limb, :3] = -tracker.scale.speed * REST_SPEED * dynamics.limb_rotation[limb, :, 2]
            if state in (LimbState.REST, LimbState.FREE) or swing is None:
                continue
            if tracker.begun[limb]:
                self._offset[limb] = dynamics.limb_position[limb] - reference.limb_position[index, limb]
                if not swing.breaks:
                    self._offset[limb] = 0.0
                self.shift[limb] = self.shift_velocity[limb] = 0.0
            pace, lead, row = tracker.pace[limb], tracker.lead[limb], index
            if lead:
                row = min(index + round(lead / self._period), len(reference.times) - 1)
            target = reference.limb_position[row, limb] + self.shift[limb]
            self.velocity[limb] = pace * reference.limb_velocity[row, limb]
            self.velocity[limb, :3] += self.shift_velocity[limb]
            self.acceleration[limb] = pace * pace * reference.limb_acceleration[row, limb]
            if limb.is_foot and state is LimbState.SWING:
                late = min(max((reference.times[row] - swing.start) / (swing.end - swing.start) - 0.5, 0.0) / 0.4, 1.0)
                self.authority[limb] = SWING_SHARE + (1.0 - SWING_SHARE) * late * late * (3.0 - 2.0 * late)
            if state is LimbState.SEARCH and swing.contact is not None:
                normal = swing.contact.pose.normal
                target = target - tracker.depth[limb] * normal
                self.velocity[limb, :3] -= tracker.search_speed(limb) * normal
            else:
                target = target + _remaining(swing, reference.times[row]) * self._offset[limb]
            self.error[limb, :3] = target - dynamics.limb_position[limb]
            self.error[limb, 3:] = rotation_sine(reference.limb_rotation[row, limb] @ dynamics.limb_rotation[limb].T)


def _remaining(swing: Swing, time: float) -> float:
    """Share of the initial offset that is left."""
    share = min((time - swing.start) / (FADE * (swing.end - swing.start)), 1.0)
    return 1.0 - share * share * (3.0 - 2.0 * share)


def rotation_sine(turn: np.ndarray) -> np.ndarray:
    """Sine of a (3, 3) rotation's angle along its axis (3,): the rotation vector in rad where the angle is small."""
    return 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
