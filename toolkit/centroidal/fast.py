"""The fast solver of centroidal problems: one contact transition in a millisecond, whole sequences in linear time.

With the wrench at the centre of each patch as the unknown, the dynamics are linear and all constraints convex, so
whether a motion exists is a convex question; only the objective is mildly nonconvex. See `toolkit.centroidal.kernels`.
The first solution on a machine compiles the kernels (numba), which are then kept on disk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from toolkit.centroidal.arrays import MotionArrays, ProblemArrays
from toolkit.centroidal.kernels import constraints, interior_point, sensitivity, setup
from toolkit.centroidal.problem import CentroidalMotion, CentroidalProblem
from toolkit.centroidal.residual import confirmed
from toolkit.compiled import compiled

FIRST_KNOT_TOLERANCE = 1e-7
"""Most that the given first knot may violate reach or height, in m."""
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
        tolerance: Accepted suboptimality relative to the objective, to first order.
        max_iterations: Most iterations of the interior-point method.
    """

    tolerance: float = 1e-4
    max_iterations: int = 80


def solve(problem: CentroidalProblem, *, config: FastConfig | None = None) -> CentroidalMotion:
    """Solve a problem of any length.

    Returns:
        The motion, checked by `toolkit.centroidal.residual`. Where `status` says infeasible, that has been proved.
    """
    start = perf_counter()
    code, iterations, arrays, _ = _run(problem, config)
    motion = CentroidalMotion(
        problem=problem,
        feasible=False,
        status=STATUS[code],
        **arrays._asdict(),
        iterations=iterations,
    )
    motion = confirmed(motion) if code in MOTION else motion
    return replace(motion, seconds=perf_counter() - start)


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of the least objective of one transition (envelope theorem), world frame.

    Attributes:
        contacts: (5, 6); with respect to the place (1/m) and a rotation vector (1/rad) of the contacts before, by limb,
            and of the new contact (last). Zero where there is none. A foot takes the final box and the heading along.
        others: (9,); with respect to the CoM (1/m), its velocity (s/m), the durations of shift and swing (1/s), and the
            friction of all contacts.
    """

    contacts: np.ndarray
    others: np.ndarray


def sensitive_wrenches(
    problem: CentroidalProblem, *, config: FastConfig | None = None
) -> tuple[MotionArrays, Sensitivity] | None:
    """The motion of a problem as bare, unchecked arrays, with the derivatives of its objective; for labelling in bulk.

    The derivatives take half as much time again. They err by about the square root of `FastConfig.tolerance` in
    directions that hardly matter, and by a tenth of that as a whole.

    Args:
        problem: Problem of one transition, from `build.transition_problem`, not at rest at its end.
        config: Settings; the defaults where None.

    Returns:
        The motion and the derivatives; None where the solver says infeasible.
    """
    code, _, motion, derivatives = _run(problem, config, differentiate=True)
    return (motion, derivatives) if code in MOTION else None


def _run(
    problem: CentroidalProblem, config: FastConfig | None, *, differentiate: bool = False
) -> tuple[int, int, MotionArrays, Sensitivity]:
    """Status, iterations, the arrays of the motion, and its derivatives, which are zero unless `differentiate`."""
    config, arrays = config or FastConfig(), ProblemArrays.of(problem)
    varied = arrays.copy() if differentiate else arrays
    tolerance, most = float(config.tolerance), int(config.max_iterations)
    code, iterations, motion, *derivatives = _solved(tolerance, most, arrays, differentiate, varied)
    return code, iterations, motion, Sensitivity(*derivatives)


@compiled(kept=True)
def _solved(tolerance, max_iterations, problem, differentiate, varied):
    """Status, iterations, the motion, and its derivatives, for which `varied` is a copy to change."""
    data, violation = setup.pack(problem)
    contacts, n = data.mu.shape[0], data.h.shape[0]
    u, x, w = np.zeros((contacts, 6)), np.zeros((n + 1, 9)), np.zeros((n, 6))
    lines, rounds = contacts * setup.ROWS + data.plane_offset.shape[0], contacts + data.ball_radius.shape[0]
    z = constraints.room(lines, rounds)
    code, iterations = 3, 0
    if violation <= FIRST_KNOT_TOLERANCE:
        code, iterations = interior_point.solve(data, tolerance, max_iterations, u, x, w, z)
    slopes = np.zeros((5, 6)), np.zeros(9)
    if differentiate and (code == interior_point.SOLVED or code == interior_point.UNDECIDED):
        slopes = sensitivity.derivatives(u, z, problem, varied)
    return (code, iterations, setup.unpack(problem, data, u, x), *slopes)
