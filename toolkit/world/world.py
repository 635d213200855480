"""World: what the planner knows about a scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from toolkit.geometry.pose import Pose
from toolkit.world.surface import Surface
from toolkit.world.timing import Timing


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
        mjcf: text of the scene where it exists in memory only; None where `path` holds it.
    """

    name: str
    path: Path
    mujoco_model: mujoco.MjModel = field(repr=False)
    surfaces: tuple[Surface, ...] = field(repr=False)
    start: Pose
    goal: Goal
    timing: Timing
    square: tuple[float, float, float, float] = (-10.0, -10.0, 10.0, 10.0)
    mjcf: str | None = field(default=None, repr=False)
