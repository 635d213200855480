"""The compiled solver of replans against a dense active-set solver that knows nothing of stages."""

import daqp
import numpy as np
import pytest

from toolkit.replanning.kernel import Program, solve
from toolkit.replanning.sweep import GIVEN


def random_program(rng, steps=5, free=4, rows=12, soft=3, push=1.0):
    """A stable chain with one or two contacts a step."""
    n = GIVEN + free
    contacts = np.array([1 + (t % 2) for t in range(steps)])
    first = np.concatenate([[0], np.cumsum(contacts)]).astype(np.int64)
    a, b = np.tile(np.eye(n), (steps, 1, 1)), np.zeros((steps, n, 6))
    axis = np.arange(3)
    a[:, axis, 3 + axis] = 0.1
    a[:, 6:9, GIVEN:] = 0.3 * rng.normal(size=(steps, 3, free))
    b[:, axis, axis], b[:, 3 + axis, axis], b[:, 6 + axis, 3 + axis] = 0.005, 0.1, 0.1
    cost = np.tile(np.diag(np.r_[np.full(GIVEN, 5.0), np.full(free, 0.1)]), (steps + 1, 1, 1))
    cost[-1] *= 40.0
    count = soft * steps
    return Program(
        a,
        b,
        0.001 * rng.normal(size=(steps, n)),
        cost,
        0.1 * rng.normal(size=(steps + 1, n)),
        first,
        rng.normal(size=(first[-1], 6, 6)) + 5.0 * np.eye(6),
        np.ones((first[-1], 6)),
        rng.normal(size=(first[-1], rows, 6)),
        rng.uniform(0.05, 0.5, size=(first[-1], rows)),
        np.repeat(np.arange(1, steps + 1), soft).astype(np.int64),
        rng.normal(size=(count, n)),
        rng.uniform(0.02, 0.2, size=count),
        np.full(count, 3.0),
        0.1,
        0.05 * push * rng.normal(size=GIVEN),
    )


def dense(p):
    """Wrenches of the same program from DAQP, over wrenches, free states and violations, the states eliminated."""
    steps, n = p.a.shape[:2]
    wrenches, free, soft = 6 * len(p.weight), n - GIVEN, len(p.knot)
    size = wrenches + free + soft
    state, offset = np.zeros((steps + 1, n, size)), np.zeros((steps + 1, n))
    state[0, GIVEN:, wrenches : wrenches + free] = np.eye(free)
    offset[0, :GIVEN] = p.start
    for t in range(steps):
        state[t + 1], offset[t + 1] = p.a[t] @ state[t], p.a[t] @ offset[t] + p.drift[t]
        for j in range(p.first[t], p.first[t + 1]):
            state[t + 1][:, 6 * j : 6 * j + 6] += p.b[t] @ p.spread[j]
    hessian = np.einsum("tia,tij,tjb->ab", state, p.cost, state)
    slope = np.einsum("tia,ti->a", state, p.slope + np.einsum("tij,tj->ti", p.cost, offset))
    hessian[np.arange(wrenches), np.arange(wrenches)] += p.weight.ravel()
    last = np.arange(wrenches + free, size)
    hessian[last, last] += p.price / p.softness
    slope[last] += p.price
    rows, bounds = [], []
    for j in range(len(p.weight)):
        block = np.zeros((p.rows.shape[1], size))
        block[:, 6 * j : 6 * j + 6] = p.rows[j]
        rows.append(block)
        bounds.append(p.bound[j])
    block = np.einsum("ki,kia->ka", p.soft_rows, state[p.knot])
    block[np.arange(soft), last] = -1.0
    rows.append(block)
    bounds.append(p.soft_bound - np.einsum("ki,ki->k", p.soft_rows, offset[p.knot]))
    block = np.zeros((soft, size))
    block[np.arange(soft), last] = -1.0
    rows.append(block)
    bounds.append(np.zeros(soft))
    matrix, upper = np.ascontiguousarray(np.vstack(rows)), np.concatenate(bounds)
    lower = np.full(len(upper), -1e30)
    found, _, status, _ = daqp.solve(hessian, slope, matrix, upper, lower, np.zeros(len(upper), np.int32))
    assert status == 1
    return found[:wrenches].reshape(-1, 6), offset + state @ found


@pytest.mark.parametrize("push", [0.0, 1.0, 4.0])
def test_agrees_with_a_dense_solver(push):
    p = random_program(np.random.default_rng(int(push)), push=push)
    u = np.zeros((len(p.weight), 6))
    x, iterations, residual, gap = solve(p, u, np.zeros(p.a.shape[1] - GIVEN), 60, 1e-9)
    expected_u, expected_x = dense(p)
    assert iterations < 30 and residual < 1e-8 and gap < 1e-8
    # Both are exact to their tolerances; those of the rows are magnified by the weights on the states.
    np.testing.assert_allclose(u, expected_u, rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(x, expected_x, rtol=0.0, atol=1e-5)


def test_keeps_hard_rows_and_pays_for_soft_ones():
    p = random_program(np.random.default_rng(7), push=20.0)
    u = np.zeros((len(p.weight), 6))
    x, *_ = solve(p, u, np.zeros(p.a.shape[1] - GIVEN), 60, 1e-9)
    assert (np.einsum("jri,ji->jr", p.rows, u) - p.bound).max() < 1e-7
    assert (np.einsum("ki,ki->k", p.soft_rows, x[p.knot]) - p.soft_bound).max() > 0.01


def test_says_when_it_has_not_converged():
    p = random_program(np.random.default_rng(1), push=4.0)
    u = np.zeros((len(p.weight), 6))
    _, iterations, residual, gap = solve(p, u, np.zeros(p.a.shape[1] - GIVEN), 2, 1e-9)
    assert iterations == 2 and max(residual, gap) > 1e-9
