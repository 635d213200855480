"""CoMs that are out of reach by rounding only.

The optimiser often ends a transition with an arm or a leg stretched to its limit. The search rounds that CoM to 1 mm,
and networks predict it within some millimetres. The next transition would then begin just out of reach, though its
dynamics allow it. Such a CoM is moved back to where all limbs reach their contacts.
"""

from __future__ import annotations

import numpy as np

from toolkit.centroidal.build import ProblemConfig
from toolkit.contacts.stance import Stance
from toolkit.geometry.pose import rotation_about_z
from toolkit.robot.model import RobotModel

SLACK = 0.01
"""m for a body of the usual size (`toolkit.robot.scale`); about the error of networks in the CoM."""
_INSIDE = 1e-6  # m by which a moved CoM is within reach
_ROUNDS = 20


def within_reach(
    robot: RobotModel,
    stance: Stance,
    com: np.ndarray,
    config: ProblemConfig | None = None,
) -> np.ndarray:
    """CoMs moved by little so that every limb reaches its contact and none is too low.

    Args:
        robot: The robot.
        stance: The contacts.
        com: (n, 3) m, world.
        config: Settings of the problems, which say how low a CoM may be; the default ones where None.

    Returns:
        (n, 3) m, world. Rows that violate nothing, are out of reach by more than `SLACK` or find no such place stay
        unchanged.
    """
    com = np.asarray(com, float)
    feet = stance.mean_feet
    turn = rotation_about_z(feet.yaw)
    centres, radii = [], []
    for contact in stance.contacts:
        limb = contact.limb
        if limb.is_foot:
            leg = robot.legs[limb]
            centres.append(contact.pose @ leg.ankle_in_sole - turn @ leg.hip_in_com)
            radii.append(leg.max_length)
        else:
            arm = robot.arms[limb]
            centres.append(contact.pose.position - turn @ arm.shoulder_in_com)
            radii.append(arm.max_reach)
    least = min(contact.pose.position[2] for contact in stance.feet)
    least += (config or ProblemConfig()).min_height * robot.com_height

    def violation(points: np.ndarray) -> np.ndarray:
        distances = np.linalg.norm(points[:, None] - np.array(centres), axis=2) - np.array(radii)
        return np.maximum(distances.max(1), least - points[:, 2])

    before = violation(com)
    rows = np.flatnonzero((before > 0.0) & (before <= robot.scale.length * SLACK))
    if not len(rows):
        return com
    moved = com[rows]
    for _ in range(_ROUNDS):
        for centre, radius in zip(centres, radii, strict=True):
            arm = moved - centre
            distance = np.linalg.norm(arm, axis=1)
            moved = centre + arm * np.minimum(1.0, (radius - _INSIDE) / distance)[:, None]
        moved[:, 2] = np.maximum(moved[:, 2], least + _INSIDE)
        if (violation(moved) <= 0.0).all():
            break
    found = violation(moved) <= 0.0
    result = com.copy()
    result[rows[found]] = moved[found]
    return result
