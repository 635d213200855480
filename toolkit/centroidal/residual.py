"""Independent check of a centroidal motion, one pass over its steps.

It uses neither the solvers nor the laws of `toolkit.physics`. Momenta are integrated about the CoM by Simpson's rule,
which is exact since the CoM is a parabola on each step. The constraints are evaluated from force, CoP and torque. What
is undefined counts as infinite. A compiled check takes about ten microseconds, so labels in bulk get the same one.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.arrays import MotionArrays, ProblemArrays
from toolkit.centroidal.problem import STANDARD_GRAVITY, CentroidalMotion, Weights
from toolkit.compiled import compiled

TOLERANCE = 1e-6
"""Largest accepted residual. In units of weight (forces), weight times 1 m (moments), m and m/s."""
LOADED = 0.01
"""Weights; normal force from which on a contact counts in the margins."""


class Residuals(NamedTuple):
    """Largest violation of each group of constraints; 0 where satisfied, inf where undefined.

    Attributes:
        initial: Difference from the given initial state; m, m/s, m/s times 1 m.
        dynamics: Defect of a step, in the same units.
        inactive: Force, CoP or torque of a limb out of contact; weights, m, weight times 1 m.
        friction: Lateral force beyond the cone; weights.
        normal_force: Normal force below zero or above the limb's bound; weights.
        cop: Distance of the CoP outside the patch in m, times the normal force; weight times 1 m.
        yaw: Yaw moment beyond what friction on the patch can hold; weight times 1 m.
        reach: Distance from hip or shoulder to the contact beyond the limb's reach; m.
        height: Height of the CoM below the least one; m.
        final_box: Distance of the last CoM outside its box; m.
        rest: Last speed where it must be zero; m/s.
    """

    initial: float
    dynamics: float
    inactive: float
    friction: float
    normal_force: float
    cop: float
    yaw: float
    reach: float
    height: float
    final_box: float
    rest: float

    @property
    def worst(self) -> str:
        """Name of the group with the largest violation."""
        return self._fields[int(np.argmax(self))]

    @property
    def largest(self) -> float:
        """The largest violation of all."""
        return max(self)

    def within(self) -> bool:
        """Whether every violation is at most `TOLERANCE`."""
        return self.largest <= TOLERANCE


UNDEFINED = Residuals(*[np.inf] * len(Residuals._fields))


def check(motion: CentroidalMotion) -> Residuals:
    """Recompute how far a motion violates its problem."""
    return _evaluated(motion)[0]


def step_costs(motion: CentroidalMotion) -> np.ndarray:
    """(N,) what each step adds to the objective of a motion, never negative; all inf where that is undefined."""
    residuals, costs = _evaluated(motion)
    return costs if residuals.largest < np.inf else np.full(len(costs), np.inf)


def confirmed(motion: CentroidalMotion) -> CentroidalMotion:
    """The motion with `feasible` and `objective` set from this module: the only place where `feasible` becomes True."""
    residuals, costs = _evaluated(motion)
    status = motion.status if residuals.within() else f"{motion.status}; residual: {residuals.worst}"
    return replace(motion, feasible=residuals.within(), objective=_total(residuals, costs), status=status)


def objective(motion: CentroidalMotion, weights: Weights) -> float:
    """Objective of a motion with other weights than those with which it was optimised; inf where it is undefined."""
    return _total(*_evaluated(replace(motion, problem=replace(motion.problem, weights=weights))))


def _total(residuals: Residuals, costs: np.ndarray) -> float:
    """Sum of the costs of the steps; inf where the motion is undefined."""
    return float(costs.sum()) if residuals.largest < np.inf else np.inf


def friction_margin(motion: CentroidalMotion) -> float:
    """Smallest mu - |lateral| / normal over the loaded contacts (`LOADED`); inf if none is loaded."""
    p = motion.problem
    local = (p.rotation * motion.force[..., None]).sum(-2)
    loaded = p.active & (local[..., 2] > LOADED * p.mass * STANDARD_GRAVITY)
    ratio = np.hypot(local[loaded, 0], local[loaded, 1]) / local[loaded, 2]
    return float(np.min(p.friction[loaded] - ratio, initial=np.inf))


def cop_margin(motion: CentroidalMotion) -> float:
    """Smallest distance in m from a CoP to the edge of its patch over the loaded contacts; inf if none is loaded."""
    p = motion.problem
    normal_force = (p.rotation[..., 2] * motion.force).sum(-1)
    loaded = p.active & (normal_force > LOADED * p.mass * STANDARD_GRAVITY)
    return float(np.min((p.half_size - np.abs(motion.cop))[loaded], initial=np.inf))


def _evaluated(motion: CentroidalMotion) -> tuple[Residuals, np.ndarray]:
    """Residuals and costs of the steps of a motion, infinite where its arrays have a wrong shape."""
    n, arrays = motion.problem.steps, MotionArrays.of(motion)
    knots = (n + 1, 3)
    shapes = (knots, knots, knots, (n, 4, 3), (n, 4, 2), (n, 4))
    if any(array.shape != shape for array, shape in zip(arrays, shapes, strict=True)):
        return UNDEFINED, np.full(n, np.inf)
    return evaluate(ProblemArrays.of(motion.solved), arrays)


@compiled(kept=True, allocates=True)
def evaluate(p, motion):
    """`Residuals` of a problem (`ProblemArrays`) and its motion (`MotionArrays`), and the costs (N,) of its steps.

    The costs add up to the objective. All are infinite where a number of the motion is not finite.
    """
    com, linear, angular, force, cop, torque = motion
    n, weight = p.dt.shape[0], p.mass * STANDARD_GRAVITY
    costs = np.full(n, np.inf)
    for array in (com, linear, angular, force.reshape(-1, 3), cop.reshape(-1, 2), torque):
        for value in array.flat:
            if not math.isfinite(value):
                return UNDEFINED, costs
    initial = dynamics = inactive = friction = normal_force = outside = yaw = reach = height = box = rest = 0.0
    for a in range(3):
        initial = _worse(initial, abs(com[0, a] - p.com[a]))
        initial = _worse(initial, abs(linear[0, a] / p.mass - p.com_velocity[a]))
        initial = _worse(initial, abs(angular[0, a] - p.angular_momentum[a]) / p.mass)
        if p.final_at_rest:
            rest = _worse(rest, abs(linear[n, a]) / p.mass)
    total, moment, acceleration = np.empty(3), np.empty(3), np.empty(3)
    mean, arm, local = np.empty(3), np.empty(3), np.empty(3)
    floor = np.full(n + 1, np.inf)  # height of the lowest foot at each knot
    for t in range(n):
        h = p.dt[t]
        total[:], moment[:] = 0.0, 0.0
        cost = 0.0
        for i in range(4):
            f, z, tau, r = force[t, i], cop[t, i], torque[t, i], p.rotation[t, i]
            for a in range(3):
                arm[a] = p.position[t, i, a] + r[a, 0] * z[0] + r[a, 1] * z[1]
                local[a] = (r[0, a] * f[0] + r[1, a] * f[1] + r[2, a] * f[2]) / weight
                total[a] += f[a]
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                moment[a] += arm[b] * f[c] - arm[c] * f[b] + tau * r[a, 2]
            if not p.active[t, i]:
                for a in range(3):
                    inactive = _worse(inactive, abs(f[a]) / weight)
                inactive = _worse(_worse(_worse(inactive, abs(z[0])), abs(z[1])), abs(tau) / weight)
                continue
            beyond = _beyond_cone(p, t, i, local, z, tau / weight)
            friction, normal_force = _worse(friction, beyond[0]), _worse(normal_force, beyond[1])
            outside, yaw = _worse(outside, beyond[2]), _worse(yaw, beyond[3])
            for knot in (t, t + 1):
                reach = _worse(reach, _stretch(p, com[knot], knot, i, p.position[t, i], r))
                if i < 2:
                    floor[knot] = min(floor[knot], p.position[t, i, 2])
            lateral = local[0] ** 2 + local[1] ** 2
            cost += p.weights[4] * (lateral + local[2] ** 2) + p.weights[6] * lateral + p.weights[5] * tau**2
            for a in range(2):
                if p.half_size[t, i, a] > 0.0:
                    cost += p.weights[7] * (z[a] / (2.0 * p.half_size[t, i, a])) ** 2
        for a in range(3):
            acceleration[a] = total[a] / p.mass - (STANDARD_GRAVITY if a == 2 else 0.0)
            v = linear[t, a] / p.mass
            middle = com[t, a] + h / 2 * v + h * h / 8 * acceleration[a]
            end = com[t, a] + h * v + h * h / 2 * acceleration[a]
            mean[a] = (com[t, a] + 4 * middle + end) / 6  # Simpson
            dynamics = _worse(dynamics, abs(com[t + 1, a] - end))
            gained = linear[t + 1, a] - linear[t, a]
            dynamics = _worse(dynamics, abs(gained - p.mass * h * acceleration[a]) / p.mass)
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            rate, gained = moment[a] - (mean[b] * total[c] - mean[c] * total[b]), angular[t + 1, a] - angular[t, a]
            dynamics = _worse(dynamics, abs(gained - h * rate) / p.mass)
            cost += p.weights[0] * linear[t + 1, a] ** 2 + p.weights[1] * (p.mass * acceleration[a]) ** 2
            cost += p.weights[2] * angular[t + 1, a] ** 2 + p.weights[3] * (gained / h) ** 2
        cost *= h / 0.2
        costs[t] = cost if math.isfinite(cost) else np.inf
    i = p.landing_limb
    if i >= 0:
        reach = _worse(reach, _stretch(p, com[n], n, i, p.landing_position, p.landing_rotation))
        if i < 2:
            floor[n] = min(floor[n], p.landing_position[2])
    for knot in range(n + 1):
        if floor[knot] < np.inf:
            height = _worse(height, floor[knot] + p.min_height - com[knot, 2])
    cos, sin, off = math.cos(p.yaw[n]), math.sin(p.yaw[n]), com[n] - p.final_center
    box = _worse(box, abs(cos * off[0] + sin * off[1]) - p.final_half_size[0])
    box = _worse(box, abs(cos * off[1] - sin * off[0]) - p.final_half_size[1])
    box = _worse(box, abs(off[2]) - p.final_half_size[2])
    found = Residuals(initial, dynamics, inactive, friction, normal_force, outside, yaw, reach, height, box, rest)
    return found, costs


@compiled
def _worse(worst, value):
    """The larger one; infinite as soon as a value is undefined."""
    if value <= worst:
        return worst
    return value if value < np.inf else np.inf


@compiled
def _beyond_cone(p, step, limb, force, cop, torque):
    """How far a contact is beyond friction, its bounds of the normal force, its patch and its yaw moment.

    Force (3,) in the contact frame and torque about its normal at the CoP are in weights.
    """
    fx, fy, fz = force[0], force[1], force[2]
    mu = p.friction_margin * p.friction[step, limb]
    x, y = p.reduced_half_size[step, limb, 0], p.reduced_half_size[step, limb, 1]
    tau_x, tau_y = cop[1] * fz, -cop[0] * fz  # moment at the patch centre
    tau_z = torque + cop[0] * fy - cop[1] * fx
    turning = p.yaw_margin * mu
    room = turning * (x + y) * fz
    low = abs(y * fx - turning * tau_x) + abs(x * fy - turning * tau_y) - room
    high = room - abs(y * fx + turning * tau_x) - abs(x * fy + turning * tau_y)
    return (
        math.hypot(fx, fy) - mu * fz,
        max(-fz, fz - p.max_normal_force[limb] / (p.mass * STANDARD_GRAVITY)),
        max(abs(tau_y) - x * fz, abs(tau_x) - y * fz),
        max(low - tau_z, tau_z - high),
    )


@compiled
def _stretch(p, com, knot, limb, place, rotation):
    """Distance in m of a contact beyond the limb's reach, with the CoM (3,) of a knot."""
    cos, sin, tip, root = math.cos(p.yaw[knot]), math.sin(p.yaw[knot]), p.tip_in_contact[limb], p.root_in_com[limb]
    square = 0.0
    for a in range(3):
        end = place[a] + rotation[a, 0] * tip[0] + rotation[a, 1] * tip[1] + rotation[a, 2] * tip[2]
        if a == 0:
            begin = com[0] + cos * root[0] - sin * root[1]
        elif a == 1:
            begin = com[1] + sin * root[0] + cos * root[1]
        else:
            begin = com[2] + root[2]
        square += (end - begin) ** 2
    return math.sqrt(square) - p.max_reach[limb]
