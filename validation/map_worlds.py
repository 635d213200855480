"""Worlds of the map, which generators of `toolkit.world` make or which are made here, and moving them in the plane."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable

import mujoco
import numpy as np
from scipy.ndimage import label
from scipy.spatial.transform import Rotation
from scipy.special import expit

from toolkit.world import generators, regular
from toolkit.world.authoring import WorldText, numbers
from toolkit.world.mesh_patches import closed_block

FRICTION = 0.5
TIMING = (0.6, 0.8)  # s; shift and swing that the files name, for other users of them
BELOW = 2.0  # deg; a tile is walkable if it is so much less steep than its friction angle
LONG, SHORT = 3.0, 1.0  # m; lengths of slopes

_SHIFT, _SWING = TIMING
_WIDTH = 1.2  # m; of platforms
_FARTHEST = 100.0  # m; largest distance between a moved world and the origin
_MOST_DRAWS = 10_000  # draws of rubble until one has a walkable way
_FACET, _CELL, _APRON, _ROWS, _COLUMNS = 0.3, 0.1, 0.9, 6, 4  # m, m, m and facets; a facet has three cells a side
_SIDE = 4  # points along a facet's side
_HILLS, _POINT, _WAVES, _WAVE = (5.0, 3.0), 0.05, 3, 2.5  # m, m between points, and m of the shortest wave


def slope_length(angle: float) -> float:
    """Length of a slope of so many degrees, m: there is no time for more where no foot can rest."""
    return LONG if angle <= 30.0 else SHORT


def gap(rng: np.random.Generator, width: float) -> str:
    """Two platforms with a gap of `width` m between them."""
    return regular.gap(rng, width=width, friction=FRICTION, shift=_SHIFT, swing=_SWING)


def slope_down(rng: np.random.Generator, angle: float) -> str:
    """A slope downwards of `angle` deg."""
    return regular.slope(rng, angle=angle, length=slope_length(angle), friction=FRICTION, shift=_SHIFT, swing=_SWING)


def slope_up(rng: np.random.Generator, angle: float) -> str:
    """A slope upwards of `angle` deg."""
    return regular.slope(rng, angle=-angle, length=LONG, friction=FRICTION, shift=_SHIFT, swing=_SWING)


def slope_across(rng: np.random.Generator, angle: float) -> str:
    """Ground that falls by `angle` deg to one side, between two platforms."""
    edge = 0.4
    world = _world("slope_across", f"a slope of {angle:g} degrees to walk across", (edge + LONG + 0.8, 0.0, 0.0))
    world.platform("platform_start", (-0.8, edge), _WIDTH)
    turn = Rotation.from_euler("x", rng.choice([-1.0, 1.0]) * angle, degrees=True)
    world.tile("slope", (LONG, _WIDTH), (edge + LONG / 2, 0.0, 0.0), material="slope", rotation=turn)
    world.platform("platform_goal", (edge + LONG, edge + LONG + 1.5), _WIDTH)
    return world.render()


def stairs_up(rng: np.random.Generator, height: float) -> str:
    """Four steps upwards of `height` m, treads of 0.3 m."""
    return regular.stairs(rng, step_height=height, tread=0.3, friction=FRICTION, shift=_SHIFT, swing=_SWING)


def stairs_down(rng: np.random.Generator, height: float) -> str:
    """The same downwards."""
    return stairs_up(rng, -height)


def step_up(rng: np.random.Generator, height: float) -> str:
    """One step of `height` m upwards across level ground."""
    del rng
    edge, bottom = 0.6, min(0.0, height) - 1.0
    world = _world("step", f"a step of {height:g} m", (1.6, 0.0, height), abyss=bottom)
    for name, left, right, top in (("before", -0.8, edge, 0.0), ("after", edge, 2.4, height)):
        world.box(name, (right - left, _WIDTH, top - bottom), ((left + right) / 2, 0.0, (top + bottom) / 2))
    return world.render()


def step_down(rng: np.random.Generator, height: float) -> str:
    """The same downwards."""
    return step_up(rng, -height)


def stones(rng: np.random.Generator, gap: float, stone: float, rise: float = 0.0) -> str:
    """Level stones of `stone` m, `gap` m apart, within `rise` m of the mean height."""
    return generators.stepping_stones(
        rng, stone=stone, gap=gap, rise=rise, tilt=0.0, friction=FRICTION, shift=_SHIFT, swing=_SWING
    )


def uneven_stones(rng: np.random.Generator, gap: float, stone: float) -> str:
    """The same with heights within 8 cm of the mean."""
    return stones(rng, gap, stone, 0.08)


def beam(rng: np.random.Generator, width: float) -> str:
    """A beam of `width` m, 1.2 m long, between two platforms."""
    del rng
    edge, length = 0.45, 1.2
    world = _world("beam", f"a beam of {width:g} m", (edge + length + 0.6, 0.0, 0.0))
    world.platform("platform_start", (-0.6, edge), _WIDTH)
    world.platform("beam", (edge, edge + length), width)
    world.platform("platform_goal", (edge + length, edge + length + 1.2), _WIDTH)
    return world.render()


def bar(rng: np.random.Generator, height: float) -> str:
    """A bar of `height` m across level ground, too thin to stand on."""
    del rng
    world = _world("bar", f"a bar of {height:g} m to step over", (1.5, 0.0, 0.0))
    world.platform("ground", (-0.8, 2.3), _WIDTH)
    world.box("bar", (0.05, _WIDTH, height), (0.7, 0.0, height / 2), material="panel")
    return world.render()


def ceiling(rng: np.random.Generator, height: float) -> str:
    """A ceiling of 1 m above level ground, `height` m high."""
    del rng
    world = _world("ceiling", f"a ceiling at {height:g} m", (2.3, 0.0, 0.0))
    world.platform("ground", (-0.8, 3.1), _WIDTH)
    world.box("ceiling", (1.0, _WIDTH, 0.1), (1.2, 0.0, height + 0.05), material="panel")
    return world.render()


def door(rng: np.random.Generator, width: float, depth: float = 0.1) -> str:
    """An opening of `width` m in a wall of `depth` m."""
    del rng
    side, near = 2.4, 0.8
    world = _world("door", f"an opening of {width:g} m, {depth:g} m deep", (near + depth + 0.9, 0.0, 0.0))
    world.platform("ground", (-0.8, near + depth + 1.7), side)
    across = (side - width) / 2
    for name, sign in (("wall_left", 1.0), ("wall_right", -1.0)):
        centre = (near + depth / 2, sign * (width + across) / 2, 1.0)
        world.box(name, (depth, across, 2.0), centre, material="panel")
    return world.render()


def slot(rng: np.random.Generator, width: float) -> str:
    """The same 2 m deep."""
    return door(rng, width, 2.0)


def turn(rng: np.random.Generator, angle: float) -> str:
    """Level ground with the goal 1.5 m away, `angle` deg to the left or to the right of the heading."""
    bearing = rng.choice([-1.0, 1.0]) * np.radians(angle)
    goal = (1.5 * float(np.cos(bearing)), 1.5 * float(np.sin(bearing)), 0.0)
    world = _world("turn", f"a goal at {angle:g} degrees", goal)
    world.platform("ground", (-2.5, 2.5), 5.0)
    return world.render()


def rubble_field(rng: np.random.Generator, tilt: float, friction: float) -> str:
    """A rubble field with a walkable way; rolls and pitches of its tiles within `tilt` deg."""
    return _walkable(generators.rubble_field, rng, tilt, friction)


def rubble_corridor(rng: np.random.Generator, tilt: float, friction: float) -> str:
    """The same between walls."""
    return _walkable(generators.rubble_corridor, rng, tilt, friction)


def mesh_ground(rng: np.random.Generator, height: float) -> str:
    """Flat facets of 0.3 m with seams between them, heights within `height` m, as one mesh."""
    heights = _facet_heights(rng, height)
    world, corner = _ground("mesh_ground", height, heights)
    x, y = (low + np.arange(count) * _CELL for count, low in zip(heights.shape, corner, strict=True))
    mesh = closed_block(x, y, heights)
    world.mesh("ground", mesh.vertices, mesh.faces)
    return world.render()


def field_ground(rng: np.random.Generator, height: float) -> str:
    """The same as a height field."""
    heights = _facet_heights(rng, height)
    world, corner = _ground("field_ground", height, heights)
    world.height_field("ground", heights, _CELL, corner)
    return world.render()


def hills(rng: np.random.Generator, height: float) -> str:
    """A height field of waves of `_WAVE` m and more, together up to `height` m above and below start and goal."""
    x, y = (np.arange(-size / 2, size / 2 + 1e-9, _POINT) for size in _HILLS)
    grid_x, grid_y = np.meshgrid(x, y, indexing="ij")
    heights = np.zeros_like(grid_x)
    for _ in range(_WAVES):
        way, phase, length = rng.uniform(0.0, np.pi), rng.uniform(0.0, 2.0 * np.pi), _WAVE * rng.uniform(1.0, 1.5)
        along = grid_x * np.cos(way) + grid_y * np.sin(way)
        heights += height / _WAVES * np.sin(2.0 * np.pi * along / length + phase)
    end = _HILLS[0] / 2 - 0.6
    for middle in (-end, end):  # level there
        heights *= 1.0 - expit((0.6 - np.hypot(grid_x - middle, grid_y)) / 0.08)
    text = WorldText(
        "hills", f"hills of {height:g} m", FRICTION, TIMING, (end, 0.0, 0.0), start=(-end, 0.0, 0.0), abyss=-1.0
    )
    text.height_field("hills", heights, _POINT, (x[0], y[0]))
    return text.render()


def moved(mjcf: str, x: float, y: float, yaw: float) -> str:
    """A world turned by `yaw` rad about the z axis, then moved by `x` and `y` m: ground, start and goal together."""
    root = ET.fromstring(mjcf, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    turn = Rotation.from_euler("z", yaw)
    shift = np.array([x, y, 0.0])
    wxyz = turn.as_quat()[[3, 0, 1, 2]]
    for worldbody in root.findall("worldbody"):
        content = list(worldbody)
        for element in content:
            worldbody.remove(element)
        place = ET.SubElement(worldbody, "body", {"pos": numbers(shift), "quat": " ".join(map(repr, wxyz.tolist()))})
        place.extend(content)
    for statistic in root.findall("statistic"):
        centre = np.array(statistic.get("center", "0 0 0").split(), float)
        statistic.set("center", numbers(turn.apply(centre) + shift))
    return ET.tostring(root, encoding="unicode")


def anywhere(mjcf: str, rng: np.random.Generator) -> str:
    """A world moved by at most 100 m in a random direction and turned by any angle."""
    distance, direction, yaw = rng.uniform(0.0, _FARTHEST), *rng.uniform(-np.pi, np.pi, 2)
    return moved(mjcf, float(distance * np.cos(direction)), float(distance * np.sin(direction)), float(yaw))


def has_way(mjcf: str, friction: float) -> bool:
    """Whether tiles `tile_<row>_<column>` that are walkable lead from the first row to the last one."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    names = [model.geom(index).name for index in range(model.ngeom)]
    tiles = [index for index, name in enumerate(names) if name.startswith("tile_")]
    places = np.array([names[index].split("_")[1:] for index in tiles], int)
    normals = Rotation.from_quat(model.geom_quat[tiles], scalar_first=True).as_matrix()[:, :, 2]
    walkable = np.zeros(places.max(0) + 1, bool)
    walkable[tuple(places.T)] = np.degrees(np.arccos(normals[:, 2])) <= np.degrees(np.arctan(friction)) - BELOW
    ways = np.zeros(walkable.shape, int)
    label(walkable, np.ones((3, 3)), output=ways)
    return bool(np.intersect1d(ways[0][walkable[0]], ways[-1][walkable[-1]]).size)


def _walkable(generator: Callable[..., str], rng: np.random.Generator, tilt: float, friction: float) -> str:
    """The first draw of rubble that has a walkable way.

    Raises:
        ValueError: None of very many draws has one.
    """
    for _ in range(_MOST_DRAWS):
        text = generator(rng, tilt=tilt, friction=friction, shift=_SHIFT, swing=_SWING)
        if has_way(text, friction):
            return text
    raise ValueError(f"no rubble of {tilt:g} deg has a way for friction {friction:g}")


def _world(name: str, comment: str, goal: tuple[float, float, float], abyss: float = -1.0) -> WorldText:
    """An empty world."""
    return WorldText(name, comment, FRICTION, TIMING, goal, abyss=abyss)


def _facet_heights(rng: np.random.Generator, height: float) -> np.ndarray:
    """Heights (nx, ny) m, from 0 to `height`, over points `_CELL` apart: facets between two level aprons."""
    apron = round(_APRON / _CELL) + 1
    heights = np.zeros((2 * apron + _ROWS * _SIDE, _COLUMNS * _SIDE))
    share = np.linspace(0.0, 1.0, _SIDE)
    for row in range(_ROWS):
        for column in range(_COLUMNS):
            origin, along, across = _plane(rng)
            facet = origin + along * share[:, None] + across * share[None]
            i, j = apron + row * _SIDE, column * _SIDE
            heights[i : i + _SIDE, j : j + _SIDE] = height * facet
    return heights


def _plane(rng: np.random.Generator) -> tuple[float, float, float]:
    """Height of a facet at its first corner and its gains along x and y, all four corners from 0 to 1."""
    while True:
        origin, first, second = rng.uniform(0.0, 1.0, 3)
        if 0.0 <= first + second - origin <= 1.0:
            return origin, first - origin, second - origin


def _ground(name: str, height: float, heights: np.ndarray) -> tuple[WorldText, np.ndarray]:
    """An empty world for such a ground, and the x and y (2,) of its first point, m."""
    corner = np.array([-0.5, -(heights.shape[1] - 1) * _CELL / 2])
    end = corner[0] + (heights.shape[0] - 1) * _CELL
    comment = f"facets of {_FACET:g} m, heights within {height:g} m"
    return _world(name, comment, (float(end) - 0.5, 0.0, 0.0)), corner
