"""Independent check of a centroidal motion in plain NumPy.

Nothing of the solvers is used: momenta are integrated about the CoM by Simpson's rule (exact, the CoM is a parabola on
each step), the constraints are evaluated from force, CoP and torque, and whatever is undefined counts as infinite.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from toolkit.centroidal.problem import GRAVITY, CentroidalMotion, CentroidalProblem

TOLERANCE = 1e-6
"""Largest accepted residual. In units of weight (forces), weight times 1 m (moments), m and m/s."""


@dataclass(frozen=True)
class Residuals:
    """Largest violation of each group of constraints; 0 where satisfied, inf where undefined.

    Attributes:
        initial: of the given initial state; m, m/s, m/s times 1 m.
        dynamics: per step, in the same units.
        inactive: force, CoP or torque of a limb out of contact; weights, m, weight times 1 m.
        friction: |lateral force| beyond the cone; weights.
        normal_force: below zero or above the limb's bound; weights.
        cop: centre of pressure outside the patch, in m, times the normal force; weight times 1 m.
        yaw: yaw moment beyond what friction on the patch can hold; weight times 1 m.
        reach: distance from hip or shoulder to the contact beyond the limb's reach; m.
        height: CoM below its least height; m.
        final_box: last CoM outside its box; m.
        rest: last speed where it must be zero; m/s.
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
        return max(fields(self), key=lambda item: getattr(self, item.name)).name

    @property
    def largest(self) -> float:
        """The largest violation of all."""
        return max(getattr(self, item.name) for item in fields(self))

    def within(self, tolerance: float = TOLERANCE) -> bool:
        """Whether every violation is at most `tolerance`."""
        return self.largest <= tolerance


def check(motion: CentroidalMotion) -> Residuals:
    """Recompute how far a motion violates its problem."""
    p = motion.solved
    n, weight = p.steps, p.mass * -GRAVITY[2]
    com, linear, angular = motion.com, motion.linear_momentum, motion.angular_momentum
    force, cop, torque = motion.force, motion.cop, motion.yaw_torque
    shapes = [(n + 1, 3), (n + 1, 3), (n + 1, 3), (n, 4, 3), (n, 4, 2), (n, 4)]
    arrays = [com, linear, angular, force, cop, torque]
    if any(a.shape != shape or not np.isfinite(a).all() for a, shape in zip(arrays, shapes, strict=True)):
        return Residuals(*[np.inf] * len(fields(Residuals)))

    dt, off = p.dt[:, None], ~p.active
    total = force.sum(1)
    acceleration = total / p.mass + GRAVITY
    arm = (p.rotation[..., :2] * cop[:, :, None, :]).sum(-1) + p.position
    normal = p.rotation[..., 2]
    moment = (_cross(arm, force) + torque[..., None] * normal).sum(1)
    velocity = linear[:-1] / p.mass
    middle = com[:-1] + dt / 2 * velocity + dt**2 / 8 * acceleration
    end = com[:-1] + dt * velocity + dt**2 / 2 * acceleration
    mean_com = (com[:-1] + 4 * middle + end) / 6  # Simpson
    dynamics = max(
        _largest(com[1:] - end),
        _largest(linear[1:] - linear[:-1] - p.mass * dt * acceleration) / p.mass,
        _largest(angular[1:] - angular[:-1] - dt * (moment - _cross(mean_com, total))) / p.mass,
    )
    initial = max(
        _largest(com[0] - p.com),
        _largest(linear[0] / p.mass - p.com_velocity),
        _largest(angular[0] - p.angular_momentum) / p.mass,
    )
    inactive = 0.0
    if off.any():
        inactive = float(max(_largest(force[off]) / weight, _largest(cop[off]), _largest(torque[off]) / weight))

    local = (p.rotation * force[..., None]).sum(-2) / weight  # force in the contact frame, in weights
    fx, fy, fz = local[..., 0], local[..., 1], local[..., 2]
    friction = p.margins.friction * p.friction
    half_x, half_y = p.reduced_half_size.T
    tau_x, tau_y = cop[..., 1] * fz, -cop[..., 0] * fz  # moment at the patch centre
    tau_z = torque / weight + cop[..., 0] * fy - cop[..., 1] * fx
    room = friction * (half_x + half_y) * fz
    low = np.abs(half_y * fx - friction * tau_x) + np.abs(half_x * fy - friction * tau_y) - room
    high = room - np.abs(half_y * fx + friction * tau_x) - np.abs(half_x * fy + friction * tau_y)
    yaw = np.maximum(p.margins.yaw * low - tau_z, tau_z - p.margins.yaw * high)
    reach, height = _geometry(p, com)
    return Residuals(
        initial=initial,
        dynamics=dynamics,
        inactive=inactive,
        friction=_violation((np.hypot(fx, fy) - friction * fz)[p.active]),
        normal_force=_violation(np.maximum(-fz, fz - p.max_normal_force / weight)[p.active]),
        cop=_violation(np.maximum(np.abs(tau_y) - half_x * fz, np.abs(tau_x) - half_y * fz)[p.active]),
        yaw=_violation(yaw[p.active]),
        reach=reach,
        height=height,
        final_box=_final_box(p, com[-1]),
        rest=_largest(linear[-1]) / p.mass if p.final_at_rest else 0.0,
    )


def confirmed(motion: CentroidalMotion, tolerance: float = TOLERANCE) -> CentroidalMotion:
    """The motion with `feasible` and `objective` set from this module: the only place where `feasible` becomes True."""
    residuals = check(motion)
    status = motion.status if residuals.within(tolerance) else f"{motion.status}; residual: {residuals.worst}"
    value = objective(motion) if residuals.largest < np.inf else np.inf
    return replace(motion, feasible=residuals.within(tolerance), objective=value, status=status)


def objective(motion: CentroidalMotion) -> float:
    """The paper's objective of a motion (Sec. IV; see `toolkit.centroidal.problem`), from its knots and wrenches."""
    p, w = motion.problem, motion.problem.weights
    weight = p.mass * -GRAVITY[2]
    step = p.dt / 0.2
    rate = motion.force.sum(1) + p.mass * GRAVITY
    angular_rate = np.diff(motion.angular_momentum, axis=0) / p.dt[:, None]
    local = (p.rotation * motion.force[..., None]).sum(-2) / weight
    scaled_cop = motion.cop / np.where(p.half_size > 0, 2 * p.half_size, np.inf)
    contacts = (
        w.force * _square(local)
        + w.lateral_force * _square(local[..., :2])
        + w.torque * motion.yaw_torque**2
        + w.cop * _square(scaled_cop)
    )
    per_step = (
        w.linear_momentum * _square(motion.linear_momentum[1:])
        + w.linear_momentum_rate * _square(rate)
        + w.angular_momentum * _square(motion.angular_momentum[1:])
        + w.angular_momentum_rate * _square(angular_rate)
        + (contacts * p.active).sum(1)
    )
    return float(step @ per_step)


def friction_margin(motion: CentroidalMotion, least_force: float = 0.01) -> float:
    """Smallest mu - |lateral| / normal over contacts that carry at least `least_force` weights; inf if none does."""
    p = motion.problem
    local = (p.rotation * motion.force[..., None]).sum(-2)
    loaded = p.active & (local[..., 2] > least_force * p.mass * -GRAVITY[2])
    ratio = np.hypot(local[loaded, 0], local[loaded, 1]) / local[loaded, 2]
    return float(np.min(p.friction[loaded] - ratio, initial=np.inf))


def cop_margin(motion: CentroidalMotion, least_force: float = 0.01) -> float:
    """Smallest distance in m from a CoP to the edge of its patch over loaded contacts, as `friction_margin`."""
    p = motion.problem
    normal_force = (p.rotation[..., 2] * motion.force).sum(-1)
    loaded = p.active & (normal_force > least_force * p.mass * -GRAVITY[2])
    return float(np.min((p.half_size - np.abs(motion.cop))[loaded], initial=np.inf))


def _geometry(p: CentroidalProblem, com: np.ndarray) -> tuple[float, float]:
    """Largest violation in m of the reach and of the least height, over all knots."""
    n = p.steps
    touching = np.zeros((2, n + 1, 4), bool)  # contacts of the step before and of the step after each knot
    tip = np.zeros((2, n + 1, 4, 3))
    floor = np.full((2, n + 1, 4), np.inf)
    step_tip = p.position + (p.rotation @ p.tip_in_contact[:, :, None])[..., 0]
    for side, knots in enumerate((slice(1, None), slice(0, -1))):
        touching[side, knots], tip[side, knots] = p.active, step_tip
        floor[side, knots, :2] = np.where(p.active[:, :2], p.position[:, :2, 2], np.inf)
    if p.landing_limb >= 0:
        limb = p.landing_limb
        touching[1, n, limb] = True
        tip[1, n, limb] = p.landing_position + p.landing_rotation @ p.tip_in_contact[limb]
        if limb < 2 and p.landing_position is not None:
            floor[1, n, limb] = p.landing_position[2]
    cos, sin, zero = np.cos(p.yaw), np.sin(p.yaw), np.zeros(n + 1)
    heading = np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1]]).transpose(2, 0, 1)
    root = com[:, None] + p.root_in_com @ heading.transpose(0, 2, 1)
    distance = np.sqrt(_square(root - tip))
    lowest = floor.min((0, 2))
    low = np.where(np.isfinite(lowest), lowest + p.min_height - com[:, 2], 0.0)
    return _violation((distance - p.max_reach)[touching]), _violation(low)


def _final_box(p: CentroidalProblem, com: np.ndarray) -> float:
    """Distance in m of the last CoM outside its box."""
    cos, sin = np.cos(p.yaw[-1]), np.sin(p.yaw[-1])
    x, y, z = com - p.final_center
    return _violation(np.abs([cos * x + sin * y, -sin * x + cos * y, z]) - p.final_half_size)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product over the last axis; several times faster than `np.cross` on small arrays."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    product[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    product[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


def _square(a: np.ndarray) -> np.ndarray:
    """Squared length over the last axis."""
    return (a * a).sum(-1)


def _largest(a: np.ndarray) -> float:
    """Largest absolute entry."""
    return float(np.abs(a).max(initial=0.0))


def _violation(a: np.ndarray) -> float:
    """Largest positive entry or 0; an undefined entry counts as infinite."""
    largest = float(np.max(a, initial=0.0))
    return largest if largest < np.inf else np.inf
