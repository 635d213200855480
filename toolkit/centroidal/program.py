"""The whole-sequence problem as an optimal-control program: stages of states and controls.

Stage t has the state at knot t, the wrench and two slacks of each contact of step t, and the excess and the body's
slack of the step. The last stage has a state and the body's slack. The rows of stage t are the dynamics to knot t + 1,
then its other constraints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.blocks import Assembly, Block, Piece
from toolkit.centroidal.body import BodyMargins, knot_contacts, lowest_foot, mean_feet, swing_ankles
from toolkit.centroidal.leg_pieces import leg_limits
from toolkit.centroidal.pieces import CONTACT, SLACKS, STATE, WRENCH, G, pieces
from toolkit.centroidal.problem import CentroidalProblem, Margins
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rotation_about_z, steepness
from toolkit.physics.leg import TORQUE_ROLES
from toolkit.robot.model import RobotModel

OPEN = 1e3  # bound of rows that are left free
# Margins that plans keep unless nothing else is feasible: without them, slides and tilts cannot be corrected.
LEAST = Margins(friction=0.96, cop=(0.01, 0.01), yaw=0.95)
SCALE = 1e-2  # factor on the objective inside the program
# Where a foot at rest already uses more of its friction than the wanted margin leaves, it may use `RESERVE` more than
# at rest, at most `FULL`. Otherwise the motion would lean and run to spare friction, which is less safe.
RESERVE, FULL = 0.1, 0.9
PAIRS = len(FEET) + 1  # one for each foot's contact, and one for the contact that the foot in the air has left


@dataclass(frozen=True)
class Regularisers:
    """Small terms beside the paper's objective that make a plan easy to execute; each an integral like the objective's.

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


@dataclass(frozen=True)
class Landing:
    """Room for a foot's next contact.

    Attributes:
        limb: The foot.
        step: The first step in which the foot is in the air.
        lower, upper: (2,) m; range of the contact's displacement along its own axes.
    """

    limb: Limb
    step: int
    lower: np.ndarray
    upper: np.ndarray


@dataclass(frozen=True)
class Layout:
    """Where things are in the vector of variables.

    Attributes:
        offset: (N + 1,) first variable of each stage.
        wrench: (N, 4) first variable of a limb's wrench; -1 where not active.
        slack: (N + 1, 2) variables of the excess and of the body's slack; at the last knot both are the body's.
        landing: (N,) first variable of a landing point that is chosen in a step; -1 where none is.
        states: (N + 1,) numbers of state variables.
        size: Number of variables.
        moving: Whether contacts are displaced by variables.
    """

    offset: np.ndarray
    wrench: np.ndarray
    slack: np.ndarray
    landing: np.ndarray
    states: np.ndarray
    size: int
    moving: bool

    @classmethod
    def of(cls, active: np.ndarray, landings: Sequence[int] | None = None) -> Layout:
        """Layout for (N, 4) active contacts; `landings` are the steps that choose a landing point, None for none."""
        moving = landings is not None
        count = active.sum(1)
        chooses = np.zeros(len(active), bool)
        chooses[list(landings or ())] = True
        controls = np.append(CONTACT * count + SLACKS + 2 * chooses, 1)
        states = np.full(len(controls), STATE + 2 * PAIRS * moving)
        offset = np.concatenate([[0], np.cumsum(states + controls)[:-1]])
        rank = np.cumsum(active, 1) - 1
        first = offset + states
        wrench = np.where(active, first[:-1, None] + CONTACT * rank, -1)
        slack = (first[:-1] + CONTACT * count)[:, None] + np.arange(SLACKS)
        slack = np.concatenate([slack, np.full((1, SLACKS), first[-1])])
        landing = np.where(chooses, first[:-1] + CONTACT * count + SLACKS, -1)
        return cls(offset, wrench, slack, landing, states, int((states + controls).sum()), moving)

    def pair(self, knot: np.ndarray, which: int | np.ndarray) -> np.ndarray:
        """(n, 2) variables at (n,) knots of the displacement of a foot's contact, or of the one left (len(FEET))."""
        return indices(self.offset[knot] + STATE + 2 * np.asarray(which), 2)


def indices(first: np.ndarray, size: int) -> np.ndarray:
    """(n, size) consecutive indices from (n,) first ones."""
    return first[:, None] + np.arange(size)


class Program:
    """Blocks, bounds and structure of one problem.

    Args:
        problem: The problem, with the wanted margins.
        robot: The robot, for the limits of the body.
        body: Wanted margins of the body.
        regularisers: Weights of the regularisers.
        landings: Where contacts may move; None where they stay.
    """

    def __init__(
        self,
        problem: CentroidalProblem,
        robot: RobotModel,
        body: BodyMargins,
        regularisers: Regularisers,
        landings: Sequence[Landing] | None = None,
    ):
        self.problem, self.robot, self.body, self.regularisers = problem, robot, body, regularisers
        self.landings = landings
        self.layout = Layout.of(problem.active, None if landings is None else [item.step for item in landings])
        self._pieces = pieces(self.layout.moving)
        self.path_rows = np.zeros(problem.steps + 1, int)
        self._parts: list[tuple[Piece, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        self._carried: list[tuple[int, np.ndarray]] = []
        self._bounds: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._heading = rotation_about_z(problem.yaw)
        self._middle_heading = rotation_about_z((problem.yaw[:-1] + problem.yaw[1:]) / 2)
        self._add_edges()
        self._add_contacts()
        self._add_body()
        self._add_slacks()
        self._add_landings()
        self._finish()

    def _add(self, piece: Piece, stage: np.ndarray, variables: np.ndarray, *columns: np.ndarray) -> np.ndarray:
        """Enter a piece at stages, each at most once; returns the (n, rows) rows counted from the stage's first."""
        n = len(stage)
        rows = self.path_rows[stage][:, None] + np.arange(piece.rows)
        self.path_rows[stage] += piece.rows
        shaped = [np.reshape(column, (n, -1) if np.size(column) else (n, 0)) for column in columns]
        parameters = np.concatenate(shaped, 1)
        self._parts.append((piece, stage, variables, rows, parameters))
        return rows

    def _state(self, knot: np.ndarray, *parts: slice) -> np.ndarray:
        """Variables of parts of the states at knots."""
        index = np.concatenate([np.arange(STATE)[part] for part in parts or (slice(None),)])
        return self.layout.offset[knot][:, None] + index

    def _add_edges(self) -> None:
        """Initial state and final conditions."""
        p, reg = self.problem, self.regularisers
        n = p.steps
        first, last = np.array([0]), np.array([n])
        initial = np.concatenate([p.com, p.com_velocity, p.angular_momentum / p.mass, np.zeros(3)])
        rows = self._add(self._pieces["initial"], first, self._state(first), initial[None])
        self._bounds.append((first, rows, np.zeros((STATE, 2))))
        weights = np.sqrt(SCALE * np.array([reg.final_center, reg.final_acceleration, reg.final_spin]))
        yaw = p.yaw[-1]
        columns = np.concatenate([p.final_center, [np.cos(yaw), np.sin(yaw)], weights])
        variables, tangents = self._state(last), np.zeros((1, 0))
        if self.layout.moving:
            variables = np.concatenate([variables, *(self.layout.pair(last, foot) for foot in FEET)], 1)
            tangents = np.concatenate([p.rotation[-1, foot, :, :2] / 2 for foot in FEET], 1).reshape(1, 12)
        rows = self._add(self._pieces["final"], last, variables, columns[None], tangents)
        speed = 0.0 if p.final_at_rest else OPEN
        bound = np.concatenate([np.full(3, speed), p.final_half_size])
        self._bounds.append((last, rows, np.stack([-bound, bound], 1)))

    def _add_contacts(self) -> None:
        """Cones of the contacts."""
        p, w, reg = self.problem, self.problem.weights, self.regularisers
        duration = SCALE * p.dt / 0.2
        weight = p.mass * G
        cop_margin, price = p.half_size - p.reduced_half_size, self._price()
        for limb in range(4):
            step = np.flatnonzero(p.active[:, limb])
            if not len(step):
                continue
            on = p.active[:, limb]
            made = np.concatenate([[False], on[1:] & ~on[:-1]])[step]
            broken = np.concatenate([on[:-1] & ~on[1:], [False]])[step]
            if Limb(limb).is_foot:
                press, force, usual = np.where(made | broken, reg.load, 0.0), 0.0, 1.0
            else:
                press = np.full(len(step), reg.palm)
                force = usual = reg.palm_force
            squares = [np.full(len(step), value) for value in (w.force, w.lateral_force, w.torque * weight**2)]
            squares += [np.full(len(step), w.cop), np.full(len(step), reg.cop / usual**2), press]
            weights = np.sqrt(duration[step, None] * np.stack(squares, 1))
            wanted = np.array([p.margins.friction, *cop_margin[limb], p.margins.yaw])
            least = np.array([LEAST.friction, *np.minimum(LEAST.cop, cop_margin[limb]), LEAST.yaw])
            least[[0, 3]] = np.maximum(least[[0, 3]], wanted[[0, 3]])
            wrench = indices(self.layout.wrench[step, limb], CONTACT)
            variables = np.concatenate([wrench, self.layout.slack[step, :1]], 1)
            fixed = np.tile(np.concatenate([p.half_size[limb], wanted, least]), (len(step), 1))
            if Limb(limb).is_foot:
                fixed[:, 2] = wanted_friction(p, step, limb)
            wanted_force = np.full(len(step), force)
            self._add(
                self._pieces["contact"],
                step,
                variables,
                p.friction[step, limb],
                fixed,
                weights,
                wanted_force,
                price[step],
            )

    def _add_body(self) -> None:
        """Limits of legs and arms."""
        p, body, layout = self.problem, self.body, self.layout
        knots, limbs, positions, rotations = knot_contacts(p)
        swing_knots, delays, swing_limbs, tips, tangents = swing_ankles(p)
        weight = p.mass * G
        com = slice(0, 3)
        for limb in FEET:
            leg = self.robot.legs[limb]
            hip = self._heading @ leg.hip_in_com
            here = limbs == limb
            at = knots[here]
            variables = np.concatenate([self._state(at, com), layout.slack[at, 1:], self._moved(at, limb)], 1)
            rotation = rotations[here]
            ankle = positions[here] + rotation @ leg.ankle_in_sole
            links = np.tile([leg.thigh, leg.shin], (len(at), 1))
            posture = (hip[at], ankle, rotation, links)
            self._add(self._pieces["leg"], at, variables, *posture, np.tile(leg_limits(leg, body), (len(at), 1)))

            step = np.flatnonzero(p.active[:, limb])
            wrench = indices(layout.wrench[step, limb], WRENCH)
            variables = [self._state(step, com, slice(3, 6)), wrench, layout.slack[step, 1:], self._moved(step, limb)]
            variables = np.concatenate(variables, 1)
            sole, rotation = p.position[step, limb], p.rotation[step, limb]
            limits = np.array([leg.torques[role] for role in TORQUE_ROLES]) / weight
            posture = (self._middle_heading[step] @ leg.hip_in_com, sole + rotation @ leg.ankle_in_sole, rotation)
            fixed = np.tile(np.append(limits, body.torque), (len(step), 1))
            links = np.tile([leg.thigh, leg.shin], (len(step), 1))
            # order of the piece: half of dt, posture, sole, limits
            self._add(self._pieces["torque"], step, variables, p.dt[step] / 2, *posture, links, sole, fixed)

            for late in (False, True):  # `_add` takes each stage once
                here = (swing_limbs == limb) & ((delays > 0.0) == late)
                at, ends = swing_knots[here], tangents[here]
                self._add_distance(at, delays[here], hip[at], tips[here], 0.0, leg.max_length, limb, ends)
        for limb in (Limb.LEFT_PALM, Limb.RIGHT_PALM):
            here = limbs == limb
            if here.any():
                arm = self.robot.arms[limb]
                shoulder = self._heading[knots[here]] @ arm.shoulder_in_com
                now, reach = np.zeros(here.sum()), (arm.min_reach, arm.max_reach)
                self._add_distance(knots[here], now, shoulder, positions[here], *reach)
        floor, lowest = lowest_foot(p)
        at = np.flatnonzero(np.isfinite(floor))
        variables = np.concatenate([self._state(at, slice(2, 3)), layout.slack[at, 1:], self._moved(at, lowest[at])], 1)
        least, rises = floor[at] + p.min_height, np.zeros((len(at), 0))
        if layout.moving:
            rises = p.rotation[np.minimum(at, p.steps - 1), lowest[at], 2, :2]
        self._add(self._pieces["height"], at, variables, least, np.full(len(at), body.height), rises)

    def _moved(self, knot: np.ndarray, foot: int | np.ndarray) -> np.ndarray:
        """(n, 2) variables that displace a foot's contact at knots; (n, 0) where contacts stay."""
        return self.layout.pair(knot, foot) if self.layout.moving else np.zeros((len(knot), 0), int)

    def _add_distance(
        self,
        knot: np.ndarray,
        delay: np.ndarray,
        root: np.ndarray,
        tip: np.ndarray,
        lower: float,
        upper: float,
        foot: Limb = FEET[0],
        tangents: np.ndarray | None = None,
    ) -> None:
        """Bounds on the distance from a root to a tip `delay` s after knots; `tangents` as in the piece."""
        if not len(knot):
            return
        variables = [self._state(knot, slice(0, 6)), self.layout.slack[knot, 1:]]
        columns = [delay, root, tip, np.tile([lower, upper, self.body.length], (len(knot), 1))]
        if self.layout.moving:
            variables += [self._moved(knot, foot), self.layout.pair(knot, len(FEET))]
            columns.append(np.zeros((len(knot), 12)) if tangents is None else tangents)
        self._add(self._pieces["distance"], knot, np.concatenate(variables, 1), *columns)

    def _add_landings(self) -> None:
        """Propagation of contacts' displacements from knot to knot, and the price of landing points."""
        layout, landings = self.layout, self.landings
        if landings is None:
            return
        n, air = self.problem.steps, len(FEET)
        step = np.arange(n)
        sources = {which: layout.pair(step, which) for which in range(air + 1)}
        for item in landings:
            sources[air][item.step] = layout.pair(np.array([item.step]), item.limb)[0]
            sources[item.limb][item.step] = layout.landing[item.step] + np.arange(2)
        for which, source in sources.items():
            variables = np.concatenate([source, layout.pair(step + 1, which)], 1)
            self._carried.append((which, variables))
        for which in range(air + 1):
            rows = self._add(self._pieces["anchor"], np.array([0]), layout.pair(np.array([0]), which), np.zeros((1, 0)))
            self._bounds.append((np.array([0]), rows, np.zeros((2, 2))))
        at = np.array([item.step for item in landings], int)
        if len(at):
            price = np.full(len(at), np.sqrt(SCALE * self.regularisers.landing))
            self._add(self._pieces["landing"], at, indices(layout.landing[at], 2), price)

    def _price(self) -> np.ndarray:
        """(N,) price of a slack in each step."""
        return SCALE * self.regularisers.slack * self.problem.dt / 0.2

    def _add_slacks(self) -> None:
        """Prices of the excess and of the body's slack."""
        slack, price = self.layout.slack, self._price()
        step, last = np.arange(self.problem.steps), np.array([self.problem.steps])
        self._add(self._pieces["slack"], step, slack[:-1], self.regularisers.excess * price, price)
        self._add(self._pieces["slack"], last, slack[-1:], price[-1:] / 2, price[-1:] / 2)

    def _finish(self) -> None:
        """Dynamics, bounds and the assembly."""
        p, w, reg, layout = self.problem, self.problem.weights, self.regularisers, self.layout
        n = p.steps
        dynamics = np.append(layout.states[1:], 0)
        first_row = np.concatenate([[0], np.cumsum(dynamics + self.path_rows)])
        total = int(first_row[-1])
        blocks = [
            Block(piece, variables, (first_row[stage] + dynamics[stage])[:, None] + rows, parameters)
            for piece, stage, variables, rows, parameters in self._parts
        ]
        duration = p.dt / 0.2
        at_rest = not np.any(p.com_velocity)
        momenta = w.linear_momentum, w.linear_momentum_rate, w.angular_momentum, w.angular_momentum_rate
        squares = [weight * p.mass**2 * duration for weight in momenta]
        squares = np.stack([*squares, reg.jerk / (0.2 * np.maximum(p.dt, 0.02)), reg.height * duration], 1)
        squares[0, 4] *= at_rest  # the acceleration before a start in motion is unknown
        height = mean_feet(p)[:, 2] + (p.final_center[2] - p.position[-1, :2, 2].mean())
        weights = np.sqrt(SCALE * squares)
        count = p.active.sum(1)
        for contacts in range(1, 5):
            step = np.flatnonzero(count == contacts)
            if not len(step):
                continue
            limbs = np.nonzero(p.active[step])[1].reshape(-1, contacts)
            wrench = indices(layout.wrench[step[:, None], limbs].ravel(), WRENCH).reshape(len(step), -1)
            variables = [self._state(step), wrench, self._state(step + 1)]
            rotation = p.rotation[step[:, None], limbs].reshape(len(step), contacts, 9)
            pose = [rotation, p.position[step[:, None], limbs]]
            if layout.moving:
                foot = limbs < len(FEET)
                pose.append(foot[..., None].astype(float))
                variables += [layout.pair(step, np.where(foot, limbs, 0)[:, k]) for k in range(contacts)]
            variables = np.concatenate(variables, 1)
            pose = np.concatenate(pose, 2).reshape(len(step), -1)
            parameters = np.concatenate([p.dt[step, None], pose, weights[step], height[step + 1, None]], 1)
            rows = first_row[step][:, None] + np.arange(STATE)
            blocks.append(Block(self._pieces[f"stage{contacts}"], variables, rows, parameters))
        for which, variables in self._carried:
            rows = first_row[:n, None] + STATE + 2 * which + np.arange(2)
            blocks.append(Block(self._pieces["carry"], variables, rows, np.zeros((n, 0))))
        self.assembly = Assembly(blocks, layout.size, total)
        self.row_bounds = np.stack([np.zeros(total), np.full(total, np.inf)], 1)
        for stage in range(n):
            self.row_bounds[first_row[stage] : first_row[stage] + dynamics[stage]] = 0.0
        for stage, rows, bound in self._bounds:
            self.row_bounds[first_row[stage[0]] + dynamics[stage[0]] + rows[0]] = bound
        self.variable_bounds = np.stack([np.full(layout.size, -np.inf), np.full(layout.size, np.inf)], 1)
        self.variable_bounds[layout.slack, 0] = 0.0
        for item in self.landings or ():
            at = layout.landing[item.step] + np.arange(2)
            self.variable_bounds[at] = np.stack([item.lower, item.upper], 1)
        step, limb = np.nonzero(p.active)
        self.variable_bounds[indices(layout.wrench[step, limb] + WRENCH, 2), 0] = 0.0
        normal = layout.wrench[step, limb] + 2
        self.variable_bounds[normal, 0] = 0.0
        self.variable_bounds[normal, 1] = p.max_normal_force[limb] / (p.mass * G)


def wanted_friction(problem: CentroidalProblem, step: np.ndarray, foot: int) -> np.ndarray:
    """(n,) largest part of its friction that a foot's contact should use; see `RESERVE`."""
    wanted = problem.margins.friction
    rest = steepness(problem.rotation[step, foot, 2, 2]) / np.maximum(problem.friction[step, foot], 1e-9)
    return np.where(rest < 1.0, np.clip(rest + RESERVE, wanted, max(FULL, wanted)), wanted)
