"""The compiled residual check says what the NumPy one says, of good motions and of broken ones."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.centroidal import residual
from toolkit.centroidal.build import transition_problem
from toolkit.centroidal.bulk_check import residual_and_objective
from toolkit.centroidal.fast import solve
from toolkit.centroidal.problem import Margins
from toolkit.centroidal.sampling import SamplingConfig, sample_transition
from toolkit.contacts.category import Category

ARRAYS = ("com", "linear_momentum", "angular_momentum", "force", "cop", "yaw_torque")


def compiled(motion):
    return residual_and_objective(motion.problem, tuple(getattr(motion, name) for name in ARRAYS))


def agree(motion):
    worst, value = compiled(motion)
    # rounding of sums in another order
    np.testing.assert_allclose(worst, residual.check(motion).largest, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(value, residual.objective(motion), rtol=1e-9, atol=0)
    return worst


@pytest.fixture(scope="module")
def motions(robot):
    rng = np.random.default_rng(0)
    found = []
    for category in Category:
        while sum(item[0] == category for item in found) < 3:
            sample = sample_transition(robot, category, rng, SamplingConfig(speed_spread=0.3))
            problem = transition_problem(robot, sample.stance, sample.com, sample.com_velocity, sample.transition)
            motion = solve(problem)
            if motion.feasible:
                found.append((category, motion))
    return [motion for _, motion in found]


def test_it_confirms_what_numpy_confirms(motions):
    for motion in motions:
        assert agree(motion) <= residual.TOLERANCE


@pytest.mark.parametrize("name", ARRAYS)
def test_it_measures_every_violation_as_numpy_does(motions, name):
    rng = np.random.default_rng(1)
    for motion in motions:
        values = getattr(motion, name)
        noise = 0.01 * rng.normal(size=values.shape) * (1.0 + np.abs(values))
        assert agree(replace(motion, **{name: values + noise})) > residual.TOLERANCE


@pytest.mark.parametrize(
    "change",
    [
        lambda p: {"friction": 0.2 * p.friction},
        lambda p: {"max_reach": 0.97 * p.max_reach},
        lambda p: {"min_height": p.com[2] + 0.1 - p.position[p.active][:, 2].min()},
        lambda p: {"final_center": p.final_center + [0.3, -0.2, 0.1]},
        lambda p: {"final_at_rest": True, "com_velocity": p.com_velocity + 0.3},
        lambda p: {"max_normal_force": 0.3 * p.max_normal_force.clip(max=1e3)},
        lambda p: {"margins": Margins(friction=0.5, cop=(0.05, 0.03), yaw=0.3)},
        lambda p: {"yaw": p.yaw + 0.4},
        lambda p: {"active": ~p.active},
        lambda p: {"half_size": 0.3 * p.half_size},
    ],
)
def test_it_judges_another_problem_as_numpy_does(motions, change):
    broken = [agree(replace(motion, problem=replace(motion.problem, **change(motion.problem)))) for motion in motions]
    assert max(broken) > residual.TOLERANCE


def test_what_is_undefined_is_infinitely_wrong(motions):
    for name in ARRAYS:
        for value in (np.nan, np.inf):
            values = getattr(motions[0], name).copy()
            values.flat[-1] = value
            assert compiled(replace(motions[0], **{name: values}))[0] == np.inf
