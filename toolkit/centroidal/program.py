"""The centroidal problem as an optimal-control program: stages of states and controls (`layout.Layout`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.centroidal.body import BodyMargins, rough_com
from toolkit.centroidal.layout import (
    Landing,
    Layout,
    contact_block,
    indices,
    side_by_side,
    single_bounds,
    slack_prices,
    start_slacks,
)
from toolkit.centroidal.leg_momentum import ground_share, leg_spin
from toolkit.centroidal.problem import STANDARD_GRAVITY, CentroidalProblem, ComRoom, Margins
from toolkit.centroidal.stages.blocks import Block
from toolkit.centroidal.stages.method import Blocks, Prices
from toolkit.centroidal.stages.rows import DISTANCE_ROWS, FINAL_ROWS, LEG_ROWS, MARGINS, STRETCH, TORQUE_ROWS
from toolkit.centroidal.stages.steps import STATE, Steps
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rotation_about_z, steepness
from toolkit.physics.leg import PLANNED, TORQUE_ROLES, ReachMargins
from toolkit.robot.model import LegGeometry, RobotModel
from toolkit.robot.scale import USUAL, Scale

# Margins that plans of a body of the usual size (`toolkit.robot.scale`) keep unless nothing else is feasible: without
# them, slides and tilts cannot be corrected.
LEAST = Margins(friction=0.96, cop=(0.01, 0.01), yaw=0.95)
SCALE = 1e-2  # factor on the objective inside the program
BRIEF = 0.02  # s for a body of the usual size; shorter steps have the price of jerk of this one
# Where a foot at rest already uses more of its friction than the wanted margin leaves, it may use `RESERVE` more than
# at rest, at most `FULL`. Otherwise the motion would lean and run to spare friction, which is less safe.
RESERVE, FULL = 0.1, 0.9
# Where nothing rests all friction is in use, and what a force that comes late leaves undone cannot be made up for. So
# the price of jerk is so many times as high in motions that slide somewhere, which they are over soon.
SMOOTH = 10.0
_LEAN = 2 * [limit.quantity for limit in PLANNED].index("ankle_pitch")  # lower end of it in `leg_limits`
NARROW, STIFF = 1e-6, 1e12  # m and its price; a landing point with less room along an axis does not move along it


@dataclass(frozen=True)
class Regularisers:
    """Small terms beside the paper's objective that make a plan easy to execute; each an integral like the objective's.

    The numbers are those for a body of the usual size (`toolkit.robot.scale`).

    Attributes:
        jerk: Weight of (change of CoM acceleration from step to step / dt)^2.
        height: Weight of the CoM's distance from home height above the feet, m^2.
        cop: Weight of the CoP's distance from the middle of the patch over the patch's size, times the load over the
            usual load of the limb: the weight, or `palm_force`. It matters in slow gaits, whose momenta cost little and
            where a CoP near the edge is risky, and for palms.
        load: Weight of the normal force (in weights) of a foot in the step after it lands or before it lifts.
        palm: Weight of the distance (in weights) of a palm's normal force from `palm_force`.
        palm_force: Wanted normal force of a palm in weights; a palm that only touches is useless and hard to control.
        final_center: Weight of the distance of the last CoM from the mean of the feet, m^2.
        final_acceleration: Weight of the last CoM acceleration, m^2/s^4.
        final_spin: Weight of the last angular momentum per mass, m^4/s^2.
        landing: Weight of the displacement of a landing point, m^2.
        slack: Price of taking back a margin of a fully loaded contact, or of the body, for 0.2 s.
        excess: Price of going as far beyond the least margins, or a physical limit, in multiples of `slack`.
    """

    jerk: float = 0.02
    height: float = 400.0
    load: float = 20.0
    palm: float = 1000.0
    palm_force: float = 0.075
    cop: float = 200.0
    final_center: float = 20000.0
    final_acceleration: float = 20.0
    final_spin: float = 200.0
    landing: float = 300.0
    slack: float = 3000.0
    excess: float = 60.0

    def scaled(self, scale: Scale) -> Regularisers:
        """The terms with which a body of another size moves alike.

        The objective is an integral over time, and so longer for a larger body; what is no integral follows it.
        """
        if scale == USUAL:
            return self
        area = scale.length**2
        return replace(
            self,
            jerk=self.jerk * scale.length,
            height=self.height / area,
            final_center=self.final_center * scale.time / area,
            final_acceleration=self.final_acceleration * scale.time,
            final_spin=self.final_spin * scale.time / (area * scale.length),
            landing=self.landing * scale.time / area,
        )


class Program:
    """Blocks, bounds and structure of one problem.

    Args:
        problem: The problem, with the wanted margins.
        robot: The robot, for the limits of the body.
        body: Wanted margins of the body, which are scaled with the robot.
        regularisers: Weights of the regularisers, which are too.
        landings: Where contacts may move; None where they stay.

    Attributes:
        layout: Where the variables are.
        steps: Dynamics and momentum objective.
        prices: Prices of single variables.
        blocks: Constraints.
    """

    def __init__(
        self,
        problem: CentroidalProblem,
        robot: RobotModel,
        body: BodyMargins,
        regularisers: Regularisers,
        landings: Sequence[Landing] | None = None,
    ):
        self.problem, self.robot, self._scale = problem, robot, robot.scale
        self._body, self._regularisers = body.scaled(self._scale.length), regularisers.scaled(self._scale)
        self._landings = list(landings or ())
        self.layout = Layout.of(problem.active, None if landings is None else [item.step for item in landings])
        self._heading = rotation_about_z(problem.yaw)
        self._middle_heading = rotation_about_z((problem.yaw[:-1] + problem.yaw[1:]) / 2)
        self._weight = problem.mass * STANDARD_GRAVITY
        self.steps = self._steps()
        self.prices = self._prices()
        self.blocks = Blocks(
            self._contacts(),
            self._legs(),
            self._torques(),
            self._distances(),
            self._heights(),
            self._final(),
            self._bounds(),
        )

    def finite(self) -> bool:
        """Whether all numbers of the program are finite."""
        arrays = [block.parameters for block in self.blocks] + [self.steps.rotation, self.steps.position, self.steps.dt]
        return all(np.isfinite(array).all() for array in arrays)

    def _steps(self) -> Steps:
        """Dynamics and momentum objective of the steps."""
        p, w, reg, layout = self.problem, self.problem.weights, self._regularisers, self.layout
        step, limb = np.nonzero(p.active)
        duration = p.dt / 0.2
        momenta = w.linear_momentum, w.linear_momentum_rate, w.angular_momentum, w.angular_momentum_rate
        squares = [weight * p.mass**2 * duration for weight in momenta]
        jerk = reg.jerk / (0.2 * np.maximum(p.dt, self._scale.time * BRIEF))
        resting = p.active & (steepness(p.rotation[..., 2, 2]) < LEAST.friction * p.friction)
        jerk = jerk if resting.any(1).all() else SMOOTH * jerk
        squares = np.stack([*squares, jerk, reg.height * duration], 1)
        squares[0, 4] *= not np.any(p.com_velocity)  # the acceleration before a start in motion is unknown
        height = p.mean_feet[:, 2] + p.home_heights
        return Steps(
            dt=np.ascontiguousarray(p.dt, float),
            first=np.searchsorted(step, np.arange(p.steps + 1)),
            wrench=layout.wrench[step, limb],
            pair=layout.displaced(limb),
            rotation=np.ascontiguousarray(p.rotation[step, limb]),
            position=np.ascontiguousarray(p.position[step, limb]),
            weights=SCALE * squares,
            height=np.ascontiguousarray(height[1:]),
            source=layout.sources(self._landings),
            turning=self._turning(),
        )

    def _turning(self) -> np.ndarray:
        """(N, 3) m^2/s^2; rate of the part of the legs' angular momentum that trunk and arms leave to the ground."""
        share = ground_share(self.robot)
        if share == 0.0:
            return np.zeros((self.problem.steps, 3))
        com, velocity = rough_com(self.problem)
        spin = leg_spin(self.problem, self.robot, com, velocity)
        return share * np.diff(spin, axis=0) / self.problem.dt[:, None]

    @property
    def slack_price(self) -> np.ndarray:
        """(N,) price of a slack in each step."""
        return SCALE * self._regularisers.slack * self.problem.dt / 0.2

    def start_slacks(self, y: np.ndarray, gap: float, most: float) -> None:
        """See the function of the same name."""
        excess = self._regularisers.excess
        start_slacks(y, self.layout, self.problem.active, self.slack_price, excess, gap, most)

    def _prices(self) -> Prices:
        """Prices of the excess, the body's slack and of landing points."""
        at = np.repeat([item.step for item in self._landings], 2).astype(int)
        moved = indices(self.layout.landing[at[::2]], 2).ravel()
        room = [np.subtract(item.upper, item.lower) for item in self._landings]
        narrow = np.reshape(room, len(at)) < NARROW
        weight = np.where(narrow, STIFF, SCALE * self._regularisers.landing)
        landings = Prices(at, moved, np.zeros(len(at)), weight, np.zeros(len(at)))
        return Prices.joined([slack_prices(self.layout, self.slack_price, self._regularisers.excess), landings])

    def _contacts(self) -> Block:
        """Cones of the contacts."""
        p, w, reg = self.problem, self.problem.weights, self._regularisers
        step, limb = np.nonzero(p.active)
        foot = limb < len(FEET)
        on = np.pad(p.active, ((1, 1), (0, 0)), constant_values=True)
        changes = (p.active & (~on[:-2] | ~on[2:]))[step, limb]
        usual = np.where(foot, 1.0, reg.palm_force)
        press = np.where(foot, np.where(changes, reg.load, 0.0), reg.palm)
        squares = np.empty((len(step), 6))
        squares[:, :4] = w.force, w.lateral_force, w.torque * self._weight**2, w.cop
        squares[:, 4], squares[:, 5] = reg.cop / usual**2, press
        weights = np.sqrt(SCALE * p.dt[step, None] / 0.2 * squares)
        cop = (p.half_size - p.reduced_half_size)[step, limb]
        friction = np.full(len(step), p.margins.friction)
        friction[foot] = wanted_friction(p, step[foot], limb[foot])
        wanted = friction[:, None], cop, [p.margins.yaw]
        least_cop = np.minimum(LEAST.scaled(self._scale.length).cop, cop)
        least = [max(LEAST.friction, p.margins.friction)], least_cop, [max(LEAST.yaw, p.margins.yaw)]
        load, price = np.where(foot, 0.0, reg.palm_force), self.slack_price[step]
        given = p.friction[step, limb][:, None], p.half_size[step, limb]
        parts = *given, *wanted, *least, weights, load[:, None], price[:, None]
        return contact_block(self.layout, p.active, side_by_side(len(step), *parts))

    def _legs(self) -> Block:
        """Limits of stance legs at the knots."""
        knots, limbs, positions, rotations = self.problem.knot_contacts
        leans, parts = self.problem.knot_leans, []
        for limb in FEET:
            leg = self.robot.legs[limb]
            here = np.flatnonzero(limbs == limb)
            at, rotation = knots[here], rotations[here]
            ankle = positions[here] + rotation @ leg.ankle_in_sole
            posture = _posture_parameters(leg, self._heading[at], ankle, rotation)
            limits = np.tile(leg_limits(leg, self._body), (len(at), 1))
            limits[:, _LEAN] = np.maximum(limits[:, _LEAN], -leans[here])
            parameters = side_by_side(len(at), *posture, limits)
            parts.append((at, self.layout.legs(at, limb), parameters))
        return _joined(parts, LEG_ROWS)

    def _torques(self) -> Block:
        """Joint torques of stance legs in the middle of the steps."""
        p, parts = self.problem, []
        for limb in FEET:
            leg, step = self.robot.legs[limb], np.flatnonzero(p.active[:, limb])
            sole, rotation = p.position[step, limb], p.rotation[step, limb]
            limits = [leg.torques[role] / self._weight for role in TORQUE_ROLES]
            ankle, used = sole + rotation @ leg.ankle_in_sole, [self._body.torque, self._body.most_torque]
            posture = _posture_parameters(leg, self._middle_heading[step], ankle, rotation)
            parameters = side_by_side(len(step), p.dt[step, None] / 2, *posture, sole, limits, used)
            parts.append((step, self.layout.torques(step, limb), parameters))
        return _joined(parts, TORQUE_ROWS)

    def _distances(self) -> Block:
        """Lengths of legs whose foot is in the air, and of arms in contact."""
        parts = []
        knots, delays, limbs, tips, tangents = self.problem.swing_ankles
        for limb in FEET:
            leg, here = self.robot.legs[limb], limbs == limb
            root = (self._heading @ leg.hip_in_com)[knots[here]]
            span = leg.min_length, leg.max_length
            parts.append(self._distance(knots[here], delays[here], root, tips[here], span, limb, tangents[here]))
        knots, limbs, tips, _ = self.problem.knot_contacts
        for limb, arm in self.robot.arms.items():
            here = np.flatnonzero(limbs == limb)
            if not len(here):
                continue
            root, span = (self._heading @ arm.shoulder_in_com)[knots[here]], (arm.min_reach, arm.max_reach)
            none = np.zeros((len(here), 3, 4))
            parts.append(self._distance(knots[here], np.zeros(len(here)), root, tips[here], span, FEET[0], none))
        return _joined(parts, DISTANCE_ROWS)

    def _distance(
        self,
        knot: np.ndarray,
        delay: np.ndarray,
        root: np.ndarray,
        tip: np.ndarray,
        span: tuple[float, float],
        foot: Limb,
        tangents: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stages, variables and parameters of bounds on the distance from roots to tips; see `rows.fill_distances`."""
        parts = [delay[:, None], root, tip, [*span, self._body.length]]
        if self.layout.moving:
            parts.append(tangents.reshape(len(knot), 12))
        return knot, self.layout.distances(knot, foot), side_by_side(len(knot), *parts)

    def _heights(self) -> Block:
        """Least height of the CoM at the knots."""
        p = self.problem
        floor, lowest = p.lowest_foot
        at = np.flatnonzero(np.isfinite(floor))
        rises = p.rotation[np.minimum(at, p.steps - 1), lowest[at], 2, :2][:, : 2 * self.layout.moving]
        parameters = side_by_side(len(at), floor[at, None] + p.min_height, [self._body.height], rises)
        return Block.of(at, self.layout.heights(at, lowest[at]), parameters, 1)

    def _final(self) -> Block:
        """Box and price of the last state."""
        p, reg = self.problem, self._regularisers
        weights = SCALE * np.array([reg.final_center, reg.final_acceleration, reg.final_spin])
        heading = np.cos(p.yaw[-1]), np.sin(p.yaw[-1])
        variables, parameters = np.arange(STATE), np.concatenate([p.final_center, p.final_half_size, heading, weights])
        if self.layout.moving:
            variables = np.concatenate([variables, *(self.layout.pair(foot) for foot in FEET)])
            tangents = np.concatenate([p.rotation[-1, foot, :, :2] / 2 for foot in FEET], 1)
            parameters = np.concatenate([parameters, tangents.ravel()])
        return Block.of(np.array([p.steps]), variables[None], parameters[None], FINAL_ROWS)

    def _bounds(self) -> Block:
        """Bounds of single variables."""
        layout = self.layout
        parts = [single_bounds(layout, self.problem.active, self.problem.max_normal_force / self._weight)]
        for item in self._landings:
            for axis, (least, largest) in enumerate(zip(item.lower, item.upper, strict=True)):
                if largest - least >= NARROW:
                    variable = np.full((2, 1), layout.landing[item.step] + axis)
                    parts.append((np.full(2, item.step), variable, np.array([[1.0, least], [-1.0, -largest]])))
        if self.problem.room is not None:
            parts = [_sums(*part) for part in parts] + [self._room(self.problem.room)]
        return _joined(parts, 1)

    @staticmethod
    def _room(room: ComRoom) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stages, variables and parameters of the half spaces that hold the CoM, but for the first, which is given."""
        later = room.knot > 0
        parameters = STRETCH * np.column_stack([-room.normal, -room.bound])[later]
        return room.knot[later], np.tile(np.arange(3), (len(parameters), 1)), parameters


def leg_limits(leg: LegGeometry, margins: ReachMargins) -> np.ndarray:
    """Parameters of the limits of a leg: lower and upper end of each, in order, then the wanted margins."""
    ranges = [limit.range_of(leg) for limit in PLANNED]
    return np.concatenate([*ranges, [getattr(margins, name) for name in MARGINS]])


def _posture_parameters(
    leg: LegGeometry, base: np.ndarray, ankle: np.ndarray, sole: np.ndarray
) -> tuple[Sequence[float] | np.ndarray, ...]:
    """Parts of the parameters of a leg's posture: base and sole (n, 3, 3) in the world, and ankle (n, 3) m."""
    lengths = leg.thigh, leg.shin
    return base @ leg.hip_in_com, ankle, sole.reshape(-1, 9), lengths, base[:, :2, 0], leg.hips.numbers


def _joined(parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]], rows: int) -> Block:
    """One block of stages, variables and parameters."""
    return Block.of(*(np.concatenate(part) for part in zip(*parts, strict=True)), rows=rows)


def _sums(stage: np.ndarray, variable: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds of single variables (n, 1) as bounds of sums of three, two of which count nothing."""
    return stage, variable.repeat(3, 1), np.insert(parameters, [1, 1], 0.0, axis=1)


def wanted_friction(problem: CentroidalProblem, step: np.ndarray, foot: int | np.ndarray) -> np.ndarray:
    """(n,) largest part of its friction that a foot's contact should use; see `RESERVE`."""
    wanted = problem.margins.friction
    rest = steepness(problem.rotation[step, foot, 2, 2]) / np.maximum(problem.friction[step, foot], 1e-9)
    return np.where(rest < 1.0, np.clip(rest + RESERVE, wanted, max(FULL, wanted)), wanted)
