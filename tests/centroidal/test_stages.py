"""The parts of the stage solver against dense algebra: sweeps, the condensation of rows, whole Newton steps."""

from types import SimpleNamespace

import numpy as np
import pytest

from toolkit.centroidal.build import transition_problem
from toolkit.centroidal.program import Program
from toolkit.centroidal.sequence import SequenceConfig, guess
from toolkit.centroidal.stages import blocks, method, newton
from toolkit.centroidal.stages.blocks import Block
from toolkit.centroidal.stages.method import Options, Prices, Squares, Work
from toolkit.centroidal.stages.rows import CONE, SHARPNESS, add_prices, add_squares
from toolkit.contacts.category import Category
from validation.random_contacts import sample_transition


def positive(rng, n):
    """A random positive definite matrix (n, n)."""
    root = rng.normal(size=(n, n + 2))
    return root @ root.T


def newton_step(hessian, gradient, jacobian, value):
    """Dense solution (n,) of: minimise 1/2 d'Hd + q'd so that J d + c = 0."""
    zero = np.zeros((len(value), len(value)))
    system = np.block([[hessian, jacobian.T], [jacobian, zero]])
    return np.linalg.solve(system, -np.concatenate([gradient, value]))[: len(gradient)]


@pytest.mark.parametrize("seed", range(10))
def test_the_sweep_solves_the_system_of_all_stages(seed):
    """Stages of different sizes, some of which have no controls; numbers beyond a stage's size do not count."""
    rng = np.random.default_rng(seed)
    stages, n = int(rng.integers(2, 9)), int(rng.integers(1, 6))
    size = n + rng.integers(0, 7, stages)
    m, first = int(size.max()) + 1, np.concatenate([[0], np.cumsum(size)])
    hessian = np.full((stages, m, m), np.nan)
    gradient, following = np.full((stages, m), np.nan), np.full((stages - 1, n, m), np.nan)
    defect = rng.normal(size=(stages - 1, n))
    whole, slope = np.zeros((first[-1], first[-1])), rng.normal(size=first[-1])
    jacobian, value = np.zeros((n * stages, first[-1])), np.zeros(n * stages)
    jacobian[:n, :n] = np.eye(n)  # the first state is given
    for t, k in enumerate(size):
        here, rows = slice(first[t], first[t + 1]), slice(n * t + n, n * t + 2 * n)
        whole[here, here] = positive(rng, k)
        hessian[t, :k, :k], gradient[t, :k] = np.tril(whole[here, here]), slope[here]
        if t < stages - 1:
            following[t, :, :k] = jacobian[rows, here] = rng.normal(size=(n, k))
            jacobian[rows, first[t + 1] : first[t + 1] + n] = -np.eye(n)
            value[rows] = defect[t]
    sweep, change, middle = newton.allocate(stages, n, m), np.zeros((stages, m)), int(rng.integers(0, stages))
    for begin, end in ((middle, stages), (0, middle)):  # some of the stages at a time
        few = np.full((max(end - begin, 1), m, m), np.nan)
        for t in range(begin, end):
            few[t % len(few)] = hessian[t]
        newton.factor(begin, end, size, few, following, sweep)
    expected = newton_step(whole, slope, jacobian, value)
    for _ in range(2):  # the factors serve many right-hand sides
        q = gradient.copy()
        for begin, end in ((middle, stages), (0, middle)):
            newton.backward(begin, end, size, following, defect, q, sweep)
        newton.forward(size, following, defect, sweep, change)
        found = np.concatenate([row[:k] for row, k in zip(change, size, strict=True)])
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def random_block(rng, stages=4, n=9, rows=3, variables=5, size=7):
    """A block somewhere in the middle of a solution; one application names a variable twice."""
    stage = np.sort(rng.integers(0, stages, n))
    index = np.stack([rng.permutation(size)[:variables] for _ in range(n)])
    index[0, 1] = index[0, 0]
    block = Block.of(stage, index, np.zeros((n, 1)), rows)
    for array in (block.value, block.slope, block.slack_change, block.multiplier_change):
        array[:] = rng.normal(size=array.shape)
    block.slope[rng.random(block.slope.shape) < 0.3] = 0.0
    for array in (block.slack, block.multiplier):
        array[:] = rng.uniform(0.1, 2.0, array.shape)
    return block


def dense_rows(block, stages, size):
    """The Jacobian (rows of the block, all variables of the stages)."""
    n, rows = block.value.shape
    jacobian = np.zeros((n, rows, stages, size))
    for i in range(n):
        for k, variable in enumerate(block.variables[i]):
            jacobian[i, :, block.stage[i], variable] += block.slope[i, :, k]
    return jacobian.reshape(n * rows, stages * size)


@pytest.mark.parametrize("corrected", [False, True])
def test_condensed_rows_fulfil_the_linearised_conditions(corrected):
    """For H d + q = J'(z + dz), J d + g = s + ds and z ds + s dz = goal - s z, without the rows' own unknowns."""
    rng, stages, size, goal = np.random.default_rng(1), 4, 7, 0.3
    block = random_block(rng, stages, size=size)
    hessian = np.stack([positive(rng, size) for _ in range(stages)])
    gradient = rng.normal(size=(stages, size))
    jacobian, unknown = dense_rows(block, stages, size), stages * size
    s, z, g = (array.ravel() for array in (block.slack, block.multiplier, block.value))
    wanted = goal - (block.slack_change * block.multiplier_change).ravel() * corrected
    condensed, force = hessian.copy(), gradient.copy()
    for part in ((4, len(block.stage)), (0, 4)):
        blocks.add_curvature(block, part, condensed)
        blocks.add_gradient(block, part, goal, corrected, force)
    change = -np.linalg.solve(condensed, force[..., None])[..., 0]
    blocks.set_changes(block, goal, corrected, change)
    d, ds, dz = change.ravel(), block.slack_change.ravel(), block.multiplier_change.ravel()
    whole = np.zeros((stages, size, stages, size))
    whole[np.arange(stages), :, np.arange(stages)] = hessian
    stationary = whole.reshape(unknown, unknown) @ d + gradient.ravel() - jacobian.T @ (z + dz)
    np.testing.assert_allclose(stationary, 0.0, atol=1e-9)
    np.testing.assert_allclose(jacobian @ d + g, s + ds, atol=1e-9)
    np.testing.assert_allclose(z * ds + s * dz, wanted - s * z, atol=1e-9)


def test_steps_keep_slacks_and_multipliers_positive():
    """The longest step ends where the first of them is zero; shorter ones do what the sums say."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        block = random_block(rng)
        primal = blocks.longest(block.slack, block.slack_change)
        dual = blocks.longest(block.multiplier, block.multiplier_change)
        ends = block.slack + primal * block.slack_change, block.multiplier + dual * block.multiplier_change
        for end, step in zip(ends, (primal, dual), strict=True):
            assert end.min() >= -1e-12 and (step == pytest.approx(1.01) or end.min() < 1e-12)
        expected = blocks.product_after(block, 0.9 * primal, 0.8 * dual)
        together = method.longest_steps((block, block), 0.9)
        np.testing.assert_allclose(together, np.minimum(0.9 * np.array([primal, dual]), 1.0), rtol=1e-12)
        blocks.move(block, 0.9 * primal, 0.8 * dual, False)
        assert block.slack.min() > 0.0 and block.multiplier.min() > 0.0
        assert expected == pytest.approx((block.slack * block.multiplier).sum())
        mismatch = (np.abs(block.value - block.slack) * block.multiplier).sum()
        assert blocks.state(block) == pytest.approx((-block.value.min(), expected, mismatch))


def test_linear_rows_change_with_a_step_as_their_slopes_say():
    rng, stages, size = np.random.default_rng(4), 4, 7
    block, change = random_block(rng, stages, size=size), rng.normal(size=(stages, size))
    expected = block.value.ravel() + 0.3 * dense_rows(block, stages, size) @ change.ravel()
    blocks.set_changes(block, 0.1, False, change)
    blocks.move(block, 0.3, 0.2, True)
    np.testing.assert_allclose(block.value.ravel(), expected, rtol=0.0, atol=1e-12)


def test_prices_and_their_derivatives():
    """Of single variables and of sums, one of which names a variable twice: a quadratic function of the variables."""
    rng, stages, size, n = np.random.default_rng(5), 3, 6, 8
    single = Prices(rng.integers(0, stages, n), rng.integers(0, size, n), *rng.normal(size=(3, n)))
    variables = rng.integers(0, size, (n, 3))
    variables[0, 1] = variables[0, 0]
    sums = Squares(rng.integers(0, stages, n), variables, rng.normal(size=(n, 3)), *rng.uniform(0.0, 2.0, (2, n)))

    def model(y):
        hessian, gradient = np.zeros((stages, size, size)), np.zeros((stages, size))
        value = add_prices(single, (0, n), y, hessian, gradient) + add_squares(sums, (0, n), y, hessian, gradient)
        return value, gradient, hessian

    y, step = rng.normal(size=(2, stages, size))
    value, gradient, hessian = model(y)
    taken = y[single.stage, single.variable]
    expected = single.linear @ taken + single.quadratic @ (taken - single.wanted) ** 2
    off = (sums.factors * y[sums.stage[:, None], sums.variables]).sum(1) - sums.wanted
    assert value == pytest.approx(expected + sums.weight @ off**2)
    bend = np.einsum("ti,tij,tj", step, hessian, step)
    assert model(y + step)[0] == pytest.approx(value + (gradient * step).sum() + bend / 2)


def model_of(program, y, floor, work):
    """Fill the model of all stages at y; returns the objective."""
    prices, squares, given = program.prices, Squares.none(), program.blocks
    method.prepare(prices, squares, given, work)
    return method.evaluate(program.steps, prices, squares, given, 0, len(y), program.layout.size, y, floor, False, work)


@pytest.fixture(scope="module")
def transition(robot):
    """A program of a transition with both palms, so that every kind of row is there, at a point near its guess."""
    rng = np.random.default_rng(3)
    sample, config = sample_transition(robot, Category.MOVE_FOOT_WITH_PALMS, rng), SequenceConfig()
    given = sample.stance, sample.com, sample.com_velocity, sample.transition
    problem = transition_problem(robot, *given, config=config.problem)
    program = Program(problem, robot, config.body, config.regularisers)
    size, y = program.layout.size, guess(program)
    inside = np.arange(y.shape[1]) < size[:, None]
    y[inside] += 0.01 * rng.normal(size=inside.sum())
    work = Work.of(len(size), program.layout.states, y.shape[1])
    assert len(work.hessian) == len(size)  # all stages in one group
    for block in program.blocks:
        block.multiplier[:] = rng.uniform(0.1, 2.0, block.multiplier.shape)
    model_of(program, y, 0.01, work)
    for block in program.blocks:
        block.slack[:] = np.maximum(block.value, 0.1)
    return SimpleNamespace(program=program, y=y, work=work, inside=inside)


def test_a_newton_step_of_a_transition_is_that_of_the_dense_system(transition):
    """All stages, rows and dynamics at once, with the rows' slacks and multipliers as unknowns of their own."""
    program, work, inside, goal = transition.program, transition.work, transition.inside, 0.05
    size, states = program.layout.size, program.layout.states
    stages, m = inside.shape
    number = np.full(inside.shape, -1)
    number[inside] = np.arange(inside.sum())
    whole = np.zeros((inside.sum(),) * 2)
    for t, k in enumerate(size):
        lower = np.tril(work.hessian[t, :k, :k])
        whole[np.ix_(number[t, :k], number[t, :k])] = lower + np.tril(lower, -1).T
    rows, value = [np.eye(states, len(whole))], [np.zeros(states)]
    for t, k in enumerate(size[:-1]):
        part = np.zeros((states, len(whole)))
        part[:, number[t, :k]] = work.following[t, :, :k]
        part[:, number[t + 1, :states]] -= np.eye(states)
        rows.append(part)
        value.append(work.defect[t])
    jacobian = np.concatenate([dense_rows(block, stages, m)[:, inside.ravel()] for block in program.blocks])
    s, z, g = (
        np.concatenate([getattr(block, name).ravel() for block in program.blocks])
        for name in ("slack", "multiplier", "value")
    )
    # Unknowns: the variables, then dz, whose ds = (goal - z s - s dz) / z stands in the rows J d + g = s + ds.
    system = np.block([[whole, -jacobian.T], [jacobian, np.diag(s / z)]])
    right = np.concatenate([work.gradient[inside] - jacobian.T @ z, g - goal / z])
    equal = np.hstack([np.concatenate(rows), np.zeros((len(rows) * states, len(s)))])
    expected = newton_step(system, right, equal, np.concatenate(value))

    for block in program.blocks:
        blocks.add_curvature(block, (0, len(block.stage)), work.hessian)
    newton.factor(0, stages, size, work.hessian, work.following, work.sweep)
    method.backward(program.blocks, 0, stages, size, goal, False, work)
    method.forward(program.blocks, size, goal, False, work)
    found = work.change[inside]
    scale = np.abs(expected[: len(whole)]).max()
    np.testing.assert_allclose(found, expected[: len(whole)], atol=1e-6 * scale)  # conditioned like 1e9
    changes = np.concatenate([block.multiplier_change.ravel() for block in program.blocks])
    np.testing.assert_allclose(changes, expected[len(whole) :], atol=1e-6 * np.abs(changes).max())


def test_stages_in_small_groups_lead_to_the_same_motion(transition):
    program, start = transition.program, guess(transition.program)
    given = program.steps, program.prices, Squares.none(), program.blocks, program.layout.size
    motions = []
    for group in (len(start), 4):
        work = transition.work._replace(hessian=np.zeros((group, *transition.work.hessian.shape[1:])))
        y = start.copy()
        assert method.minimise(*given, y, work, Options(False))[0]
        motions.append(y[transition.inside])
    np.testing.assert_allclose(*motions, rtol=0.0, atol=1e-9)


def test_a_cone_s_row_is_zero_on_its_boundary_and_falls_outside(transition):
    program, work = transition.program, transition.work
    block, y = program.blocks.contacts, transition.y.copy()
    at, index = block.stage[0], block.variables[0]
    y[at, index[[6, 7, 8]]] = 0.0  # nothing taken back: the wanted margin of friction
    most = block.parameters[0, 0] * block.parameters[0, 3] * y[at, index[2]]
    for part, sign in ((0.5, 1), (1.0, 0), (1.5, -1)):
        y[at, index[:2]] = part * most * np.array([0.6, -0.8])
        model_of(program, y, 0.0, work)
        value = block.value[0, CONE] / SHARPNESS
        assert np.sign(np.round(value, 6)) == sign
        assert value == pytest.approx((1 - part**2) * most, abs=1e-6)


def test_a_cone_that_holds_less_than_the_floor_has_one_branch(transition):
    """What friction can hold may be negative while the linear rows do not hold: the row then refuses any force."""
    program, work = transition.program, transition.work
    block, y, floor = program.blocks.contacts, transition.y.copy(), 0.01
    at, index = block.stage[0], block.variables[0]
    y[at, index[[6, 7, 8]]] = 0.0
    values, slopes = [], []
    for load in (-0.1, -1e-3, 0.0, 1e-3):
        y[at, index[:3]] = 0.003, 0.004, load
        model_of(program, y, floor, work)
        held = block.parameters[0, 0] * block.parameters[0, 3] * load
        values.append(block.value[0, CONE] / SHARPNESS - held)
        slopes.append(block.slope[0, CONE, :3].copy())
    np.testing.assert_allclose(values, -(0.005**2) / floor, atol=2e-7)
    np.testing.assert_allclose(np.ptp(slopes, axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(slopes[0][:2] / SHARPNESS, [-0.6, -0.8], atol=1e-12)
