"""Leaning ahead: the base turns early and gently to where it had to turn at the last moment for the legs to pass.

Velocity dampers see what is near now. Where a leg passes another one or an edge fast, they turn the base within a few
ticks, with accelerations that joints cannot give. The same motion is then solved again with a wanted lean: the greatest
turn of the base in the time around each moment, smoothed. The dampers only add to it what is still missing. Where that
is not enough, the lean of the next solution goes as far again beyond what they added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.pose import Pose, rotation_vector
from toolkit.wholebody.limb_paths import LimbPaths

# s for a body of the usual size (`toolkit.robot.scale`), before and after a moment, of the greatest turn that counts,
# and again of the smoothing
AROUND = 0.25
WORTH = 0.03  # rad; a base that turns by less leans enough


@dataclass(frozen=True)
class Lean:
    """Wanted turn of the base from upright with the heading of the feet, over time.

    Attributes:
        times: (T,) s, uniform.
        turn: (T, 3) rad; rotation vectors feet_from_base.
    """

    times: np.ndarray
    turn: np.ndarray

    def at(self, time: float) -> np.ndarray:
        """(3,) rad; the turn at a time in s."""
        return np.array([np.interp(time, self.times, component) for component in self.turn.T])


def lean_ahead(
    paths: LimbPaths, times: np.ndarray, qpos: np.ndarray, pace: float = 1.0, before: Lean | None = None
) -> Lean | None:
    """The lean that anticipates the turns of the base in a motion (T, 7 + n) at uniform times (T,) in s.

    None where the base hardly turns. `pace` is the factor on the robot's times, `before` the lean that the motion had.
    """
    turn = np.array([_turn(paths, time, state) for time, state in zip(times, qpos, strict=True)])
    if before is not None:
        turn += turn - before.turn
    size = np.linalg.norm(turn, axis=1)
    if not size.max() > WORTH:
        return None
    span = max(int(round(pace * AROUND / (times[1] - times[0]))), 1)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(size, span, mode="edge"), 2 * span + 1)
    farthest = np.clip(np.argmax(windows, axis=1) + np.arange(len(turn)) - span, 0, len(turn) - 1)
    weight = np.hanning(2 * span + 3)[1:-1]
    padded = np.pad(turn[farthest], ((span, span), (0, 0)), mode="edge")
    smooth = [np.convolve(component, weight / weight.sum(), mode="valid") for component in padded.T]
    return Lean(times, np.column_stack(smooth))


def _turn(paths: LimbPaths, time: float, state: np.ndarray) -> np.ndarray:
    """(3,) rad; turn of the base in a state (7 + n,) from upright with the heading of the feet."""
    base = Pose.from_quaternion(state[:3], state[3:7])
    return rotation_vector(paths.mean_feet(time).rotation.T @ base.rotation)
