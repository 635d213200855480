"""The compiled parts: derivatives by finite differences, sweeps against dense algebra, cones against identities."""

import numpy as np
import pytest

from toolkit.centroidal.arrays import ProblemArrays
from toolkit.centroidal.build import transition_problem
from toolkit.centroidal.kernels import cone, constraints, elimination, objective, riccati, setup
from toolkit.contacts.category import Category
from validation.random_contacts import sample_transition


@pytest.fixture(scope="module")
def data(robot):
    """A transition with both palms, so that every kind of contact is there."""
    sample = sample_transition(robot, Category.MOVE_FOOT_WITH_PALMS, np.random.default_rng(1))
    problem = transition_problem(robot, sample.stance, sample.com, sample.com_velocity, sample.transition)
    return setup.pack(ProblemArrays.of(problem))[0]


@pytest.fixture
def motion(data):
    """Wrenches inside the cones, somewhere, with their states."""
    rng = np.random.default_rng(2)
    contacts, n = len(data.mu), len(data.h)
    u = 0.03 * rng.normal(size=(contacts, 6))
    u[:, 2] = rng.uniform(0.2, 0.6, contacts)
    x, w = np.empty((n + 1, 9)), np.empty((n, 6))
    objective.rollout(data, u, x, w)
    return u, x, w


def contact_terms(data, t, j, u, gradient, hessian):
    return objective.contact_terms(data.omega[t], data.weights, data.cop_weight[j], u, gradient, hessian)


def differences(function, x, step=1e-6):
    """Central differences of a scalar or vector function."""
    x = np.array(x, float)
    columns = []
    for index in range(x.size):
        change = np.zeros(x.size)
        change[index] = step
        columns.append((np.atleast_1d(function(x + change)) - np.atleast_1d(function(x - change))) / (2 * step))
    return np.array(columns).T


def test_gradient_of_a_contact(data, motion):
    u = motion[0][3].copy()
    gradient, hessian = np.empty(6), np.empty((6, 6))
    contact_terms(data, 0, 3, u, gradient, hessian)
    numeric = differences(lambda v: contact_terms(data, 0, 3, v, np.empty(6), np.empty((6, 6))), u)
    np.testing.assert_allclose(gradient, numeric[0], rtol=1e-6, atol=1e-6)  # second order of the differences
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-12)
    assert np.linalg.eigvalsh(hessian).min() > -1e-9 * np.linalg.eigvalsh(hessian).max()


def test_hessian_of_a_contact_where_residuals_vanish(data):
    # With the CoP in the centre and no twist, Gauss-Newton is exact.
    u = np.array([0.02, -0.01, 0.5, 0.0, 0.0, 0.0])
    gradient, hessian = np.empty(6), np.empty((6, 6))
    contact_terms(data, 0, 3, u, gradient, hessian)

    def slope(v):
        out = np.empty(6)
        contact_terms(data, 0, 3, v, out, np.empty((6, 6)))
        return out

    np.testing.assert_allclose(hessian, differences(slope, u), rtol=1e-5, atol=1e-4)


def test_gradient_of_a_knot(data, motion):
    x = motion[1][4].copy()

    def value(y):
        return objective.knot_terms(1.3, data.weights, y, np.zeros(9), np.zeros((9, 9)))

    gradient, hessian = np.zeros(9), np.zeros((9, 9))
    objective.knot_terms(1.3, data.weights, x, gradient, hessian)
    np.testing.assert_allclose(gradient, differences(value, x)[0], rtol=1e-6, atol=1e-5)


def test_gradient_of_a_step(data, motion):
    point = np.concatenate([motion[1][4], motion[2][4]])

    def value(y):
        return objective.step_terms(0.6, 1.3, data.weights, y[:9], y[9:], np.empty(15), np.empty((15, 15)))

    gradient, hessian = np.empty(15), np.empty((15, 15))
    objective.step_terms(0.6, 1.3, data.weights, point[:9], point[9:], gradient, hessian)
    np.testing.assert_allclose(gradient, differences(value, point)[0], rtol=1e-6, atol=1e-4)


def test_rate_of_angular_momentum_is_the_change_between_knots(data, motion):
    """k' from the step equals the difference of k = L - r x v: the state's dynamics are exact."""
    _, x, w = motion
    k = x[:, 6:] - np.cross(x[:, :3], x[:, 3:6])
    h = data.h[:, None]
    mean = x[:-1, :3] + h / 2 * x[:-1, 3:6] + h**2 / 6 * np.array([0, 0, -1.0])
    np.testing.assert_allclose(np.diff(k, axis=0) / h, w[:, 3:] - np.cross(mean, w[:, :3]), atol=1e-12)


def test_value_is_the_sum_of_the_terms(data, motion):
    u, x, w = motion
    total = 0.0
    for t in range(len(data.h)):
        for j in range(data.first[t], data.first[t + 1]):
            total += contact_terms(data, t, j, u[j], np.empty(6), np.empty((6, 6)))
        args = (data.h[t], data.omega[t], data.weights)
        total += objective.step_terms(*args, x[t], w[t], np.empty(15), np.empty((15, 15)))
        total += objective.knot_terms(*args[1:], x[t + 1], np.zeros(9), np.zeros((9, 9)))
    np.testing.assert_allclose(objective.value(data, u, x, w), total, rtol=1e-12)


def test_adjoint_of_the_dynamics():
    rng = np.random.default_rng(3)
    x, w, y = rng.normal(size=9), rng.normal(size=6), rng.normal(size=9)
    out, x_adjoint, w_adjoint = np.empty(9), np.empty(9), np.empty(6)
    riccati.forward(0.7, x, w, out)
    riccati.backward(0.7, y, x_adjoint, w_adjoint)
    np.testing.assert_allclose(y @ out, x_adjoint @ x + w_adjoint @ w, rtol=1e-12)


def test_adjoint_of_the_constraints(data):
    rng = np.random.default_rng(4)
    contacts, n = len(data.mu), len(data.h)
    u, x = rng.normal(size=(contacts, 6)), rng.normal(size=(n + 1, 9))
    lines, rounds = contacts * 13 + len(data.plane_offset), contacts + len(data.ball_radius)
    image = constraints.Point(np.empty(lines), np.empty((rounds, 4)))
    other = constraints.Point(rng.normal(size=lines), rng.normal(size=(rounds, 4)))
    constraints.apply(data, u, x, image)
    on_u, on_x = np.zeros((contacts, 6)), np.zeros((n + 1, 9))
    constraints.subtract_adjoint(data, other, on_u, on_x)
    np.testing.assert_allclose(constraints.dot(image, other), -(on_u * u).sum() - (on_x * x).sum(), rtol=1e-10)


def test_the_sweeps_solve_the_newton_system(data):
    """Against the dense quadratic program in all wrenches, with random positive Hessians and gradients."""
    rng = np.random.default_rng(5)
    contacts, n = len(data.mu), len(data.h)

    def positive(*shape):
        root = rng.normal(size=(*shape, shape[-1] + 2))
        return root @ np.swapaxes(root, -1, -2)

    sweep = riccati.allocate(n, contacts)
    contact_hessian = positive(contacts, 6)
    sweep.hessian[:] = contact_hessian
    knot_hessian, step_hessian = positive(n + 1, 9), positive(n, 15)
    g_contact, g_knot, g_step = rng.normal(size=(contacts, 6)), rng.normal(size=(n + 1, 9)), rng.normal(size=(n, 15))

    # Columns: what a unit of each wrench entry changes.
    unit = np.eye(contacts * 6).reshape(-1, contacts, 6)
    x_of, w_of = np.zeros((contacts * 6, n + 1, 9)), np.zeros((contacts * 6, n, 6))
    for column, u in enumerate(unit):
        for t in range(n):
            riccati.total_wrench(data.first, data.wrench, t, u, w_of[column, t])
            riccati.forward(data.h[t], x_of[column, t], w_of[column, t], x_of[column, t + 1])
    hessian, gradient = np.zeros((contacts * 6,) * 2), np.zeros(contacts * 6)
    for j in range(contacts):
        rows = slice(6 * j, 6 * j + 6)
        hessian[rows, rows] += contact_hessian[j]
        gradient[rows] += g_contact[j]
    for t in range(1, n + 1):
        hessian += x_of[:, t] @ knot_hessian[t] @ x_of[:, t].T
        gradient += x_of[:, t] @ g_knot[t]
    for t in range(n):
        both = np.hstack([x_of[:, t], w_of[:, t]])
        hessian += both @ step_hessian[t] @ both.T
        gradient += both @ g_step[t]
    expected = -np.linalg.solve(hessian, gradient).reshape(contacts, 6)

    elimination.factor(data.first, data.wrench, sweep.hessian, sweep.spread, sweep.total)
    riccati.factor_steps(data, knot_hessian, step_hessian, sweep)
    du, dx = np.empty((contacts, 6)), np.empty((n + 1, 9))
    riccati.solve(data, g_contact.copy(), g_knot, g_step, sweep, du, dx)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(du, expected, atol=1e-8 * scale)  # the dense system is conditioned like 1e7
    np.testing.assert_allclose(dx, np.einsum("cta,c->ta", x_of, expected.ravel()), atol=1e-7 * scale)


def interior(rng, size=200):
    """Random points of the second-order cone, some close to its boundary."""
    tail = rng.normal(size=(size, 3))
    return np.column_stack([np.linalg.norm(tail, axis=1) * (1 + 10 ** rng.uniform(-6, 1, size)), tail])


def test_scaling_maps_multipliers_and_slacks_to_one_point():
    rng = np.random.default_rng(6)
    w, lam, image = np.empty(4), np.empty(4), np.empty(4)
    for s, z in zip(interior(rng), interior(rng), strict=True):
        eta = cone.scale(s, z, w, lam)
        cone.divide(w, eta, s, image)
        np.testing.assert_allclose(image, lam, rtol=1e-5, atol=1e-5 * lam[0])  # digits lost near the boundary
        cone.multiply(w, eta, lam, image)
        np.testing.assert_allclose(image, s, rtol=1e-5, atol=1e-5 * s[0])
        cone.divide_twice(w, eta, s, image)
        np.testing.assert_allclose(image, z, rtol=1e-5, atol=1e-5 * z[0])


def test_jordan_division_undoes_multiplication():
    rng = np.random.default_rng(7)
    out, back = np.empty(4), np.empty(4)
    for x in interior(rng):
        y = rng.normal(size=4)
        cone.jordan_multiply(x, y, out)
        cone.jordan_divide(x, out, back)
        np.testing.assert_allclose(back, y, atol=1e-6)


def test_the_longest_step_ends_on_the_boundary():
    rng = np.random.default_rng(8)
    for s in interior(rng):
        ds = rng.normal(size=4)
        step = cone.longest_step(s, ds)
        end = s + step * ds
        if step < 1e10:
            np.testing.assert_allclose(end[0], np.linalg.norm(end[1:]), rtol=1e-6, atol=1e-6 * s[0])
        for part in (0.5, 0.999):
            inside = s + min(step, 1e6) * part * ds
            assert inside[0] > np.linalg.norm(inside[1:])


def test_the_longest_step_along_the_boundary_and_inwards():
    assert cone.longest_step(np.array([1.0, 0, 0, 0]), np.array([1.0, 1.0, 0, 0])) == 1e10
    assert cone.longest_step(np.array([1.0, 0, 0, 0]), np.array([1.0, 0.2, 0, 0])) == 1e10
    np.testing.assert_allclose(cone.longest_step(np.array([1.0, 0, 0, 0]), np.array([-1.0, 0, 0, 0])), 1.0)


def test_multipliers_that_prove_nothing_do_not_refute(data):
    rng = np.random.default_rng(9)
    contacts = len(data.mu)
    lines, rounds = contacts * 13 + len(data.plane_offset), contacts + len(data.ball_radius)
    for _ in range(50):
        tail = rng.normal(size=(rounds, 3))
        norms = np.linalg.norm(tail, axis=1) * rng.uniform(1, 2, rounds)
        point = constraints.Point(rng.uniform(0, 1, lines), np.column_stack([norms, tail]))
        assert not constraints.refutes(data, point, np.zeros(3))  # this transition is feasible
