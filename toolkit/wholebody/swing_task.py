"""What a swing has to connect, and the shape that swing paths take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.pose import Pose
from toolkit.wholebody.swing import Window
from toolkit.wholebody.toe_pitch import SwingingLeg


@dataclass(frozen=True)
class SwingTiming:
    """When, as fractions of a swing, the patch leaves its surface, rises, crosses, descends and lands."""

    leave: Window = Window(0.0, 0.45)
    rise: Window = Window(0.0, 0.5)
    across: Window = Window(0.05, 0.85)
    descend: Window = Window(0.5, 0.95)
    land: Window = Window(0.55, 1.0)


EASY = SwingTiming()
STEEP = SwingTiming(Window(0.0, 0.3), Window(0.0, 0.4), Window(0.2, 0.8), Window(0.6, 1.0), Window(0.7, 1.0))


SAMPLES = 33  # least number of poses per swing that are looked at


@dataclass(frozen=True)
class SwingConfig:
    """Shape of swing paths.

    Attributes:
        foot_lift, palm_lift: m; guarded motion along the surface normal at both ends.
        margin: m; kept free around the swept patch, where the start and the end leave that much.
        gap: m; kept between the soles of the swinging and the standing foot.
    """

    foot_lift: float = 0.05
    palm_lift: float = 0.05
    margin: float = 0.02
    gap: float = 0.02


@dataclass(frozen=True)
class SwingTask:
    """What a swing has to connect.

    Attributes:
        begin, duration: s.
        start, end: world_from_contact at both ends.
        half_size: (2,) m; half extents of the patch.
        is_foot: feet are raised along z, palms away from the wall.
        free_start, free_end: the palm comes from, or goes to, the arm's free posture: no surface there.
        other: the standing sole as (pose, half size); None for palms.
        leg: of a foot, to keep the ankle in its range; None where the motion of the body is not known.
    """

    begin: float
    duration: float
    start: Pose
    end: Pose
    half_size: np.ndarray
    is_foot: bool
    free_start: bool = False
    free_end: bool = False
    other: tuple[Pose, np.ndarray] | None = None
    leg: SwingingLeg | None = None
