"""Smooth interpolation of a sampled whole-body trajectory, for controllers that run faster than its grid."""

from __future__ import annotations

import numpy as np

from toolkit.geometry.pose import (
    quaternion_from_rotation,
    rotation_exponential,
    rotation_from_quaternion,
    rotation_vector,
)
from toolkit.wholebody.trajectory import WholeBodyTrajectory


class TrajectorySampler:
    """Cubic Hermite interpolation of joints, base position and base rotation (in the tangent space of the last sample).

    Velocities are continuous; `qvel` is the exact derivative of `qpos` but for the base's rotation, where terms of
    third order in the rotation within one interval are left out.
    """

    def __init__(self, trajectory: WholeBodyTrajectory):
        """Prepare the trajectory's intervals once.

        Args:
            trajectory: at least two samples.
        """
        self.times = trajectory.times
        self.step = float(self.times[1] - self.times[0])
        qpos, qvel, step = trajectory.qpos, trajectory.qvel, self.step
        self.rotations = rotation_from_quaternion(qpos[:, 3:7])
        pairs = zip(self.rotations[:-1], self.rotations[1:], strict=True)
        turns = np.array([rotation_vector(before.T @ after) for before, after in pairs])
        # The end's body velocity in the coordinates of the start's tangent space, to second order in the turn.
        spin = qvel[:, 3:6]
        spin_end = spin[1:] + 0.5 * np.cross(turns, spin[1:]) + np.cross(turns, np.cross(turns, spin[1:])) / 12.0
        start = np.concatenate([qpos[:-1, :3], np.zeros_like(turns), qpos[:-1, 7:]], 1)
        end = np.concatenate([qpos[1:, :3], turns, qpos[1:, 7:]], 1)
        rate, rate_end = step * qvel[:-1], step * np.concatenate([qvel[1:, :3], spin_end, qvel[1:, 6:]], 1)
        # Powers of the share s of the interval: c0 + c1 s + c2 s^2 + c3 s^3.
        self.c0, self.c1 = start, rate
        self.c2 = 3.0 * (end - start) - 2.0 * rate - rate_end
        self.c3 = 2.0 * (start - end) + rate + rate_end

    def sample(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State at a time in s, at rest beyond the ends.

        Returns:
            qpos (7 + n,), qvel (6 + n,), qacc (6 + n,) in MuJoCo's conventions.
        """
        x = (time - self.times[0]) / self.step
        index = min(max(int(x), 0), len(self.c0) - 1)
        s = min(max(x - index, 0.0), 1.0)
        c1, c2, c3 = self.c1[index], self.c2[index], self.c3[index]
        value = self.c0[index] + s * (c1 + s * (c2 + s * c3))
        rate = (c1 + s * (2.0 * c2 + 3.0 * s * c3)) / self.step
        second = (2.0 * c2 + 6.0 * s * c3) / self.step**2
        if not 0.0 <= x <= len(self.c0):
            rate, second = np.zeros_like(rate), np.zeros_like(rate)
        turn = value[3:6]
        rotation = self.rotations[index] @ rotation_exponential(turn)
        qpos = np.concatenate([value[:3], quaternion_from_rotation(rotation), value[6:]])
        spin = rate[3:6]
        rate[3:6] = spin - 0.5 * np.cross(turn, spin) + np.cross(turn, np.cross(turn, spin)) / 6.0
        return qpos, rate, second
