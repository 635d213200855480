"""World: what the planner knows about a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from toolkit.geometry.limb import PALMS, Limb
from toolkit.geometry.pose import Pose
from toolkit.world.surface import Surface
from toolkit.world.timing import Timing

PALM_SITES = {limb: f"start_{limb.label}" for limb in PALMS}
"""Names of the sites at which palms start."""
PALM_SITE_REACH = 0.3
"""m; farthest that the surface of a palm that starts in contact may be from its site."""


@dataclass(frozen=True)
class Goal:
    """Reached when the mean of the feet is within `radius` of `position` in XY."""

    position: np.ndarray
    radius: float


@dataclass(frozen=True)
class World:
    """A loaded scene.

    Attributes:
        name: file name without ending.
        path: the MJCF file.
        mujoco_model: the scene compiled alone (static geoms only; for ray casting, collision, drawing).
        surfaces: contact surfaces, `surfaces[i].index == i`.
        start: upright pose of the point between the feet at the start (as authored, not projected).
        goal: goal region.
        timing: shift and swing time of a transition.
        square: (xmin, ymin, xmax, ymax), m; infinite planes are cut to it wherever they are drawn or listed.
        scenery: the scene as it was read, to be put together with a robot.
        start_palms: palm -> (3,) m; palms that start in contact, each on the surface nearest to its point; empty: the
            robot starts on its feet alone.
    """

    name: str
    path: Path
    mujoco_model: mujoco.MjModel = field(repr=False)
    surfaces: tuple[Surface, ...] = field(repr=False)
    start: Pose
    goal: Goal
    timing: Timing
    square: tuple[float, float, float, float] = (-10.0, -10.0, 10.0, 10.0)
    scenery: mujoco.MjSpec = field(default_factory=mujoco.MjSpec, repr=False)
    start_palms: Mapping[Limb, np.ndarray] = field(default_factory=dict)
