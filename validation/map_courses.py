"""Courses of the map: stairs, ramps, stones, gaps, hurdles, doors, tiles and beams in a row, with turns between."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.world.authoring import THICKNESS, WorldText
from validation.map_worlds import FRICTION, TIMING

_PARTS = 3  # of a course
_RADIUS, _CORNERS = 0.65, 16  # m; of the platforms between its parts
_WIDTH = 1.0  # m; of its parts


class _Course:
    """A course being built: where it has come to, which way it goes from there, and how high it is, in m and rad."""

    def __init__(self, comment: str, rng: np.random.Generator):
        self.text = WorldText("course", comment, FRICTION, TIMING, (0.0, 0.0, 0.0))
        self.rng, self.place, self.yaw, self.height = rng, np.zeros(2), 0.0, 0.0
        self._count = 0

    def go_on(self, length: float) -> None:
        """Go so many m ahead."""
        self.place = self.place + length * np.array([np.cos(self.yaw), np.sin(self.yaw)])

    def tile(
        self, size: tuple[float, float], ahead: float, left: float = 0.0, up: float = 0.0, turn=(0.0, 0.0, 0.0)
    ) -> None:
        """A tile whose top has its centre so far from here, in m, turned by yaw, pitch and roll in deg."""
        rotation = Rotation.from_euler("z", self.yaw) * Rotation.from_euler("zyx", turn, degrees=True)
        self.text.tile(self._name("tile"), size, self._at(ahead, left, up), rotation=rotation)

    def wall(self, size: tuple[float, float, float], ahead: float, left: float = 0.0) -> None:
        """A block that stands on the ground so far from here, in m."""
        centre = self._at(ahead, left, size[2] / 2)
        rotation = Rotation.from_euler("z", self.yaw)
        self.text.box(self._name("wall"), size, centre, material="panel", rotation=rotation)

    def platform(self) -> None:
        """A round platform from here on, to whose middle the course goes on."""
        self.go_on(_RADIUS)
        angle = self.yaw + np.arange(_CORNERS) * 2.0 * np.pi / _CORNERS
        rim = self.place + _RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
        top, bottom = (np.column_stack([rim, np.full(_CORNERS, z)]) for z in (self.height, self.height - THICKNESS))
        self.text.mesh(self._name("platform"), np.concatenate([top, bottom]), material="platform")

    def _at(self, ahead: float, left: float, up: float) -> np.ndarray:
        """(3,) m; the place so far from here."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([*(self.place + [c * ahead - s * left, s * ahead + c * left]), self.height + up])

    def _name(self, kind: str) -> str:
        self._count += 1
        return f"{kind}_{self._count}"


def _stairs(course: _Course, sign: float = 1.0) -> None:
    rise, tread = sign * course.rng.uniform(0.08, 0.16), course.rng.uniform(0.28, 0.36)
    for _ in range(course.rng.integers(2, 5)):
        course.height += rise
        course.tile((tread, _WIDTH), tread / 2)
        course.go_on(tread)
    course.height += rise


def _stairs_down(course: _Course) -> None:
    _stairs(course, -1.0)


def _ramp(course: _Course) -> None:
    angle, length = course.rng.choice([-1.0, 1.0]) * course.rng.uniform(8.0, 18.0), 1.2
    ahead, up = length * np.cos(np.radians(angle)), length * np.sin(np.radians(angle))
    course.tile((length, _WIDTH), ahead / 2, up=up / 2, turn=(0.0, -angle, 0.0))
    course.height += up
    course.go_on(ahead)


def _across(course: _Course) -> None:
    angle = course.rng.choice([-1.0, 1.0]) * course.rng.uniform(8.0, 16.0)
    course.tile((1.2, _WIDTH), 0.6, turn=(0.0, 0.0, angle))
    course.go_on(1.2)


def _stones(course: _Course) -> None:
    rng = course.rng
    for row in range(4):
        for left in (-0.2, 0.2):
            place = rng.uniform(-0.04, 0.04, 2) + [0.25 + 0.33 * row, left]
            course.tile((0.26, 0.26), *place, up=rng.uniform(-0.05, 0.05), turn=(rng.uniform(-40.0, 40.0), 0.0, 0.0))
    course.go_on(1.5)


def _tiles(course: _Course) -> None:
    rng = course.rng
    for row in range(3):
        for left in (-0.25, 0.25):
            turn = (0.0, *rng.uniform(-12.0, 12.0, 2))
            course.tile((0.42, 0.48), 0.22 + 0.44 * row, left, rng.uniform(-0.03, 0.03), turn)
    course.go_on(1.32)


def _gap(course: _Course) -> None:
    course.go_on(course.rng.uniform(0.15, 0.4))


def _hurdle(course: _Course) -> None:
    course.tile((1.0, _WIDTH), 0.5)
    course.wall((0.08, _WIDTH, course.rng.uniform(0.1, 0.18)), 0.5)
    course.go_on(1.0)


def _door(course: _Course) -> None:
    width, post = course.rng.uniform(0.8, 1.0), 0.4
    course.tile((1.0, _WIDTH), 0.5)
    for side in (-1.0, 1.0):
        course.wall((0.12, post, 2.0), 0.5, side * (width + post) / 2)
    course.go_on(1.0)


def _beam(course: _Course) -> None:
    course.tile((1.2, course.rng.uniform(0.24, 0.4)), 0.6)
    course.go_on(1.2)


_KINDS = (_stairs, _stairs_down, _ramp, _across, _stones, _tiles, _gap, _hurdle, _door, _beam)


def course(rng: np.random.Generator, turn: float) -> str:
    """Three parts of different kinds in a row, between platforms on which the way turns by `turn` deg."""
    built = _Course(f"a course that turns by {turn:g} degrees between its parts", rng)
    built.go_on(-_RADIUS)
    built.platform()
    for number, kind in enumerate(rng.permutation(len(_KINDS))[:_PARTS]):
        if number > 0:
            built.yaw += float(rng.choice([-1.0, 1.0])) * np.radians(turn)
        built.go_on(_RADIUS * float(np.cos(np.pi / _CORNERS)))
        _KINDS[kind](built)
        built.platform()
    x, y = built.place.tolist()
    built.text.goal = (x, y, built.height)
    built.text.abyss = None
    return built.text.render()
