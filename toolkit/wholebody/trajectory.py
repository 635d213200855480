"""Joint trajectories, and what the controller needs with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.contacts.failure import Failure


@dataclass(frozen=True)
class WholeBodyTrajectory:
    """A whole-body motion on a uniform time grid of T samples, in MuJoCo's conventions (robot compiled alone).

    Attributes:
        times: (T,) s.
        qpos: (T, 7 + n); base position, base quaternion wxyz, joints.
        qvel: (T, 6 + n); base linear velocity in the world, base angular velocity in the body, joint velocities.
        torque: (T, n) N m; inverse dynamics with the planned wrenches.
        limb_pose: (T, 4, 7); planned position (m) and quaternion wxyz of each limb's patch; NaN for free palms.
        limb_velocity: (T, 4, 6); planned velocity of each limb's patch, linear then angular, in the world.
        in_contact: (T, 4) bool; planned contact.
        max_position_error: m; over CoM and contacts, recomputed with MuJoCo.
        max_orientation_error: rad; over contacts.
        limits_respected: Whether joint positions, velocities and torques are within their limits everywhere.
        seconds: s; wall-clock time of the stage.
        failure: All checks that did not pass, with time and place of the first; None where all passed.
    """

    times: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray
    limb_pose: np.ndarray
    limb_velocity: np.ndarray
    in_contact: np.ndarray
    max_position_error: float
    max_orientation_error: float
    limits_respected: bool
    seconds: float
    failure: Failure | None = None

    @property
    def feasible(self) -> bool:
        """Whether every check passed."""
        return self.failure is None

    @property
    def reason(self) -> str:
        """One line where not feasible, else ""."""
        return "" if self.failure is None else self.failure.reason
