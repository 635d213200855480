"""What a swing has to connect, and the shape that swing paths take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.pose import Pose
from toolkit.wholebody.profile import Window
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


@dataclass(frozen=True)
class SwingConfig:
    """Shape of swing paths.

    Attributes:
        foot_lift, palm_lift: m; guarded motion along the surface normal at both ends.
        margin: m; kept free around the swept patch, where the start and the end leave that much.
        thickness: m; height of the swept box above the patch.
        raise_step, max_raise: m; what the path is raised by until it is clear, and the most it may be.
        gap: m; kept between the soles of the swinging and the standing foot.
        detour_step, max_detour: m; the same for the sideways detour around the standing foot.
        easy, steep: timing for the open, and timing that rises first, crosses then, and descends last.
        easy_raise: m; paths raised by more than that are first tried with the steep timing.
        fast_across, fast_land: windows of the crossing and the landing of feet that swing faster than `fast`: nearly
            all the time there is, to keep the peak velocity low, but the foot comes to rest along the surface before
            it meets it.
        slow, fast: m/s; mean speed up to which the window of the crossing is kept, and from which it is `fast_across`.
        pitch_gain, pitch_from, max_pitch: rad/m, m, rad; a foot that trails the standing one by more than `pitch_from`
            pitches its toes down in proportion, and more where the ankle's range asks for it.
        ankle_margin: rad; kept from the ends of the ankle's range.
        moderate_raise: m; higher paths come after lower ones with less margin.
        samples: least number of poses per swing that are checked.
        spacing: m; largest way between two of them.
    """

    foot_lift: float = 0.05
    palm_lift: float = 0.05
    margin: float = 0.02
    thickness: float = 0.08
    raise_step: float = 0.03
    max_raise: float = 0.36
    gap: float = 0.02
    detour_step: float = 0.02
    max_detour: float = 0.16
    slow: float = 1.0
    fast: float = 2.5
    easy: SwingTiming = EASY
    steep: SwingTiming = STEEP
    easy_raise: float = 0.04
    fast_across: Window = Window(0.02, 0.95)
    fast_land: Window = Window(0.7, 1.0)
    pitch_gain: float = 1.5
    pitch_from: float = 0.2
    max_pitch: float = 0.9
    ankle_margin: float = 0.15
    moderate_raise: float = 0.12
    samples: int = 33
    spacing: float = 0.03


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
