"""A scanned world: its text, loaded once more as every command will load it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from toolkit.scanning.building import Scene, world_text
from toolkit.scanning.places import Places, choose_places
from toolkit.world.extraction import SurfaceConfig, extract_surfaces
from toolkit.world.loader import load_world
from toolkit.world.solids import solids_of
from toolkit.world.source import read_source
from toolkit.world.world import World


@dataclass(frozen=True)
class ScanConfig:
    """How a scanned world is written.

    Attributes:
        friction: Sliding coefficient of everything.
        timing: Times of shift and swing, s; None: the planner chooses.
        start: x, y in m and perhaps the yaw in rad; None for a place that is found.
        goal: x, y in m; None for a place that is found.
    """

    friction: float = 0.5
    timing: tuple[float, float] | None = None
    start: tuple[float, ...] | None = None
    goal: tuple[float, ...] | None = None


@dataclass(frozen=True)
class ScannedWorld:
    """A world made of scans.

    Attributes:
        text: MJCF.
        world: The world as it is loaded from the text.
        scene: What it was made of.
        places: Start and goal.
    """

    text: str
    world: World
    scene: Scene
    places: Places


def make_world(scene: Scene, path: Path, comment: str, config: ScanConfig) -> ScannedWorld:
    """Write a scene as a world and load it.

    Args:
        scene: What was found.
        path: The file that the text will have; nothing is written.
        comment: What the world is, for a reader of the file.
        config: Friction, timing, start and goal.

    Raises:
        InputError: Start or goal is not on a surface for feet.
        WorldError: What was found makes no world.
    """
    draft = world_text(scene, comment, config.friction, config.timing)
    source = read_source(path, draft.render())
    low, high = (pick([pick(scan.bounds, axis=0) for scan in scene.scans], axis=0) for pick in (np.min, np.max))
    square = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    surfaces = extract_surfaces(source, solids_of(source.model, square=square), square, SurfaceConfig())
    places = choose_places(surfaces, config.start, config.goal)
    start, goal = (tuple(np.round(point, 3).tolist()) for point in (places.start, places.goal))
    text = replace(draft, start=start, goal=goal, heading=float(np.degrees(places.heading))).render()
    return ScannedWorld(text, load_world(path, mjcf=text), scene, places)
