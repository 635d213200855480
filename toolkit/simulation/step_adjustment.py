"""StepAdjuster: feet land where a disturbed CoM needs them, within their surfaces."""

from __future__ import annotations

import numpy as np
import shapely

from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel
from toolkit.simulation.config import StepAdjustmentConfig
from toolkit.simulation.dynamics import RobotDynamics
from toolkit.simulation.limb_target import LimbTargets
from toolkit.simulation.reference import Reference
from toolkit.simulation.touchdown import ContactTracker, LimbState
from toolkit.world.surface import Surface


class StepAdjuster:
    """Moves the landing point of the foot in the air by the divergence of the CoM from its plan.

        xi = (c - c_ref) + (v - v_ref) / omega

    is where the CoM of a pendulum of frequency omega would come to rest beyond its plan; a foot that lands xi further
    carries the planned motion on from there. The shift stays on the contact's surface with the whole sole, clear of the
    other foot, and moves at a bounded speed during the first part of the swing. The planned CoM then follows the feet
    that carry it: by the mean of their shifts, weighted with the planned normal forces.

    Attributes:
        com_offset, com_offset_velocity: (3,) m and m/s; to be added to the planned CoM.
        shifts: (4, 3) m; of each foot's present contact, or zero.
    """

    def __init__(
        self, reference: Reference, surfaces: tuple[Surface, ...], robot: RobotModel, config: StepAdjustmentConfig
    ):
        self._reference, self._surfaces, self._config = reference, surfaces, config
        self._half_sizes = robot.half_sizes
        self._regions: dict[int, shapely.Polygon] = {}
        self._goal, self.shifts = np.zeros((4, 3)), np.zeros((4, 3))
        self.com_offset, self.com_offset_velocity = np.zeros(3), np.zeros(3)

    def update(
        self, index: int, period: float, dynamics: RobotDynamics, tracker: ContactTracker, targets: LimbTargets
    ) -> None:
        """Move the landing point of the feet in the air, in `targets.shift`.

        Args:
            index: row of the reference.
            period: s since the last tick.
            dynamics: measured state.
            tracker: contact states at this tick.
            targets: whose shifts are set.
        """
        reference, config = self._reference, self._config
        self._follow_feet(index, period)
        for foot in FEET:
            if tracker.begun[foot]:
                self._goal[foot] = 0.0
            if tracker.made[foot]:
                self.shifts[foot] = targets.shift[foot]
            swing = tracker.current[foot]
            if swing is None or swing.contact is None or tracker.state[foot] is not LimbState.SWING:
                targets.shift_velocity[foot] = 0.0
                continue
            share = (reference.times[index] - swing.start) / (swing.end - swing.start)
            if swing.end - swing.start <= config.max_swing + 1e-9 and share <= config.fraction:
                self._choose(foot, swing.contact, self._divergence(index, dynamics), dynamics)
            step = self._goal[foot] - targets.shift[foot]
            length = float(np.linalg.norm(step))
            most = config.slew * period
            if length > most:
                step *= most / length
            targets.shift[foot] += step
            targets.shift_velocity[foot] = step / period

    def _divergence(self, index: int, dynamics: RobotDynamics) -> np.ndarray:
        """(3,) m; xi, horizontal, less the deadband, at most as long as the largest shift."""
        reference, config = self._reference, self._config
        xi = dynamics.com - reference.com[index] - self.com_offset
        rate = dynamics.com_velocity - reference.com_velocity[index] - self.com_offset_velocity
        xi = xi + rate / config.frequency
        xi[2] = 0.0
        length = float(np.hypot(xi[0], xi[1]))
        if length <= config.deadband:
            return np.zeros(3)
        return xi * (min(length - config.deadband, config.max_shift) / length)

    def _choose(self, foot: Limb, contact: Contact, wanted: np.ndarray, dynamics: RobotDynamics) -> None:
        """Take the largest part of a wanted shift that lands on the surface and clear of the other foot."""
        pose = contact.pose
        if contact.surface < 0:
            return
        slope = wanted - np.array([0.0, 0.0, (wanted @ pose.normal) / pose.normal[2]])
        for part in (1.0, 0.75, 0.5, 0.25):
            shift = part * slope
            if not shift.any() or self._lands(foot, contact, shift, dynamics):
                self._goal[foot] = shift
                return
        self._goal[foot] = 0.0

    def _lands(self, foot: Limb, contact: Contact, shift: np.ndarray, dynamics: RobotDynamics) -> bool:
        """Whether the shifted sole is inside its surface and beside the other sole."""
        config, pose, half = self._config, contact.pose, self._half_sizes[foot]
        corners = np.array([[a, b, 0.0] for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]) * np.r_[half, 0.0]
        points = corners @ pose.rotation.T + pose.position + shift
        surface = self._surfaces[contact.surface]
        region = self._regions.get(surface.index)
        if region is None:
            region = shapely.Polygon(surface.boundary[0], surface.boundary[1:]).buffer(-config.margin)
            shapely.prepare(region)
            self._regions[surface.index] = region
        local = (points - surface.pose.position) @ surface.pose.rotation
        if not region.contains(shapely.Polygon(local[:, :2])):
            return False
        other = foot.mirrored
        standing = corners @ dynamics.limb_rotation[other].T + dynamics.limb_position[other]
        gap = shapely.distance(shapely.Polygon(points[:, :2]), shapely.Polygon(standing[:, :2]))
        return bool(gap >= config.gap)

    def _follow_feet(self, index: int, period: float) -> None:
        """Let the CoM's offset follow the feet that carry the plan."""
        load = np.maximum(self._reference.wrench[index, :2, 2], 0.0)
        total = float(load.sum())
        wanted = load @ self.shifts[:2] / total if total > 0.0 else self.com_offset
        self.com_offset_velocity = self._config.frequency * (wanted - self.com_offset)
        self.com_offset = self.com_offset + period * self.com_offset_velocity
