"""Swing path: a limb's patch between two contacts, with analytic velocity and acceleration.

The path is a sum of straight moves, each smoothly timed within its own window of the swing: off the old surface along
its normal, up, across, down, and onto the new surface along its normal. A sideways bump leads a foot around the other
one. The orientation R1(t) turns about one fixed axis (slerp). A stretched ankle cannot keep a foot level that trails
far behind, so that foot also pitches its toes down on the way, by an angle phi(t) about its own y axis:

    R = R1 Ry(phi),  w = w1 + phi' R1 y,  dw/dt = dw1/dt + phi'' R1 y + phi' w1 x R1 y
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toolkit.geometry.pose import Pose, rotation_exponential, rotation_vector

MINIMUM_JERK_SHARE = 0.3


def blend(x):
    """Smooth step from 0 to 1 with zero rate at both ends, `0.3 minimum-jerk + 0.7 cubic`, for x in [0, 1].

    The mix has a lower peak velocity and acceleration than a pure minimum-jerk profile, so it is easier to track.
    Returns the value and the first and second derivative with respect to x; x is a float or (k,) float.
    """
    a, b, y = MINIMUM_JERK_SHARE, 1.0 - MINIMUM_JERK_SHARE, 1.0 - x
    value = a * x**3 * (10.0 - 15.0 * x + 6.0 * x**2) + b * x**2 * (3.0 - 2.0 * x)
    rate = a * 30.0 * x**2 * y**2 + b * 6.0 * x * y
    acceleration = (a * 60.0 * x * y + b * 6.0) * (y - x)
    return value, rate, acceleration


@dataclass(frozen=True)
class Window:
    """The part of a swing, as fractions of its duration, during which a move takes place."""

    start: float
    end: float

    def value(self, u: np.ndarray) -> np.ndarray:
        """(k,) values at (k,) fractions of the swing of a smooth step from 0 to 1 within the window."""
        return blend(np.clip((u - self.start) / (self.end - self.start), 0.0, 1.0))[0]

    def step(self, u: float) -> tuple[float, float, float]:
        """That step at one fraction with its first and second derivative with respect to u; 0 outside the window."""
        width = self.end - self.start
        x = (u - self.start) / width
        if x < 0.0:
            return 0.0, 0.0, 0.0
        if x > 1.0:
            return 1.0, 0.0, 0.0
        value, rate, acceleration = blend(x)
        return value, rate / width, acceleration / width**2

    def bump(self, u: float) -> tuple[float, float, float]:
        """A smooth bump from 0 to 1 and back, `4 s (1 - s)` of that step s, with its derivatives."""
        s, rate, acceleration = self.step(u)
        curvature = 4.0 * (1.0 - 2.0 * s) * acceleration - 8.0 * rate**2
        return 4.0 * s * (1.0 - s), 4.0 * (1.0 - 2.0 * s) * rate, curvature


@dataclass(frozen=True)
class Move:
    """A straight displacement `vector` (3,) m in the world within a window; with `returns`, out and back again."""

    vector: np.ndarray
    window: Window
    returns: bool = False


class LimbSample(NamedTuple):
    """A limb's patch at one time.

    Attributes:
        pose: world_from_contact; None for a palm that hangs free.
        velocity: (6,) m/s and rad/s; linear velocity of the patch's centre, then angular velocity, in the world. NaN
            for a free palm.
        acceleration: (6,) m/s^2 and rad/s^2; the time derivative of `velocity`.
        in_contact: Whether contact is planned.
    """

    pose: Pose | None
    velocity: np.ndarray
    acceleration: np.ndarray
    in_contact: bool


@dataclass(frozen=True)
class SwingPath:
    """Path of one patch within one swing phase.

    Attributes:
        begin: s; when the swing starts.
        duration: s.
        start, end: world_from_contact at both ends.
        moves: Together they lead from the start's position to the end's.
        turn: When the orientation changes.
        pitch: rad; largest phi.
        pitching: When the toes go down and come up again.
        clear: Whether the swept patch touches nothing of the world, as the planner of the path found.
        passes: Whether the shin above a foot touches nothing either, as that planner found.
        fits: Whether the leg can fold as much as the path asks for, as that planner found.
    """

    begin: float
    duration: float
    start: Pose
    end: Pose
    moves: tuple[Move, ...]
    turn: Window
    pitch: float = 0.0
    pitching: Window = Window(0.0, 0.8)
    clear: bool = True
    passes: bool = True
    fits: bool = True

    @cached_property
    def rotation_vector(self) -> np.ndarray:
        """(3,) rad; the world-frame rotation that turns the start's orientation into the end's."""
        return rotation_vector(self.end.rotation @ self.start.rotation.T)

    def positions(self, u: np.ndarray) -> np.ndarray:
        """(k, 3) positions at (k,) fractions of the swing."""
        points = np.repeat(self.start.position[None], len(u), 0)
        for move in self.moves:
            scale = move.window.value(u)
            scale = 4.0 * scale * (1.0 - scale) if move.returns else scale
            points = points + scale[:, None] * move.vector
        return points

    @property
    def peak_acceleration(self) -> float:
        """m/s^2; largest one of the patch's centre, by differences."""
        u = np.linspace(0.0, 1.0, 65)
        second = np.diff(self.positions(u), 2, axis=0) / (u[1] * self.duration) ** 2
        return float(np.linalg.norm(second, axis=1).max())

    def rotations(self, u: np.ndarray) -> np.ndarray:
        """(k, 3, 3) world_from_contact rotations at (k,) fractions of the swing."""
        turned = rotation_exponential(self.turn.value(u)[:, None] * self.rotation_vector) @ self.start.rotation
        step = self.pitching.value(u)
        return turned @ _about_y(self.pitch * 4.0 * step * (1.0 - step))

    @cached_property
    def _turning(self) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Angle (rad), unit axis k, and [k] R0 and [k]^2 R0 of Rodrigues' formula, where R0 is the start's rotation."""
        angle = float(np.linalg.norm(self.rotation_vector))
        axis = self.rotation_vector / angle if angle > 0.0 else np.zeros(3)
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        return angle, axis, cross @ self.start.rotation, cross @ cross @ self.start.rotation

    @cached_property
    def _vectors(self) -> np.ndarray:
        """(3, moves) displacements side by side."""
        return np.array([move.vector for move in self.moves]).reshape(-1, 3).T

    def sample(self, time: float) -> LimbSample:
        """The patch at a time in s; at rest before and after the swing."""
        u, pace = (time - self.begin) / self.duration, 1.0 / self.duration
        velocity, acceleration = np.zeros(6), np.zeros(6)
        if not 0.0 <= u <= 1.0:
            return LimbSample(self.start if u < 0.0 else self.end, velocity, acceleration, False)
        shares = [move.window.bump(u) if move.returns else move.window.step(u) for move in self.moves]
        along = self._vectors @ np.array(shares).reshape(-1, 3)  # columns: value, rate, second derivative
        velocity[:3], acceleration[:3] = along[:, 1] * pace, along[:, 2] * pace**2
        value, rate, second = self.turn.step(u)
        angle, axis, first_order, second_order = self._turning
        velocity[3:], acceleration[3:] = rate * pace * angle * axis, second * pace**2 * angle * axis
        rotation = self.start.rotation + math.sin(value * angle) * first_order
        rotation += (1.0 - math.cos(value * angle)) * second_order
        if self.pitch:
            value, rate, second = self.pitching.bump(u)
            pitch, rate, second = self.pitch * value, self.pitch * rate * pace, self.pitch * second * pace**2
            x, y, z = rotation.T
            wx, wy, wz = velocity[3:]
            turned = np.array([wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0]])  # w x y
            acceleration[3:] += second * y + rate * turned
            velocity[3:] += rate * y
            c, s = math.cos(pitch), math.sin(pitch)
            rotation = np.array([c * x - s * z, y, s * x + c * z]).T
        return LimbSample(Pose(rotation, self.start.position + along[:, 0]), velocity, acceleration, False)


def _about_y(angle: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotations about y by (...,) rad."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([np.stack([c, zero, s], -1), np.stack([zero, one, zero], -1), np.stack([-s, zero, c], -1)], -2)
