"""The momentum dynamics are exact, and the same for every kind of number."""

import casadi as ca
import numpy as np
import pytest

from toolkit.compiled import compiled
from toolkit.geometry.pose import rotation_exponential
from toolkit.physics.momentum import advanced, cross, fill_wrench_map, spin, spin_rate

GRAVITY, DT = 9.81, 0.3


def run(function, *arguments):
    return np.array(compiled(function)(*arguments))


def symbols(function, dt, gravity, *vectors):
    """What a law says of CasADi's symbols, evaluated."""
    names = [ca.SX.sym(f"v{index}", len(vector)) for index, vector in enumerate(vectors)]
    return np.array(ca.Function("law", names, [ca.vertcat(*function(dt, gravity, *names))])(*vectors)).ravel()


@pytest.fixture
def step():
    rng = np.random.default_rng(0)
    return rng.normal(size=9), rng.normal(size=3), rng.normal(size=3)


def test_one_definition_serves_floats_arrays_compiled_code_and_symbols(step):
    for law in (advanced, spin_rate):
        expected = np.array(law(DT, GRAVITY, *step))
        np.testing.assert_allclose(run(law, DT, GRAVITY, *step), expected, rtol=1e-14)
        np.testing.assert_allclose(symbols(law, DT, GRAVITY, *step), expected, rtol=1e-14)
        columns = [np.stack([part, 2.0 * part], 1) for part in step]
        np.testing.assert_allclose(np.array(law(DT, GRAVITY, *columns))[:, 0], expected, rtol=1e-14)


def test_many_small_steps_lead_where_one_step_does(step):
    state, force, moment = step
    acceleration = force - [0.0, 0.0, GRAVITY]
    fine = state
    for _ in range(1000):
        fine = np.array(advanced(DT / 1000, GRAVITY, fine, acceleration, moment))
    np.testing.assert_allclose(advanced(DT, GRAVITY, state, acceleration, moment), fine, rtol=1e-11)


def test_the_angular_momentum_about_the_com_changes_at_its_rate(step):
    state, force, moment = step
    after = advanced(DT, GRAVITY, state, force - [0.0, 0.0, GRAVITY], moment)
    gained = np.subtract(spin(np.array(after)), spin(state))
    np.testing.assert_allclose(gained / DT, spin_rate(DT, GRAVITY, state, force, moment), rtol=1e-11)


def test_the_wrench_map_is_force_and_moment_about_the_point():
    rng = np.random.default_rng(1)
    rotation, lever, wrench = rotation_exponential(rng.normal(size=3)), rng.normal(size=3), rng.normal(size=6)
    out = np.zeros((6, 6))
    fill_wrench_map(rotation, lever, out)
    force = rotation @ wrench[:3]
    np.testing.assert_allclose(out @ wrench, [*force, *(cross(lever, force) + rotation @ wrench[3:])], rtol=1e-13)
