"""The centroidal problem in CasADi, solved by Ipopt: the reference to read next to the paper (Sec. IV).

Unknowns are the paper's: CoM r, momenta l and k, and per contact the force f, the CoP z and the yaw torque tau_n.
Everything is divided by the mass (momenta) or the weight (forces, torques), positions count from the initial CoM.
"""

from __future__ import annotations

from time import perf_counter

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from toolkit.centroidal.problem import GRAVITY, CentroidalMotion, CentroidalProblem
from toolkit.centroidal.residual import confirmed

OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-7,
    "ipopt.constr_viol_tol": 1e-9,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.max_iter": 400,
}
SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
SECOND_TRY = {"ipopt.mu_strategy": "adaptive"}
"""Where Ipopt neither solves nor refutes a problem (unloaded contacts sit at the apex of their cone)."""


class _Program:
    """A nonlinear program that grows: variables with a guess, constraints with bounds, a cost."""

    def __init__(self):
        self.variables, self.guess = [], []
        self.constraints, self.lower, self.upper = [], [], []
        self.cost = ca.SX(0)

    def variable(self, name: str, size: int, guess) -> ca.SX:
        """A new vector of unknowns."""
        x = ca.SX.sym(name, size)
        self.variables.append(x)
        self.guess.append(np.broadcast_to(guess, size))
        return x

    def require(self, expression: ca.SX, lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf) -> None:
        """Constrain lower <= expression <= upper."""
        rows = expression.numel()
        self.constraints.append(expression)
        self.lower.append(np.broadcast_to(lower, rows))
        self.upper.append(np.broadcast_to(upper, rows))

    def solve(self, options: dict) -> tuple[ca.SX, ca.DM, dict]:
        """Run Ipopt: the unknowns in one vector, the solution and the solver's statistics."""
        x, g = ca.vertcat(*self.variables), ca.vertcat(*self.constraints)
        solver = ca.nlpsol("centroidal", "ipopt", {"x": x, "f": self.cost, "g": g}, options)
        bounds = {"lbg": np.concatenate(self.lower), "ubg": np.concatenate(self.upper)}
        result = solver(x0=np.concatenate(self.guess), **bounds)
        statistics = solver.stats()
        if (
            statistics["return_status"] not in (*SOLVED, "Infeasible_Problem_Detected")
            and SECOND_TRY.items() - options.items()
        ):
            return self.solve({**options, **SECOND_TRY})
        return x, result["x"], statistics


def solve(problem: CentroidalProblem, *, options: dict | None = None) -> CentroidalMotion:
    """Solve a problem with Ipopt.

    Args:
        problem: of any length.
        options: CasADi's options of the solver, on top of `OPTIONS`.

    Returns:
        The motion, checked by `toolkit.centroidal.residual`.
    """
    start = perf_counter()
    p, n = problem, problem.steps
    weight = p.mass * -GRAVITY[2]
    nlp = _Program()

    r, v, k = [ca.SX.zeros(3)], [ca.SX(p.com_velocity)], [ca.SX(p.angular_momentum / p.mass)]
    for t in range(n):
        r.append(nlp.variable(f"r{t + 1}", 3, 0.0))
        v.append(nlp.variable(f"v{t + 1}", 3, 0.0))
        k.append(nlp.variable(f"k{t + 1}", 3, 0.0))
    wrenches = []
    for t in range(n):
        guess = p.rotation[t, :, 2] / max(p.active[t].sum(), 1)
        wrenches.append(
            {
                int(i): (nlp.variable(f"f{t}_{i}", 3, guess[i]), nlp.variable("z", 2, 0), nlp.variable("tau", 1, 0))
                for i in np.flatnonzero(p.active[t])
            }
        )
    for t in range(n):
        _dynamics(nlp, p, t, (r[t], v[t], k[t]), (r[t + 1], v[t + 1], k[t + 1]), wrenches[t])
        for i, wrench in wrenches[t].items():
            _contact(nlp, p, t, i, *wrench)
    for t in range(1, n + 1):
        _reach(nlp, p, t, r[t])
    _final(nlp, p, r[n], v[n])

    nlp.cost *= 1e-3  # of the order of one
    x, solution, statistics = nlp.solve({**OPTIONS, **(options or {})})

    unpack = ca.Function("unpack", [x], [ca.horzcat(*r), ca.horzcat(*v), ca.horzcat(*k)])
    com, velocity, angular = (np.array(a).T for a in unpack(solution))
    force, cop, torque = np.zeros((n, 4, 3)), np.zeros((n, 4, 2)), np.zeros((n, 4))
    values = ca.Function("wrenches", [x], [ca.vertcat(*[ca.vertcat(*w) for step in wrenches for w in step.values()])])
    active = np.argwhere(p.active)
    for (t, i), wrench in zip(active, np.array(values(solution)).reshape(-1, 6), strict=True):
        force[t, i], cop[t, i], torque[t, i] = wrench[:3] * weight, wrench[3:5], wrench[5] * weight
    motion = CentroidalMotion(
        problem=p,
        feasible=False,
        status=statistics["return_status"],
        com=com + p.com,
        linear_momentum=velocity * p.mass,
        angular_momentum=angular * p.mass,
        force=force,
        cop=cop,
        yaw_torque=torque,
        objective=np.inf,
        seconds=perf_counter() - start,
        iterations=statistics["iter_count"],
    )
    return confirmed(motion)


def _dynamics(nlp: _Program, p: CentroidalProblem, t: int, now, then, wrenches) -> None:
    """Eq. 3 integrated over step t with constant wrenches, and the terms of the objective on momenta."""
    (r, v, k), (r1, v1, k1) = now, then
    h, g, w = p.dt[t], GRAVITY, p.weights
    total, moment = ca.SX.zeros(3), ca.SX.zeros(3)
    for i, (f, z, tau) in wrenches.items():
        place = p.position[t, i] - p.com + p.rotation[t, i][:, :2] @ z
        total += f
        moment += ca.cross(place, f) + p.rotation[t, i][:, 2] * tau
    acceleration = -g[2] * total + g
    mean_r = r + h / 2 * v + h**2 / 6 * acceleration  # of the parabola over the step
    nlp.require(r1 - (r + h * v + h**2 / 2 * acceleration), 0, 0)
    nlp.require(v1 - (v + h * acceleration), 0, 0)
    nlp.require(k1 - (k - h * g[2] * (moment - ca.cross(mean_r, total))), 0, 0)
    nlp.cost += (h / 0.2 * p.mass**2) * (
        w.linear_momentum * ca.sumsqr(v1)
        + w.linear_momentum_rate * ca.sumsqr(acceleration)
        + w.angular_momentum * ca.sumsqr(k1)
        + w.angular_momentum_rate * ca.sumsqr((k1 - k) / h)
    )


def _contact(nlp: _Program, p: CentroidalProblem, t: int, i: int, f: ca.SX, z: ca.SX, tau: ca.SX) -> None:
    """Friction cone, CoP in the patch, yaw moment (Caron et al. 2015), and the contact's terms of the objective."""
    local = p.rotation[t, i].T @ f
    fx, fy, fz = local[0], local[1], local[2]
    mu, (half_x, half_y) = p.margins.friction * p.friction[t, i], p.reduced_half_size[i]
    weight = p.mass * -GRAVITY[2]
    nlp.require(fz, 0, p.max_normal_force[i] / weight)
    nlp.require(mu**2 * fz**2 - fx**2 - fy**2, 0)
    nlp.require(z, [-half_x, -half_y], [half_x, half_y])
    tau_x, tau_y = z[1] * fz, -z[0] * fz
    tau_z, turning = tau + z[0] * fy - z[1] * fx, p.margins.yaw * mu
    for sign in (-1, 1):
        for a in (-1, 1):
            for b in (-1, 1):
                nlp.require(
                    turning * (half_x + half_y) * fz
                    - a * (half_y * fx + sign * turning * tau_x)
                    - b * (half_x * fy + sign * turning * tau_y)
                    - sign * tau_z,
                    0,
                )
    w, size = p.weights, 2 * p.half_size[i]
    nlp.cost += (p.dt[t] / 0.2) * (
        w.force * ca.sumsqr(local)
        + w.lateral_force * (fx**2 + fy**2)
        + w.torque * (weight * tau) ** 2
        + w.cop * ((z[0] / size[0]) ** 2 + (z[1] / size[1]) ** 2)
    )


def _reach(nlp: _Program, p: CentroidalProblem, knot: int, r: ca.SX) -> None:
    """Reach of every limb in contact before or after a knot, and the least height of the CoM."""
    contacts = {(t, int(i)) for t in (knot - 1, knot) if t < p.steps for i in np.flatnonzero(p.active[t])}
    places = [(i, p.position[t, i], p.rotation[t, i]) for t, i in sorted(contacts)]
    if knot == p.steps and p.landing_limb >= 0:
        places.append((p.landing_limb, p.landing_position, p.landing_rotation))
    cos, sin = np.cos(p.yaw[knot]), np.sin(p.yaw[knot])
    heading = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    for i, position, rotation in places:
        tip = position + rotation @ p.tip_in_contact[i]
        nlp.require(ca.sumsqr(p.com + r + heading @ p.root_in_com[i] - tip), 0, p.max_reach[i] ** 2)
    feet = [position[2] for i, position, _ in places if i < 2]
    if feet:
        nlp.require(r[2], min(feet) + p.min_height - p.com[2])


def _final(nlp: _Program, p: CentroidalProblem, r: ca.SX, v: ca.SX) -> None:
    """The box for the last CoM, and rest."""
    cos, sin = np.cos(p.yaw[-1]), np.sin(p.yaw[-1])
    x, y, z = ca.vertsplit(p.com + r - p.final_center)
    offset = ca.vertcat(cos * x + sin * y, -sin * x + cos * y, z)
    nlp.require(offset, -p.final_half_size, p.final_half_size)
    if p.final_at_rest:
        nlp.require(v, 0, 0)
