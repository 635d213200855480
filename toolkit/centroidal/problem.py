"""The centroidal momentum problem of a contact sequence, as plain arrays.

The solver, its reference, the residual check and the training data use these arrays. Time is cut into N intervals
("steps") with constant contact wrenches; knots 0..N bound them. Since the wrench is constant on an interval, the
paper's Eq. 3 integrates without discretisation error: see `toolkit.physics.momentum`. A contact transmits a force f
at its centre of pressure z and a torque tau_n about the normal there; `toolkit.physics.wrench` gives their bounds.

The objective is the paper's weighted sum of squares (Sec. IV), each step weighted by dt / 0.2 s, so that it is an
integral over time and equals the paper's sum at the paper's step:

    sum_t dt_t / 0.2 ( w_l |l_{t+1}|^2 + w_ldot |sum f + m g|^2 + w_k |k_{t+1}|^2 + w_kdot |(k_{t+1} - k_t) / dt|^2
        + sum_contacts ( w_f |f|^2 / (m g)^2 + w_tau tau_n^2 + w_lateral |f_lateral|^2 / (m g)^2
                         + w_cop |(z_x / (2 h_x), z_y / (2 h_y))|^2 ) )

with h the half extents of the patch (the paper divides by the lengths of the support region). Forces are normalised
by the weight, torques are not.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.geometry.limb import FEET
from toolkit.physics.momentum import ballistic
from toolkit.robot.scale import USUAL, Scale

CROSSING = (0.02, 0.95)  # part of a swing in which the foot moves horizontally from contact to contact
# Feet that land higher are at their highest after this part of a swing, `OVER` times as high above where they land as
# others are, from a way up of `STEEP` times that height on.
RISEN, OVER, STEEP = 0.4, 1.7, 1.7
SWING_LIFT = 0.06  # m for a body of the usual size (`toolkit.robot.scale`); see `CentroidalProblem.swing_lift`
STANDARD_GRAVITY = 9.81  # m/s^2
GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY])


def smooth_step(s: np.ndarray, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """A smooth step from 0 to 1 between two parts of a swing, and its rate, at parts s of any shape."""
    x = np.clip((s - start) / (end - start), 0.0, 1.0)
    return x * x * (3 - 2 * x), 6 * x * (1 - x) / (end - start)


@dataclass(frozen=True)
class Weights:
    """Objective weights; the defaults are the paper's (Sec. VII). Compiled code takes them in this order."""

    linear_momentum: float = 0.2
    linear_momentum_rate: float = 0.01
    angular_momentum: float = 1.0
    angular_momentum_rate: float = 0.3
    force: float = 0.01
    torque: float = 1.0
    lateral_force: float = 10.0
    cop: float = 1.0

    def scaled(self, scale: Scale) -> Weights:
        """The weights with which a body of another size moves alike; forces and the CoP are relative already."""
        if scale == USUAL:
            return self
        momentum, force, moment = scale.force * scale.speed, scale.force, scale.moment
        return replace(
            self,
            linear_momentum=self.linear_momentum / momentum**2,
            linear_momentum_rate=self.linear_momentum_rate / force**2,
            angular_momentum=self.angular_momentum / (momentum * scale.length) ** 2,
            angular_momentum_rate=self.angular_momentum_rate / moment**2,
            torque=self.torque / moment**2,
        )


@dataclass(frozen=True)
class Margins:
    """How much tighter than physics the plan's constraints are. Plan inside controller inside simulation.

    Attributes:
        friction: factor on the friction coefficient.
        cop: (2,) m taken off each half extent of a sole (scaled to at most half of it for small patches).
        yaw: factor on the friction that may be used for the yaw moment.
    """

    friction: float = 1.0
    cop: tuple[float, float] = (0.0, 0.0)
    yaw: float = 1.0

    def scaled(self, factor: float) -> Margins:
        """The same with its lengths multiplied by a factor."""
        return replace(self, cop=(factor * self.cop[0], factor * self.cop[1]))

    def within(self, half_size: np.ndarray, part: float = 1.0) -> np.ndarray:
        """(..., 2) m; the half extents of patches with `part` of the CoP margin, at most half of each, taken off."""
        return half_size - part * np.minimum(self.cop, half_size / 2)


@dataclass(frozen=True)
class ComRoom:
    """Where the world lets the CoM be at the knots of a motion.

    Attributes:
        sink: (N + 1,) m; by how much the CoM has to be lower than at home, 0 where it does not.
        knot: (n,) int; knots at which a half space holds the CoM.
        normal: (n, 3); outward unit normals of the half spaces.
        bound: (n,) m; largest part of the CoM along the normals, in the world.
    """

    sink: np.ndarray
    knot: np.ndarray
    normal: np.ndarray
    bound: np.ndarray

    def excess(self, com: np.ndarray) -> np.ndarray:
        """(n,) m; by how much a motion of the CoM (N + 1, 3) m leaves the half spaces; negative inside."""
        return (self.normal * com[self.knot]).sum(1) - self.bound


@dataclass(frozen=True)
class CentroidalProblem:
    """One motion: N steps, 4 limbs (indexed by `Limb`), world frame, SI units.

    Attributes:
        mass: kg.
        dt: (N,) s.
        active: (N, 4) bool; whether the limb is in contact during the step.
        position: (N, 4, 3) m; centre of the patch. Where not active, it is the last known one or zero.
        rotation: (N, 4, 3, 3); world_from_contact, whose z axis is the surface's normal.
        friction: (N, 4); coefficient of the surface, without margins.
        half_size: (N, 4, 2) m; half extents of what bears of the patches, without margins.
        max_normal_force: (4,) N.
        yaw: (N + 1,) rad; assumed heading of the base at each knot: the mean of the feet in contact or just left.
        com: (3,) m; initial CoM.
        com_velocity: (3,) m/s; initial velocity of the CoM.
        angular_momentum: (3,) kg m^2/s; initial angular momentum about the CoM.
        root_in_com: (4, 3) m; hip / shoulder centre relative to the CoM, in the yaw frame.
        tip_in_contact: (4, 3) m; ankle centre / palm patch in the contact frame.
        max_reach: (4,) m; bound on |root - tip| at every knot for each limb in contact in a step that touches the knot.
        min_height: m; the CoM stays at least this much above the lowest foot in contact at every knot.
        final_center, final_half_size: (3,) m; box in the world for the last CoM, along the axes of the last heading.
        final_at_rest: Whether the last CoM velocity must be zero.
        weights, margins: See the classes.
        landing_limb: Limb that makes contact at the last knot, -1 for none. Its contact bears no force in any step, but
            the last knot respects its reach and, for a foot, the least height above it.
        landing_position, landing_rotation: (3,) m and (3, 3); that contact, as in `position` and `rotation`. None
            without one.
        room: Where the world lets the CoM be; None where it does not limit it.
        lean: (N, 2) rad; how far the shin of each foot in contact may lean towards the toes until it meets the world,
            inf where nothing is there; None where nothing is anywhere.
        swing_lift: m; height of the assumed path of a foot in the air above the line between its contacts.
    """

    mass: float
    dt: np.ndarray
    active: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    friction: np.ndarray
    half_size: np.ndarray
    max_normal_force: np.ndarray
    yaw: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    angular_momentum: np.ndarray
    root_in_com: np.ndarray
    tip_in_contact: np.ndarray
    max_reach: np.ndarray
    min_height: float
    final_center: np.ndarray
    final_half_size: np.ndarray
    final_at_rest: bool
    weights: Weights = field(default_factory=Weights)
    margins: Margins = field(default_factory=Margins)
    landing_limb: int = -1
    landing_position: np.ndarray | None = None
    landing_rotation: np.ndarray | None = None
    room: ComRoom | None = None
    lean: np.ndarray | None = None
    swing_lift: float = SWING_LIFT

    @property
    def home_heights(self) -> np.ndarray:
        """(N + 1,) m; wanted heights of the CoM above the mean of the feet: the home height, less what it must sink."""
        sink = np.zeros(self.steps + 1) if self.room is None else self.room.sink
        return self.final_center[2] - self.position[-1, :2, 2].mean() + (sink[-1] - sink)

    @property
    def steps(self) -> int:
        """Number of intervals N."""
        return len(self.dt)

    @cached_property
    def knot_contacts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Contacts that must be in reach at each knot: those of the steps that touch it, and a landing at the last.

        They are (n,) knots, (n,) limbs, (n, 3) positions and (n, 3, 3) rotations, each contact once.
        """
        knot, step, limb = self._reached
        position, rotation = self.position[step, limb], self.rotation[step, limb]
        if self.landing_position is not None and self.landing_rotation is not None:
            knot, limb = np.append(knot, self.steps), np.append(limb, self.landing_limb)
            position = np.concatenate([position, self.landing_position[None]])
            rotation = np.concatenate([rotation, self.landing_rotation[None]])
        return knot, limb, position, rotation

    @cached_property
    def _reached(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(n,) knots, steps and limbs of the contacts of all steps."""
        step, limb = np.nonzero(self.active)
        first = np.ones(len(step), bool)
        later = step > 0
        first[later] = ~self.active[step[later] - 1, limb[later]]
        knot = np.concatenate([step + 1, step[first]])  # each contact at the end of its steps, and where it begins
        return knot, np.concatenate([step, step[first]]), np.concatenate([limb, limb[first]])

    @cached_property
    def knot_leans(self) -> np.ndarray:
        """(n,) rad; how far the shins over `knot_contacts` may lean, inf for palms and at the given first state."""
        leans = np.full(len(self.knot_contacts[0]), np.inf)
        if self.lean is not None:
            knot, step, limb = self._reached
            feet = np.flatnonzero((limb < len(FEET)) & (knot > 0))
            leans[feet] = self.lean[step[feet], limb[feet]]
        return leans

    @cached_property
    def lowest_foot(self) -> tuple[np.ndarray, np.ndarray]:
        """(N + 1,) m height of the lowest foot in contact around each knot, and (N + 1,) which foot; -inf without."""
        knots, limbs, positions, _ = self.knot_contacts
        height = np.full((self.steps + 1, 2), np.inf)
        feet = limbs < 2
        np.minimum.at(height, (knots[feet], limbs[feet]), positions[feet, 2])
        lowest = height.min(1)
        return np.where(np.isfinite(lowest), lowest, -np.inf), height.argmin(1)

    @cached_property
    def mean_feet(self) -> np.ndarray:
        """(N + 1, 3) m; mean of the feet in contact around each knot; zero without one."""
        knots, limbs, positions, _ = self.knot_contacts
        feet = limbs < 2
        total, count = np.zeros((self.steps + 1, 3)), np.zeros(self.steps + 1)
        np.add.at(total, knots[feet], positions[feet])
        np.add.at(count, knots[feet], 1.0)
        return total / np.maximum(count, 1.0)[:, None]

    @cached_property
    def swing_ankles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Where the ankle of a foot in the air is, on a smooth path from the contact it left to the one it will make.

        The times are the knots strictly inside swings, and the middle of a swing's first and last step, where legs are
        stretched the most. The parts are (n,) knots, (n,) s from the knot, (n,) limbs, (n, 3) ankles in the world,
        and (n, 3, 4) how they follow displacements of the contact made (2) and of that left (2) along their own axes.
        """
        parts = []
        times = self.times
        for limb in FEET:
            tip = self.position[:, limb] + self.rotation[:, limb] @ self.tip_in_contact[limb]
            edges = np.flatnonzero(np.diff(np.concatenate([[1], self.active[:, limb].astype(int), [1]])))
            for lift, land in edges.reshape(-1, 2):
                if lift == 0:
                    continue
                if land < self.steps:
                    end, turn = tip[land], self.rotation[land, limb]
                elif self.landing_limb == limb and self.landing_rotation is not None:
                    turn = self.landing_rotation
                    assert self.landing_position is not None
                    end = self.landing_position + turn @ self.tip_in_contact[limb]
                else:
                    continue
                inside = np.concatenate([np.arange(lift + 1, land), [lift, land - 1]])
                delay = np.zeros(len(inside))
                delay[-2:] = self.dt[inside[-2:]] / 2
                s = ((times[inside] + delay - times[lift]) / (times[land] - times[lift]))[:, None]
                along, _ = smooth_step(s, *CROSSING)
                way = end - tip[lift - 1]
                path = tip[lift - 1] + along * way
                path[:, 2] = tip[lift - 1, 2] + self._risen(s[:, 0], along[:, 0], float(way[2]))
                share, left = along[..., None], self.rotation[lift - 1, limb]
                tangent = np.concatenate([share * turn[:, :2], (1 - share) * left[:, :2]], 2)
                parts.append((inside, delay, np.full(len(inside), int(limb)), path, tangent))
        if not parts:
            return np.zeros(0, int), np.zeros(0), np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 3, 4))
        knots, delays, limbs, ankles, tangents = (np.concatenate(part) for part in zip(*parts, strict=True))
        return knots, delays, limbs, ankles, tangents

    def _risen(self, s: np.ndarray, along: np.ndarray, way: float) -> np.ndarray:
        """(n,) m; how high a foot is above the contact that it left, at parts of its swing and of its way, which rises.

        Feet that climb go up before they go on, and over what they climb.
        """
        steep = min(max(way / (STEEP * self.swing_lift), 0.0), 1.0)
        lift = (1.0 + steep * (OVER - 1.0)) * self.swing_lift
        flat = along * way + 4.0 * self.swing_lift * s * (1.0 - s)
        (up, _), (down, _) = smooth_step(s, 0.0, RISEN), smooth_step(s, RISEN, 1.0)
        over = up * (way + lift) - down * lift
        return (1.0 - steep) * flat + steep * over

    @property
    def reduced_half_size(self) -> np.ndarray:
        """(N, 4, 2) m; half extents that bound the CoP and the yaw moment: the CoP margin taken off, at most half."""
        return self.margins.within(self.half_size)

    @property
    def times(self) -> np.ndarray:
        """(N + 1,) s; knot times from 0."""
        return np.concatenate([[0.0], np.cumsum(self.dt)])


@dataclass(frozen=True)
class CentroidalMotion:
    """Result of an optimisation; meaningless where `feasible` is False except for `status` and `failure`.

    Attributes:
        problem: The problem that was posed.
        feasible: Whether the residual check passed; the solver's own flag is not enough.
        status: What the solver says.
        com: (N + 1, 3) m.
        linear_momentum: (N + 1, 3) kg m/s.
        angular_momentum: (N + 1, 3) kg m^2/s about the CoM.
        force: (N, 4, 3) N in the world, zero where not active.
        cop: (N, 4, 2) m in the contact frame.
        yaw_torque: (N, 4) N m about the contact's normal, at the CoP.
        objective: Value of the paper's objective, recomputed by the residual check; inf where it was not.
        seconds: Wall-clock time of the whole solution.
        iterations: Number of the solver's iterations.
        failure: The constraint that is violated most; None where feasible or not determined.
        kept: The margins that the motion keeps; None where they are those of the problem.
        landed: (N, 4, 3) m; centres of the patches where the optimiser moved them; None where they are the problem's.
    """

    problem: CentroidalProblem
    feasible: bool
    status: str
    com: np.ndarray
    linear_momentum: np.ndarray
    angular_momentum: np.ndarray
    force: np.ndarray
    cop: np.ndarray
    yaw_torque: np.ndarray
    objective: float = np.inf
    seconds: float = 0.0
    iterations: int = 0
    failure: Failure | None = None
    kept: Margins | None = None
    landed: np.ndarray | None = None

    @property
    def placed(self) -> CentroidalProblem:
        """The problem with contacts where they landed."""
        if self.landed is None:
            return self.problem
        shift = (self.landed[-1, :2] - self.problem.position[-1, :2]).mean(0)
        return replace(self.problem, position=self.landed, final_center=self.problem.final_center + shift)

    @property
    def solved(self) -> CentroidalProblem:
        """The problem that the motion solves: contacts where they landed, within the margins that it keeps."""
        return self.placed if self.kept is None else replace(self.placed, margins=self.kept)

    @property
    def outcome(self) -> str:
        """What the solver says and, where the motion failed, why; for messages."""
        return self.status if self.failure is None else f"{self.status}; {self.failure.reason}"

    def sample(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """CoM position, velocity and acceleration (3,) at a time in s, exact between knots, clamped at the ends."""
        problem, times = self.problem, self.problem.times
        time = min(max(time, 0.0), times[-1])
        step = min(int(np.searchsorted(times, time, side="right")) - 1, problem.steps - 1)
        tau = time - times[step]
        acceleration = self.force[step].sum(0) / problem.mass + GRAVITY
        velocity = self.linear_momentum[step] / problem.mass
        position = ballistic(tau, self.com[step], velocity, acceleration)
        return position, velocity + tau * acceleration, acceleration
