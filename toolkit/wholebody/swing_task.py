"""The task of a swing: what its path has to connect, how far it stays away, and when its moves take place."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from toolkit.geometry.heading import mean_heading
from toolkit.geometry.pose import Pose, yaw_of
from toolkit.physics.leg import LegPosture, leg_posture
from toolkit.robot.model import LegGeometry
from toolkit.robot.scale import USUAL, Scale
from toolkit.wholebody.swing import SwingPath, Window

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
LIFT = 0.05  # m; guarded motion along the surface normal at both ends of a swing
MARGIN = 0.02  # m; kept free around the swept patch, where the start and the end leave that much
GAP = 0.02  # m; kept between the soles of the swinging and the standing foot
THICKNESS = 0.08  # m; height of the swept box above the patch, to hold the foot or the hand
SAMPLES = 33  # least number of poses per swing that are checked
SPARE = 0.005  # m; see `SwingingLeg.spare`
STRAY = 0.1  # m per m above the ankle by which the standing leg may be elsewhere than an upright base would have it


@dataclass(frozen=True)
class SwingTiming:
    """When, as fractions of a swing, the patch leaves its surface, rises, crosses, descends and lands.

    A fast crossing takes nearly the whole swing, to keep the peak velocity low.
    """

    leave: Window = Window(0.0, 0.45)
    rise: Window = Window(0.0, 0.5)
    across: Window = Window(0.05, 0.85)
    fast_across: Window = Window(0.0, 0.95)
    descend: Window = Window(0.5, 0.95)
    land: Window = Window(0.55, 1.0)


EASY = SwingTiming()
STEEP = SwingTiming(
    leave=Window(0.0, 0.3),
    rise=Window(0.0, 0.4),
    across=Window(0.2, 0.8),
    descend=Window(0.6, 1.0),
    land=Window(0.7, 1.0),
)
LATE = replace(STEEP, fast_across=Window(0.15, 0.95))
"""For swings that begin before an edge: the toes get over it with less lift, at a higher speed."""
EARLY = replace(STEEP, fast_across=Window(0.02, 0.75))
"""For swings that end below an edge: the heel is over it before it comes down."""


def leg_points(posture: LegPosture) -> np.ndarray:
    """(k, 3, 3) m; ankle, knee and hip of k postures."""
    joints = (posture.ankle_point, posture.knee_point, posture.hip_point)
    return np.stack([np.stack(np.broadcast_arrays(*point), axis=-1) for point in joints], axis=1)


@dataclass(frozen=True)
class SwingingLeg:
    """The leg of a swinging foot, and where the body is during the swing.

    Attributes:
        leg: Two-link geometry.
        u: (k,) fractions of the swing.
        com: (k, 3) m; planned CoM.
        other_yaw: rad; heading of the standing foot.
        spare: m; by which hip and ankle may come closer than the knee allows, since the base gives way by as much.
    """

    leg: LegGeometry
    u: np.ndarray
    com: np.ndarray
    other_yaw: float
    spare: float = SPARE

    def fits(self, path: SwingPath) -> bool:
        """Whether the knee can bend so much that the foot follows a path; else the base would have to give way."""
        posture = self._posture(path, path.rotations(self.u))
        return bool((self.leg.min_length - posture.length).max() < self.spare)

    def shin(self, path: SwingPath) -> tuple[np.ndarray, np.ndarray]:
        """Ankle and knee, (k, 3) m each, as the foot follows a path."""
        points = leg_points(self._posture(path, path.rotations(self.u)))
        return points[:, 0], points[:, 1]

    def _posture(self, path: SwingPath, rotations: np.ndarray) -> LegPosture:
        """Postures (k,) of the leg on a path with world_from_contact rotations (k, 3, 3)."""
        middle = mean_heading(self.other_yaw, yaw_of(rotations))
        return leg_posture(self.leg, self.com, middle, path.positions(self.u), rotations)

    def extra_pitch(self, path: SwingPath, margin: float) -> float:
        """Change of the path's pitch (rad, toes down positive) that brings the ankle into its range less a margin.

        The pitch acts as a bump over the swing. Where the bump is small the ankle is left alone.
        """
        rotations = path.rotations(self.u)
        ankle = self._posture(path, rotations).ankle_pitch
        step = path.pitching.value(self.u)
        bump = 4.0 * step * (1.0 - step)
        inside = bump > 0.2
        lower, upper = self.leg.ranges["ankle_pitch"]
        if not inside.any() or upper - lower <= 2.0 * margin:
            return 0.0
        down = float(((lower + margin - ankle)[inside] / bump[inside]).max())
        up = float(((ankle - upper + margin)[inside] / bump[inside]).max())
        return down if down > 0.0 else -max(up, 0.0)


@dataclass(frozen=True)
class StandingLeg:
    """The leg beside a swinging foot: capsules around the lines between its joints.

    Attributes:
        points: (k, 3, 3) m; ankle, knee and hip at `SAMPLES` even fractions of the swing.
        radius: (2,) m; of shin and thigh.
    """

    points: np.ndarray
    radius: np.ndarray

    def at(self, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the leg is at heights (k,) m in the world, (k, 2) m, and how thick, (k,) m; NaN where it is not.

        It counts as thicker farther up, where it may be elsewhere: it leans with the base.
        """
        place, radius = np.full((len(height), 2), np.nan), np.full(len(height), np.nan)
        for link in range(2):
            low, high = self.points[:, link], self.points[:, link + 1]
            part = (height - low[:, 2]) / np.maximum(high[:, 2] - low[:, 2], 1e-9)
            here = (part >= 0.0) & (part <= 1.0)
            place[here] = (low + part[:, None] * (high - low))[here, :2]
            radius[here] = self.radius[link] + STRAY * (height - self.points[:, 0, 2])[here]
        return place, radius


@dataclass(frozen=True)
class SwingTask:
    """What a swing has to connect.

    Attributes:
        begin, duration: s.
        start, end: world_from_contact at both ends.
        half_size: (2,) m; half extents of the patch.
        is_foot: Whether a foot swings: feet are raised along z, palms away from the wall.
        outward: Sign of a turn about z that leads the toes of a foot, and with them its knee, outward (`Limb.outward`).
        free_start, free_end: Whether the palm comes from, or goes to, the arm's free posture, where no surface is.
        other: The standing sole as (pose, half size); None for palms.
        leg: Keeps the ankle of a foot in its range; None for palms and where no other foot stands.
        lift: m; guarded motion along the surface normal at both ends.
        scale: The robot's size.
        passing: Gap in m between the soles at which the legs pass each other.
        shin: (3,) m; horizontal way of the standing leg's shin from where it is over a level sole: it keeps the gap
            too, since a foot passes it there, and not the sole.
        beside: The standing leg, which a foot may pass at any height; None for palms and where no other foot stands.
        retreat: (3,) m; by which a foot draws back while it rises.
        level: Whether a trailing foot pitches its toes down by no more than its ankle needs.
    """

    begin: float
    duration: float
    start: Pose
    end: Pose
    half_size: np.ndarray
    is_foot: bool
    outward: float = 0.0
    free_start: bool = False
    free_end: bool = False
    other: tuple[Pose, np.ndarray] | None = None
    leg: SwingingLeg | None = None
    lift: float = LIFT
    scale: Scale = USUAL
    passing: float = 0.0
    shin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    beside: StandingLeg | None = None
    retreat: np.ndarray = field(default_factory=lambda: np.zeros(3))
    level: bool = False

    @property
    def way(self) -> float:
        """m; straight from the start to the end."""
        return float(np.linalg.norm(self.end.position - self.start.position))

    @property
    def rise(self) -> float:
        """m; by which a foot has to rise or to come down, 0 of palms."""
        return abs(float(self.end.position[2] - self.start.position[2])) if self.is_foot else 0.0

    @property
    def margin(self) -> float:
        """m; kept free around the swept patch, where the start and the end leave that much."""
        return self.scale.length * MARGIN

    @property
    def gap(self) -> float:
        """m; kept between the soles of the swinging and the standing foot."""
        return max(self.scale.length * GAP, self.passing)
