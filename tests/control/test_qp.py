"""The quadratic program: constraints hold, the optimum is one, failures are noticed."""

import numpy as np
import pytest

from toolkit.control.dynamics import RobotDynamics
from toolkit.control.qp import FORCE_UNIT, UNBOUNDED, ContactQP
from toolkit.geometry.limb import FEET, Limb


@pytest.fixture
def posed(robot):
    """A QP of the robot standing in its home posture, asked to follow random task rows."""
    rng = np.random.default_rng(3)
    dynamics = RobotDynamics(robot)
    dynamics.update(robot.home, np.zeros(dynamics.nv))
    qp = ContactQP(FEET, dynamics.nv)
    qp.set_dynamics(dynamics, robot.torque_limit)
    for limb in FEET:
        qp.set_cone(limb, 0.5, robot.half_sizes[limb], 0.7)
        qp.set_normal_force(limb, 10.0, 2000.0)
    count = dynamics.nv - 6
    qp.set_acceleration(np.full(count, -100.0), np.full(count, 100.0))
    tasks = np.vstack([1e2 * dynamics.jacobian[limb] for limb in FEET] + [dynamics.com_jacobian])
    wanted = np.r_[np.zeros(12), rng.normal(size=3)]
    diagonal = np.full(qp.size, 1e-2)
    qp.set_objective(tasks, wanted, diagonal, np.zeros(qp.size))
    return robot, dynamics, qp


def test_solution_obeys_the_equation_of_motion_and_every_bound(posed):
    robot, dynamics, qp = posed
    x = qp.solve()
    assert x is not None
    left = dynamics.mass_matrix @ x[: qp.nv] + dynamics.bias
    for limb in FEET:
        wrench = FORCE_UNIT * x[qp.slots[limb]]
        rotation = dynamics.limb_rotation[limb]
        left -= dynamics.jacobian[limb].T @ np.r_[rotation @ wrench[:3], rotation @ wrench[3:]]
        assert np.hypot(*wrench[:2]) <= 0.5 * wrench[2] + 1e-3
        assert wrench[2] >= 10.0 - 1e-3
        assert abs(wrench[3]) <= robot.half_sizes[limb][1] * wrench[2] + 1e-3
        assert abs(wrench[4]) <= robot.half_sizes[limb][0] * wrench[2] + 1e-3
    np.testing.assert_allclose(left[:6], 0.0, atol=1e-3)  # N; the solver's tolerance times the force unit
    assert (np.abs(left[6:]) <= robot.torque_limit + 1e-3).all()


def test_warm_start_changes_nothing(posed):
    _, _, qp = posed
    first = qp.solve()
    second = qp.solve()
    np.testing.assert_allclose(first, second, atol=1e-5)


def test_no_feasible_neighbour_is_better(posed):
    _, _, qp = posed
    x = qp.solve()
    rng = np.random.default_rng(4)

    def cost(y):
        return 0.5 * y @ qp.hessian @ y + qp.gradient @ y

    free = np.linalg.svd(qp.rows[:6])[2][6:]  # directions that keep the floating base's equations
    for _ in range(200):
        y = x + 1e-3 * (rng.normal(size=len(free)) @ free)
        values = np.r_[y, qp.rows @ y]
        inside = (values <= qp.upper + 1e-9) & (values >= qp.lower - 1e-9)
        inside[qp.size : qp.size + 6] = True
        if inside.all():
            assert cost(y) >= cost(x) - 1e-6


def test_contradicting_bounds_are_reported_and_the_relaxed_problem_is_solved(posed):
    _, _, qp = posed
    qp.set_acceleration(np.full(qp.nv - 6, 1e5), np.full(qp.nv - 6, 2e5))  # no motor does that
    qp.set_normal_force(Limb.LEFT_FOOT, 4000.0, 5000.0)
    assert qp.solve() is None
    x = qp.solve_relaxed()
    assert x is not None
    assert x[qp.slots[Limb.LEFT_FOOT].start + 2] * FORCE_UNIT <= 5000.0 + 1e-3
    qp.set_acceleration(np.full(qp.nv - 6, -UNBOUNDED), np.full(qp.nv - 6, UNBOUNDED))
    qp.set_normal_force(Limb.LEFT_FOOT, 10.0, 2000.0)
    assert qp.solve() is not None
