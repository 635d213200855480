"""Load a world: a plain MJCF file with a start, a goal and static geometry."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from toolkit.errors import WorldError
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.mjcf import warnings_refused
from toolkit.shipped import shipped
from toolkit.world.extraction import SurfaceConfig, extract_surfaces
from toolkit.world.floors import goal_floor
from toolkit.world.solids import solids_of
from toolkit.world.source import read_source
from toolkit.world.surface import Surface
from toolkit.world.timing import LONGEST, Timing
from toolkit.world.world import PALM_SITE_REACH, PALM_SITES, Goal, World

_DEFAULT = SurfaceConfig()
_ABOVE_START, _BELOW_START = 0.15, 0.3  # m; range around the height of the start in which ground is accepted
_AROUND_START = 0.25  # m; the start may be between two stones


def load_world(
    path: Path | str,
    *,
    mjcf: str | None = None,
    config: SurfaceConfig = _DEFAULT,
    progress: Callable[[float], None] = lambda share: None,
) -> World:
    """Load a world from its MJCF file.

    Args:
        path: The file, or the name of one (see `find_world`). Meshes are read from its folder; its name without ending
            is the name of the world.
        mjcf: Text to use in place of the file's content, for a world made in memory.
        config: What counts as a contact surface.
        progress: Called now and then with the share that is done, in [0, 1].

    Returns:
        The world with its surfaces.

    Raises:
        WorldError: The message is one line that names the file, the fault and the remedy.
    """
    path = find_world(Path(path)) if mjcf is None else Path(path)
    with warnings_refused(str(path), WorldError):
        source = read_source(path, mjcf, lambda share: progress(0.5 * share))
        model = source.model
        start, goal, timing = _start(path, model), _goal(path, model), _timing(path, model)
        palms = _start_palms(model)
        low = np.minimum(start.position, goal.position) - config.plane_margin
        high = np.maximum(start.position, goal.position) + config.plane_margin
        square = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
        solids = solids_of(model, square=square)
        surfaces = extract_surfaces(source, solids, square, config, lambda share: progress(0.5 + 0.5 * share))
        if not any(surface.serves_foot for surface in surfaces):
            raise WorldError(
                f"{path}: no usable surface for feet; add a static colliding geom with a free flat top of at least "
                f"{config.foot_area:g} m^2, tilted less than {np.degrees(config.foot_angle):g} degrees"
                f"{_also_feet(palms)}"
            )
        goal = replace(goal, floor=goal_floor(goal, surfaces))
        _check_ground(path, start, surfaces, palms)
        _check_walls(path, palms, surfaces, config)
        return World(path.stem, path, model, surfaces, start, goal, timing, square, source.spec, palms)


def find_world(path: Path) -> Path:
    """The file that a path means: itself, or for a plain name without such a file, the world of that name.

    Worlds are looked for in `worlds/` here, then among those that come with the toolkit.

    Raises:
        WorldError: It is a plain name, and neither a file nor a world.
    """
    if os.path.isfile(path) or len(path.parts) != 1 or path.suffix:
        return path
    folders = (Path("worlds"), shipped("worlds"))
    for folder in folders:
        if os.path.isfile(folder / f"{path}.xml"):
            return folder / f"{path}.xml"
    names = sorted({found.stem for folder in folders for found in folder.glob("*.xml")})
    raise WorldError(f"{path}: no such world file; give the path of an MJCF file, or one of {', '.join(names)}")


def _site(path: Path, model: mujoco.MjModel, name: str, example: str) -> int:
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if site < 0:
        raise WorldError(f"{path}: no site '{name}'; add {example} to the worldbody")
    return site


def _site_pose(model: mujoco.MjModel, site: int) -> Pose:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return Pose(data.site_xmat[site].reshape(3, 3).copy(), data.site_xpos[site].copy())


def _start(path: Path, model: mujoco.MjModel) -> Pose:
    """Upright pose of the start site."""
    pose = _site_pose(model, _site(path, model, "start", '<site name="start" pos="x y z"/>'))
    if pose.normal[2] < 0.5:
        raise WorldError(f"{path}: site 'start' is tilted; turn it about z only (its yaw is the heading)")
    return Pose.from_yaw(pose.position, pose.yaw)


def _goal(path: Path, model: mujoco.MjModel) -> Goal:
    example = '<site name="goal" type="cylinder" pos="x y z" size="radius height"/>'
    site = _site(path, model, "goal", example)
    if model.site_type[site] != mujoco.mjtGeom.mjGEOM_CYLINDER:
        raise WorldError(f"{path}: site 'goal' is not a cylinder; write it as {example}")
    radius = float(model.site_size[site, 0])
    if not radius > 0.0:
        raise WorldError(f"{path}: site 'goal' has radius {radius:g}; give a radius above zero in metres")
    return Goal(_site_pose(model, site).position, radius)


def _timing(path: Path, model: mujoco.MjModel) -> Timing | None:
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, "transition_timing")
    if index < 0:
        return None
    first, count = int(model.numeric_adr[index]), int(model.numeric_size[index])
    values = model.numeric_data[first : first + count]
    if count != 2 or not ((0.0 < values) & (values <= LONGEST)).all():
        raise WorldError(
            f"{path}: numeric 'transition_timing' is '{' '.join(f'{value:g}' for value in values)}'; "
            f"give two times in seconds above zero and at most {LONGEST:g}: shift and swing"
        )
    return Timing(float(values[0]), float(values[1]))


def _start_palms(model: mujoco.MjModel) -> dict[Limb, np.ndarray]:
    """Points (3,) m at which palms start in contact, by their sites."""
    sites = {limb: mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name) for limb, name in PALM_SITES.items()}
    return {limb: _site_pose(model, site).position for limb, site in sites.items() if site >= 0}


def _also_feet(palms: dict[Limb, np.ndarray]) -> str:
    """A reminder for a world whose robot starts on its palms."""
    return "; a robot that starts with its palms in contact needs ground for both feet too" if palms else ""


def _check_walls(
    path: Path, palms: dict[Limb, np.ndarray], surfaces: tuple[Surface, ...], config: SurfaceConfig
) -> None:
    """Raise where a palm that starts in contact has no surface near its site."""
    walls = [surface for surface in surfaces if surface.serves_palm]
    for limb, point in palms.items():
        name, at = PALM_SITES[limb], f"({point[0]:.3g}, {point[1]:.3g}, {point[2]:.3g})"
        if not walls:
            low, high = np.degrees([config.palm_angle_min, config.palm_angle_max])
            raise WorldError(
                f"{path}: site '{name}' asks for a palm on a wall, but the world has none: no surface whose normal is "
                f"{low:g} to {high:g} degrees from up; add a wall beside the start, or remove the site"
            )
        distance = min(float(np.linalg.norm(wall.nearest_point(point) - point)) for wall in walls)
        if distance > PALM_SITE_REACH:
            raise WorldError(
                f"{path}: site '{name}' at {at} is {distance:.2f} m from the nearest surface for palms; move it within "
                f"{PALM_SITE_REACH:g} m of one, add a wall there, or remove the site"
            )


def _check_ground(path: Path, start: Pose, surfaces: tuple[Surface, ...], palms: dict[Limb, np.ndarray]) -> None:
    """Raise where no surface for feet lies under the start or close beside it."""
    angles = np.arange(8) * np.pi / 4
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    spots = start.position[:2] + np.concatenate([[[0.0, 0.0]], _AROUND_START / 2 * ring, _AROUND_START * ring])
    x, y, z = start.position
    rises = np.concatenate([surface.height(spots) - z for surface in surfaces if surface.serves_foot] or [[np.nan]])
    if ((rises <= _ABOVE_START) & (rises >= -_BELOW_START)).any():
        return
    name, remedy = f"{path}: site 'start' at ({x:.3g}, {y:.3g}, {z:.3g})", f"move it onto the ground{_also_feet(palms)}"
    if np.isnan(rises).all():
        raise WorldError(f"{name} is beside the ground: no surface for feet under it or above it; {remedy}")
    rise = rises[np.nanargmin(np.abs(rises))]
    where = "under the ground" if rise > 0.0 else "in the air"
    raise WorldError(f"{name} is {where}: the nearest surface for feet is at z = {z + rise:.3g} m; {remedy}")
