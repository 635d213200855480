"""How far a swinging foot must pitch its toes for the ankle to stay inside its range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.heading import mean_heading
from toolkit.geometry.pose import yaw_of
from toolkit.physics.leg import leg_posture
from toolkit.robot.model import LegGeometry
from toolkit.wholebody.swing import SwingPath


@dataclass(frozen=True)
class SwingingLeg:
    """The leg of a swinging foot and where its body is meanwhile.

    Attributes:
        leg: two-link geometry.
        u: (k,) fractions of the swing.
        com: (k, 3) m; planned CoM.
        other_yaw: rad; heading of the standing foot.
    """

    leg: LegGeometry
    u: np.ndarray
    com: np.ndarray
    other_yaw: float

    def extra_pitch(self, path: SwingPath, margin: float) -> float:
        """Change of the path's pitch (rad, toes down positive) that brings the ankle into its range less a margin.

        The pitch acts as a bump over the swing: where the bump is small the ankle is left alone.
        """
        rotations = path.rotations(self.u)
        middle = mean_heading(self.other_yaw, yaw_of(rotations))
        ankle = leg_posture(self.leg, self.com, middle, path.positions(self.u), rotations).ankle_pitch
        step = path.pitching.value(self.u)
        bump = 4.0 * step * (1.0 - step)
        inside = bump > 0.2
        lower, upper = self.leg.ranges["ankle_pitch"]
        if not inside.any() or upper - lower <= 2.0 * margin:
            return 0.0
        down = float(((lower + margin - ankle)[inside] / bump[inside]).max())
        up = float(((ankle - upper + margin)[inside] / bump[inside]).max())
        return down if down > 0.0 else -max(up, 0.0)
