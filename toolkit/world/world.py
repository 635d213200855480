"""The world as the planner knows it."""

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
"""Largest distance from the site of a palm that starts in contact to its surface, m."""


@dataclass(frozen=True)
class Goal:
    """The goal is reached when the mean of the feet is within `radius` of `position` in xy, and on its floor.

    Attributes:
        position: (3,) m.
        radius: m.
        floor: m; the feet's mean is no lower and no higher. Infinite where there is only one floor.
    """

    position: np.ndarray
    radius: float
    floor: tuple[float, float] = (-np.inf, np.inf)

    def distance(self, place: np.ndarray) -> np.ndarray:
        """(...,) m; how far places (..., 3) m are from the middle in xy; off the floor more than the radius, too."""
        away = np.hypot(place[..., 0] - self.position[0], place[..., 1] - self.position[1])
        off = np.maximum(self.floor[0] - place[..., 2], place[..., 2] - self.floor[1])
        return np.where(off > 0.0, np.maximum(away, self.radius) + off, away)

    def on_floor(self, height: np.ndarray, slack: float = 0.0) -> np.ndarray:
        """(...,) bool; whether heights (...,) m are those of its floor, or beyond it by no more than a slack in m."""
        return (height >= self.floor[0] - slack) & (height <= self.floor[1] + slack)


@dataclass(frozen=True)
class World:
    """A loaded scene.

    Attributes:
        name: File name without ending.
        path: The MJCF file.
        mujoco_model: The scene compiled alone (static geoms only), for ray casting, collision and drawing.
        surfaces: Contact surfaces, `surfaces[i].index == i`.
        start: Upright pose of the point between the feet at the start, as authored, not projected.
        goal: Goal region.
        timing: Shift and swing time of a transition; None: the planner chooses.
        square: Infinite planes are cut to this (xmin, ymin, xmax, ymax), m, wherever they are drawn or listed.
        scenery: The scene as it was read, to be combined with a robot.
        start_palms: Points (3,), m, by palm that starts in contact, each on the surface nearest to its point; empty if
            the robot starts on its feet alone.
    """

    name: str
    path: Path
    mujoco_model: mujoco.MjModel = field(repr=False)
    surfaces: tuple[Surface, ...] = field(repr=False)
    start: Pose
    goal: Goal
    timing: Timing | None
    square: tuple[float, float, float, float] = (-10.0, -10.0, 10.0, 10.0)
    scenery: mujoco.MjSpec = field(default_factory=mujoco.MjSpec, repr=False)
    start_palms: Mapping[Limb, np.ndarray] = field(default_factory=dict)
