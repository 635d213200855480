"""The discrete set of moves that the search may make (paper, Fig. 2): steps of a foot, reaches of a palm.

Steps are rows (x m, y m, yaw rad) of the new left foot in the upright frame of the standing right foot. Reaches are
unit rays from the left shoulder in the upright frame of the mean feet. Moves of right limbs are the mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.legroom import legs_touch
from toolkit.robot.model import RobotModel

_MIRROR_STEP = np.array([1.0, -1.0, -1.0])
_MIRROR_RAY = np.array([1.0, -1.0, 1.0])
_NARROWEST = 0.6
"""Least width of a step, as a share of the home posture: hips that stand wide hit each other as legs come together.

Robots whose hips have room stand no wider than 1.65 times their narrowest step.
"""


def _foot_steps(yaws_deg: tuple[float, ...]) -> np.ndarray:
    """(n, 3) steps of a left foot: the grid of the paper's figure.

    Steps backwards are only 0.2 m wide. Steps in place (x = 0) and the longest ones (x = 0.4 m) are straight; the
    others have each of the given headings. The corner (0.4, 0.4) m is left out, which gives the paper's counts.
    """
    rows: list[tuple[float, float, float]] = []
    for x in (-0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4):
        for y in (0.2, 0.3, 0.4):
            if (x < 0.0 and y > 0.2) or (x == 0.4 and y == 0.4):
                continue
            rows += [(x, y, yaw) for yaw in ((0.0,) if x in (0.0, 0.4) else yaws_deg)]
    return np.array(rows) * [1.0, 1.0, np.pi / 180]


def steps_38() -> np.ndarray:
    """(38, 3) steps of the paper's data collection (yaw 0, +-30 deg)."""
    return _foot_steps((0.0, -30.0, 30.0))


def steps_60() -> np.ndarray:
    """(60, 3) steps of the paper's experiments (yaw 0, +-15, +-30 deg)."""
    return _foot_steps((0.0, -15.0, 15.0, -30.0, 30.0))


def running_steps() -> np.ndarray:
    """(14, 3) straight steps of 0.45 m to 0.75 m, which are added for ground that has to be crossed fast."""
    return np.array([(x, y, 0.0) for x in (0.45, 0.50, 0.55, 0.60, 0.65, 0.70, 0.75) for y in (0.2, 0.3)])


def palm_rays() -> np.ndarray:
    """(18, 3) rays of the left palm: 10 to 60 degrees from sideways to the front, level and 20 degrees up and down."""
    forward, elevation = np.meshgrid(np.radians([10, 20, 30, 40, 50, 60]), np.radians([0, -20, 20]), indexing="ij")
    rays = np.stack(
        [np.cos(elevation) * np.sin(forward), np.cos(elevation) * np.cos(forward), np.sin(elevation)], axis=-1
    )
    return rays.reshape(-1, 3)


def soles_apart(robot: RobotModel) -> float:
    """Distance in m across between the centres of two soles side by side, with some room between them."""
    return float(2.0 * robot.half_sizes[Limb.LEFT_FOOT, 1] + robot.scale.length * 0.04)


@dataclass(frozen=True)
class TransitionModel:
    """The moves of every limb of one robot.

    Attributes:
        steps: (n, 3) Steps of the left foot.
        rays: (m, 3) Rays of the left palm.
    """

    steps: np.ndarray
    rays: np.ndarray

    @classmethod
    def of(cls, robot: RobotModel, steps: np.ndarray) -> TransitionModel:
        """Moves of a robot: steps scaled with its legs, wide enough for its soles and hips, and rays if it has arms.

        Steps that turn the feet so far inwards that the legs would be in each other are left out.

        The paper's numbers fit a body of the usual size (`toolkit.robot.scale`).
        """
        scale = robot.scale.length
        scaled = steps * [scale, scale, 1.0]
        narrowest = max(soles_apart(robot), _NARROWEST * robot.stance_width)
        scaled[:, 1] += max(0.0, narrowest - scaled[:, 1].min())
        inward = {(y, yaw) for _, y, yaw in scaled.tolist() if yaw < 0.0}
        touching = {step for step in sorted(inward) if legs_touch(robot, step[0], -step[1])}
        scaled = scaled[[(y, yaw) not in touching for _, y, yaw in scaled.tolist()]]
        return cls(scaled, palm_rays() if robot.arms else np.zeros((0, 3)))

    def steps_of(self, limb: Limb) -> np.ndarray:
        """(n, 3) steps of a foot in the upright frame of the standing one."""
        return self.steps if limb.is_left else self.steps * _MIRROR_STEP

    def rays_of(self, limb: Limb) -> np.ndarray:
        """(m, 3) rays of a palm in the upright frame of the mean feet."""
        return self.rays if limb.is_left else self.rays * _MIRROR_RAY

    @property
    def longest_step(self) -> float:
        """Longest distance along x between the standing and the new foot, in m."""
        return float(self.steps[:, 0].max())
