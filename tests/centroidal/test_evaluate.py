"""The compiled residual check is what its source says in plain Python, of good motions and of broken ones."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.centroidal import residual
from toolkit.centroidal.arrays import MotionArrays, ProblemArrays
from toolkit.centroidal.build import initial_com, transition_problem
from toolkit.centroidal.problem import STANDARD_GRAVITY, Margins
from toolkit.centroidal.sequence import optimise_transition
from toolkit.contacts.category import Category
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.physics.momentum import advanced, cross, fill_wrench_map, spin
from toolkit.physics.wrench import SIGNS, pressure, pressure_rows, yaw_row
from validation.random_contacts import SamplingConfig, sample_transition


def agree(motion):
    """Largest residual of a motion; compiled and interpreted, residuals and costs are the same."""
    arguments = ProblemArrays.of(motion.problem), MotionArrays.of(motion)
    (quick, costs), (slow, expected) = residual.evaluate(*arguments), residual.evaluate.py_func(*arguments)
    np.testing.assert_allclose(quick, slow, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(costs, expected, rtol=1e-12, atol=0)
    assert isinstance(quick, residual.Residuals)
    return quick.largest


@pytest.fixture(scope="module")
def motions(robot):
    rng = np.random.default_rng(0)
    found = []
    for category in Category:
        while sum(item[0] == category for item in found) < 3:
            sample = sample_transition(robot, category, rng, SamplingConfig(speed_spread=0.3))
            given = sample.stance, sample.com, sample.com_velocity, sample.transition
            motion = optimise_transition(robot, *given)
            if motion.feasible:
                found.append((category, replace(motion, problem=motion.solved, kept=None)))
    return [motion for _, motion in found]


def test_it_confirms_what_the_solver_found(motions):
    for motion in motions:
        assert agree(motion) <= residual.TOLERANCE


@pytest.mark.parametrize("name", MotionArrays._fields)
def test_it_sees_noise_in_every_array(motions, name):
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
def test_a_motion_of_another_problem_is_refused(motions, change):
    broken = [agree(replace(motion, problem=replace(motion.problem, **change(motion.problem)))) for motion in motions]
    assert max(broken) > residual.TOLERANCE


def test_what_is_undefined_is_infinitely_wrong(motions):
    for name in MotionArrays._fields:
        for value in (np.nan, np.inf):
            values = getattr(motions[0], name).copy()
            values.flat[-1] = value
            assert agree(replace(motions[0], **{name: values})) == np.inf


@pytest.mark.parametrize("margins", [Margins(), Margins(friction=0.8, cop=(0.02, 0.01), yaw=0.6)])
def test_the_independent_check_agrees_with_the_laws(robot, feet, margins):
    """A motion of random wrenches that is integrated by the law has no residual of its dynamics, and those residuals
    of its contacts that the rows of the cone say."""
    rng = np.random.default_rng(2)
    palm = Contact(Limb.LEFT_PALM, Pose(np.eye(3), np.array([0.0, 0.6, 1.3])), 0.5)
    transition = ContactTransition(Limb.LEFT_PALM, palm)
    problem = transition_problem(robot, feet, initial_com(robot, feet), rng.normal(size=3), transition)
    problem = replace(problem, margins=margins)
    n, weight = problem.steps, robot.mass * STANDARD_GRAVITY
    wrench = rng.normal(size=(n, 4, 6)) * [0.3, 0.3, 0.3, 0.03, 0.03, 0.03] + [0, 0, 0.6, 0, 0, 0]
    state = np.concatenate([problem.com, problem.com_velocity, cross(problem.com, problem.com_velocity)])
    knots, motion = [state], [np.zeros((n, 4, 3)), np.zeros((n, 4, 2)), np.zeros((n, 4))]
    worst = {"cop": 0.0, "yaw": 0.0}
    for t in range(n):
        total = np.zeros(6)
        for i in np.flatnonzero(problem.active[t]):
            to_world, w = np.zeros((6, 6)), wrench[t, i]
            fill_wrench_map(problem.rotation[t, i], problem.position[t, i], to_world)
            total += STANDARD_GRAVITY * to_world @ w
            *motion[1][t, i], motion[2][t, i] = pressure(w, w[2])
            motion[0][t, i], motion[2][t, i] = weight * problem.rotation[t, i] @ w[:3], weight * motion[2][t, i]
            x, y = problem.reduced_half_size[t, i]
            turning = margins.yaw * margins.friction * problem.friction[t, i]
            rows = [yaw_row(turning, x, y, *signs) for signs in SIGNS]
            worst["cop"] = max(worst["cop"], (np.array(pressure_rows(x, y)) @ w).max())
            worst["yaw"] = max(worst["yaw"], (np.array(rows) @ w).max())
        state = np.array(
            advanced(problem.dt[t], STANDARD_GRAVITY, state, total[:3] - [0.0, 0.0, STANDARD_GRAVITY], total[3:])
        )
        knots.append(state)
    com, velocity = np.array(knots)[:, :3].copy(), np.array(knots)[:, 3:6]
    angular = robot.mass * np.array([spin(knot) for knot in knots])
    found, _ = residual.evaluate(ProblemArrays.of(problem), MotionArrays(com, robot.mass * velocity, angular, *motion))
    assert found.initial < 1e-12 and found.dynamics < 1e-11
    np.testing.assert_allclose([found.cop, found.yaw], [worst["cop"], worst["yaw"]], rtol=1e-9)
