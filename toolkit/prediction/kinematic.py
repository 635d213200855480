"""KinematicEvaluator: transitions judged without dynamics, for search on kinematics alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.geometry.heading import mean_heading, wrapped
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import rotation_about_z, yaw_of
from toolkit.physics.leg import drop_to
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.robot.model import RobotModel

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_LENGTH_MARGIN = 0.01  # m; the CoM is low enough for legs this much shorter than their longest


@dataclass(frozen=True)
class KinematicConfig:
    """Settings, for a body of the usual size (`toolkit.robot.scale`).

    The objective replaces the dynamics objective and has its order of magnitude, so it is an integral over time too.

    Attributes:
        friction: The part of the friction coefficient that a sole at rest may need; steeper surfaces hold no foot.
        stride: Objective of moving the mean of the feet by 0.3 m. It grows with the square, like the next three.
        rise: Objective of a step 0.1 m up or down.
        tilt: Objective of a foot on a tilt of 0.2 rad.
        spread: Objective of feet 0.1 m wider or narrower than at home, or turned 0.3 rad apart.
        palm_relief: Factor on the objective of a foot move for each palm in contact; 1: palms do not help.
    """

    friction: float = 0.9
    stride: float = 30.0
    rise: float = 10.0
    tilt: float = 10.0
    spread: float = 10.0
    palm_relief: float = 1.0


class KinematicEvaluator(TransitionEvaluator):
    """Judges without dynamics: the CoM rests above the mean of the feet, and ground within its friction angle holds."""

    rejection = "ground too steep for a foot to rest on with its friction"

    def __init__(self, robot: RobotModel, config: KinematicConfig | None = None):
        self._robot, self._config = robot, config or KinematicConfig()
        left, right = (robot.legs[limb].hip_in_com[1] for limb in FEET)
        self._home_width = float(left - right)

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """Judge transitions; see `TransitionEvaluator`."""
        config, rows, n = self._config, TransitionRows.of(transitions), len(transitions)
        scale, pace = self._robot.scale.length, self._robot.scale.time
        feet = [stance[limb] for limb in FEET]
        position = np.tile([foot.pose.position for foot in feet], (n, 1, 1))
        rotation = np.tile([foot.pose.rotation for foot in feet], (n, 1, 1, 1))
        friction = np.tile([foot.friction for foot in feet], (n, 1))
        moved = np.flatnonzero(rows.limb < len(FEET))
        foot = moved, rows.limb[moved]
        position[foot], rotation[foot] = rows.position[moved], rows.rotation[moved]
        friction[foot] = rows.friction[moved]
        heading = np.transpose(yaw_of(rotation))
        yaw = mean_heading(*heading)

        normal_z = np.clip(rotation[:, :, 2, 2], 1e-6, 1.0)
        tilt = np.arccos(normal_z)
        feasible = np.all(np.tan(tilt) <= config.friction * friction, axis=1)

        mean = position.mean(1)
        before = stance.mean_feet.position
        apart = position[:, 0] - position[:, 1]
        lateral = -np.sin(yaw) * apart[:, 0] + np.cos(yaw) * apart[:, 1]
        turn = wrapped(heading[0] - heading[1])
        objective = (
            config.stride * (np.hypot(*(mean - before)[:, :2].T) / (scale * 0.3)) ** 2
            + config.rise * (apart[:, 2] / (scale * 0.1)) ** 2
            + config.tilt * ((tilt / 0.2) ** 2).sum(1)
            + config.spread * (((lateral - self._home_width) / (scale * 0.1)) ** 2 + (turn / 0.3) ** 2)
        )
        relief = config.palm_relief ** len(stance.palms)
        objective = pace * np.where(rows.limb < len(FEET), objective * relief, 1.0)
        return TransitionBatch(feasible, objective, self._com(position, rotation, mean, yaw), np.zeros((n, 3)))

    def _com(self, position: np.ndarray, rotation: np.ndarray, mean: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """(n, 3) m; CoM above the mean of the feet, as high as at home or as both legs reach."""
        com, margin = mean + [0.0, 0.0, self._robot.com_height], self._robot.scale.length * _LENGTH_MARGIN
        turn = rotation_about_z(yaw)
        for side, limb in enumerate(FEET):
            leg = self._robot.legs[limb]
            ankle = position[:, side] + rotation[:, side] @ leg.ankle_in_sole
            drop = drop_to((com + turn @ leg.hip_in_com).T, ankle.T, leg.max_length - margin)
            com[:, 2] -= np.maximum(drop, 0.0)
        return com
