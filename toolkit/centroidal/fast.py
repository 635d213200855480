"""The fast solver of centroidal problems: one contact transition in a millisecond, whole sequences in linear time.

With the wrench at the centre of each patch as the unknown, the dynamics are linear and all constraints convex, so
whether a motion exists is a convex question; only the objective is mildly nonconvex. See `toolkit.centroidal.kernels`.
The first solution on a machine compiles the kernels (numba), which are then kept on disk.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from time import perf_counter

import numpy as np

from toolkit.centroidal.kernels import constraints, interior_point, sensitivity, setup
from toolkit.centroidal.problem import CentroidalMotion, CentroidalProblem
from toolkit.centroidal.residual import confirmed
from toolkit.compiled import compiled

FIRST_KNOT_TOLERANCE = 1e-7
"""m; how far the given first knot may violate reach or height."""
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
MOTION = (interior_point.SOLVED, interior_point.UNDECIDED)  # the codes that come with a motion
STATUS = {
    interior_point.SOLVED: "solved",
    interior_point.INFEASIBLE: "infeasible: proved by multipliers",
    interior_point.UNDECIDED: "undecided: iteration limit",
    3: "infeasible: initial CoM out of reach",
}


@dataclass(frozen=True)
class FastConfig:
    """Settings of the fast solver.

    Attributes:
        tolerance: accepted suboptimality relative to the objective, to first order.
        max_iterations: of the interior-point method.
    """

    tolerance: float = 1e-4
    max_iterations: int = 80


def solve(problem: CentroidalProblem, *, config: FastConfig | None = None) -> CentroidalMotion:
    """Solve a problem of any length.

    Returns:
        The motion, checked by `toolkit.centroidal.residual`. Where `status` says infeasible, that has been proved.
    """
    start = perf_counter()
    code, iterations, (com, linear, angular, force, cop, torque), _ = _run(problem, config)
    motion = CentroidalMotion(
        problem=problem,
        feasible=False,
        status=STATUS[code],
        com=com,
        linear_momentum=linear,
        angular_momentum=angular,
        force=force,
        cop=cop,
        yaw_torque=torque,
        objective=np.inf,
        seconds=0.0,
        iterations=iterations,
    )
    motion = confirmed(motion) if code in MOTION else motion
    return replace(motion, seconds=perf_counter() - start)


def wrenches(problem: CentroidalProblem, *, config: FastConfig | None = None) -> Arrays | None:
    """The motion of a problem as bare arrays, for labelling in bulk; nothing is checked.

    Returns:
        com, linear and angular momentum, force, cop and yaw torque as in `CentroidalMotion`; None where the solver says
        infeasible.
    """
    code, _, motion, _ = _run(problem, config)
    return motion if code in MOTION else None


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of the least objective of one transition (envelope theorem), world frame.

    Attributes:
        contacts: (5, 6) with the place (1/m) and a rotation vector (1/rad) of the contacts before, by limb, and of the
            new contact (last); zero where there is none. A foot takes the final box and the heading along.
        others: (9,) with the CoM (1/m), its velocity (s/m), shift and swing (1/s), and the friction of all contacts.
    """

    contacts: np.ndarray
    others: np.ndarray


def sensitive_wrenches(
    problem: CentroidalProblem, *, config: FastConfig | None = None
) -> tuple[Arrays, Sensitivity] | None:
    """As `wrenches`, with the derivatives of the objective; for half as much time again.

    Args:
        problem: of one transition, from `build.transition_problem`, not at rest at its end.
        config: the derivatives err by about the square root of `tolerance` in directions that hardly matter, by a tenth
            of that as a whole.
    """
    code, _, motion, derivatives = _run(problem, config, differentiate=True)
    return (motion, derivatives) if code in MOTION else None


def _run(
    problem: CentroidalProblem, config: FastConfig | None, *, differentiate: bool = False
) -> tuple[int, int, Arrays, Sensitivity]:
    """Status, iterations, the arrays of the motion, and its derivatives, zero where they are not asked for."""
    config = config or FastConfig()
    solved = _solved(float(config.tolerance), int(config.max_iterations), differentiate, *_arguments(problem))
    return solved[0], solved[1], solved[2:8], Sensitivity(*solved[8:])


def _arguments(problem: CentroidalProblem) -> tuple:
    """What `kernels.setup.pack` takes, in the exact types that the kernels were compiled for."""
    p = problem
    landing = p.landing_limb >= 0
    return (
        float(p.mass),
        _plain(p.dt),
        _plain(p.active, bool),
        _plain(p.position),
        _plain(p.rotation),
        _plain(p.friction),
        _plain(p.half_size),
        _plain(p.reduced_half_size),
        _plain(p.max_normal_force),
        _plain(p.yaw),
        _plain(p.com),
        _plain(p.com_velocity),
        _plain(p.angular_momentum),
        _plain(p.root_in_com),
        _plain(p.tip_in_contact),
        _plain(p.max_reach),
        float(p.min_height),
        _plain(p.final_center),
        _plain(p.final_half_size),
        bool(p.final_at_rest),
        np.array(astuple(p.weights), float),
        float(p.margins.friction),
        float(p.margins.yaw),
        int(p.landing_limb),
        _plain(p.landing_position) if landing else np.zeros(3),
        _plain(p.landing_rotation) if landing else np.eye(3),
    )


def _plain(array: np.ndarray | None, dtype: type = float) -> np.ndarray:
    """The array, contiguous and writable: any other kind would be compiled for anew."""
    array = np.ascontiguousarray(array, dtype)
    return array if array.flags.writeable else array.copy()


def pack(problem: CentroidalProblem) -> tuple[setup.Data, float]:
    """The scaled arrays that the kernels work on, and how far the first knot is out of reach in m."""
    return setup.pack(*_arguments(problem))


@compiled(kept=True)
def _solved(tolerance, max_iterations, differentiate, mass, dt, active, position, *arguments):
    """Status, iterations, the arrays of the motion, and its derivatives."""
    data, violation = setup.pack(mass, dt, active, position, *arguments)
    contacts, n = data.mu.shape[0], dt.shape[0]
    u, x, w = np.zeros((contacts, 6)), np.zeros((n + 1, 9)), np.zeros((n, 6))
    lines, rounds = contacts * setup.ROWS + data.plane_offset.shape[0], contacts + data.ball_radius.shape[0]
    z = constraints.room(lines, rounds)
    code, iterations = 3, 0
    if violation <= FIRST_KNOT_TOLERANCE:
        code, iterations = interior_point.solve(data, tolerance, max_iterations, u, x, w, z)
    slopes = np.zeros((5, 6)), np.zeros(9)
    if differentiate and (code == interior_point.SOLVED or code == interior_point.UNDECIDED):
        slopes = sensitivity.derivatives(u, z, (mass, dt, active, position, *arguments))
    com = arguments[6]
    return (code, iterations, *setup.unpack(data, active, mass, com, u, x), *slopes)
