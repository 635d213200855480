"""Contact state of the limbs while the plan is carried out."""

from __future__ import annotations

from enum import Enum

import numpy as np

from toolkit.control.sampled_plan import Reference, Swing
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.scale import USUAL, Scale

# Forces, lengths, speeds and times are those of a body of the usual size (`toolkit.robot.scale`).

# When a moving limb is taken to be in contact.
EARLY_FRACTION = 0.6  # part of the swing after which a force ends it: before, the foot still leaves its surface
EARLY_FOOT_FORCE, LATE_FOOT_FORCE = 25.0, 15.0  # N; they end a foot's swing before and after its planned end
PALM_FORCE, CONFIRM_TICKS = 3.0, 2  # N, and consecutive ticks that it must last: arms bounce
LATE_FOOT_SPEED, PALM_SPEED = 0.15, 0.08  # m/s; speeds along the inward normal after the planned end
MAX_DEPTH = 0.08  # m; how far a limb searches below the planned surface
EARLY_HEIGHT, EARLY_WAY = 0.05, 0.1  # m above its contact and along it; what touches a limb farther off is not its end

# How much force a limb in contact is asked to bear.
MIN_FOOT_FORCE, MIN_PALM_FORCE = 10.0, 2.0  # N; least forces of settled contacts, so that they stay closed
# s; times in which the bound on the normal force rises after contact is made. Plans use all of a foot's force at once:
# with 0.06 s a robot that ran down a steep slope was 0.15 m/s too fast at its end.
FOOT_RAMP, PALM_RAMP = 0.006, 0.4
RELEASE_RAMP = 0.06  # s; time in which it falls before contact is broken
SETTLE_FORCE, RELEASE_FORCE = 30.0, 5.0  # N; where the rising bound starts, and where the falling one ends
LOOSE = 0.5  # part of its least force; a limb in contact that bears less has bounced off


class LimbState(Enum):
    """What a limb does."""

    REST = "rest"
    SWING = "swing"
    SEARCH = "search"
    FREE = "free"


class ContactTracker:
    """Decides from planned times and measured forces which limbs are in contact, and how much force each may bear.

    A foot that meets the ground late in its swing rests where it is, but not where it grazes an edge on its way; one
    that has not met it in time goes on along the inward normal. A palm needs two ticks of force. The bound on the
    normal force rises after contact is made and falls before it is broken, so that forces never jump.

    Attributes:
        state: By limb, what it does.
        in_contact: (4,) bool.
        min_force, max_force: Each (4,) N; the range of the normal force at the current tick.
        depth: (4,) m; how far a searching limb has gone beyond the planned surface.
        begun, made: Each (4,) bool; swings that began and contacts that were made at this tick.
        lead: (4,) s; how far the last swing is ahead of the plan.
        pace: (4,) speed of the swings relative to the plan. A corrector may set it to end swings earlier.
        loose: (4,) bool; limbs that should be in contact but are measured to bear next to nothing.
        scale: The robot's size.
        current: By limb, the swing under way or the last one; None before the first.
    """

    def __init__(
        self,
        reference: Reference,
        limbs: tuple[Limb, ...],
        weight: float,
        max_normal_force: np.ndarray,
        scale: Scale = USUAL,
    ):
        """Start in the planned contacts.

        Args:
            reference: The plan at the control ticks.
            limbs: The limbs that the robot has.
            weight: The robot's weight in N.
            max_normal_force: (4,) N; largest normal forces.
            scale: The robot's size.
        """
        self.scale = scale
        self._cap = np.minimum(2.5 * weight, max_normal_force)
        self._pending = {limb: [swing for swing in reference.swings if swing.limb == limb] for limb in limbs}
        self.current: dict[Limb, Swing | None] = dict.fromkeys(limbs)
        self.state = {limb: LimbState.REST if reference.in_contact[0, limb] else LimbState.FREE for limb in limbs}
        self._since = np.full(4, -np.inf)
        self._loaded_ticks = np.zeros(4, int)
        self.in_contact = np.zeros(4, bool)
        self.min_force, self.max_force, self.depth = np.zeros(4), np.zeros(4), np.zeros(4)
        self.lead, self.pace = np.zeros(4), np.ones(4)
        self.begun, self.made = np.zeros(4, bool), np.zeros(4, bool)
        self.loose = np.zeros(4, bool)

    def update(self, time: float, period: float, normal_force: np.ndarray, position: np.ndarray) -> None:
        """Advance to a time in s, a period in s after the last tick.

        The limbs are measured: forces (4,) in N along their normals, positions (4, 3) in m in the world.
        """
        self.begun[:] = False
        self.made[:] = False
        for limb in self.state:
            pending = self._pending[limb]
            if pending and time >= pending[0].start - 1e-9:
                self.current[limb] = pending.pop(0)
                self.state[limb] = LimbState.SWING
                self.depth[limb], self._loaded_ticks[limb] = 0.0, 0
                self.begun[limb] = True
                self.lead[limb], self.pace[limb] = 0.0, 1.0
            swing = self.current[limb]
            if swing is not None and self.state[limb] in (LimbState.SWING, LimbState.SEARCH):
                self.lead[limb] += (self.pace[limb] - 1.0) * period
                self._advance(limb, swing, time + self.lead[limb], period, normal_force[limb], position[limb])
            self.in_contact[limb] = self.state[limb] is LimbState.REST
            self._bound(limb, time)
            self.loose[limb] = self.in_contact[limb] and normal_force[limb] < LOOSE * self.min_force[limb]

    def _advance(
        self, limb: Limb, swing: Swing, time: float, period: float, force: float, position: np.ndarray
    ) -> None:
        """Follow one limb through its swing; the given time includes its lead."""
        over = time >= swing.end - 1e-9
        if swing.contact is None:
            if over:
                self.state[limb] = LimbState.FREE
            return
        if limb.is_foot:
            met = force > self.scale.force * (LATE_FOOT_FORCE if over else EARLY_FOOT_FORCE)
        else:
            loaded = force > self.scale.force * PALM_FORCE
            self._loaded_ticks[limb] = self._loaded_ticks[limb] + 1 if loaded else 0
            met = self._loaded_ticks[limb] >= CONFIRM_TICKS
        if met and not over:
            late_enough = time - swing.start >= EARLY_FRACTION * (swing.end - swing.start)
            met = late_enough and self._there(swing.contact.pose, position)
        if met:
            self.state[limb], self._since[limb] = LimbState.REST, time - self.lead[limb]
            self.made[limb] = True
        elif over:
            self.state[limb] = LimbState.SEARCH
            depth = self.depth[limb] + self._inward_speed(limb) * period
            self.depth[limb] = min(depth, self.scale.length * MAX_DEPTH)

    def _there(self, contact: Pose, position: np.ndarray) -> bool:
        """Whether a limb at a position (3,) m that something touches may have met its contact."""
        off = position - contact.position
        height = contact.normal @ off
        way = np.linalg.norm(off - height * contact.normal)
        return bool(height <= self.scale.length * EARLY_HEIGHT and way <= self.scale.length * EARLY_WAY)

    def search_speed(self, limb: Limb) -> float:
        """Speed in m/s along the inward normal of a limb that searches its contact."""
        return 0.0 if self.depth[limb] >= self.scale.length * MAX_DEPTH else self._inward_speed(limb)

    def _inward_speed(self, limb: Limb) -> float:
        return self.scale.speed * (LATE_FOOT_SPEED if limb.is_foot else PALM_SPEED)

    def _bound(self, limb: Limb, time: float) -> None:
        """Set the range of the normal force."""
        if not self.in_contact[limb]:
            self.min_force[limb] = self.max_force[limb] = 0.0
            return
        pending, scale = self._pending[limb], self.scale
        ramp = scale.time * (FOOT_RAMP if limb.is_foot else PALM_RAMP)
        wanted = scale.force * (MIN_FOOT_FORCE if limb.is_foot else MIN_PALM_FORCE)
        share, floor = (time - self._since[limb]) / ramp, SETTLE_FORCE
        if pending and pending[0].breaks and (left := (pending[0].start - time) / (scale.time * RELEASE_RAMP)) < share:
            share, floor = left, RELEASE_FORCE
        share = min(max(share, 0.0), 1.0)
        floor = min(scale.force * floor, self._cap[limb])
        self.max_force[limb] = floor + share * (self._cap[limb] - floor)
        self.min_force[limb] = min(share * wanted, floor)
