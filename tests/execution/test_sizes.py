"""Robots that are smaller or larger than the usual one walk as well as it does."""

from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import Plan, walk
from tests.robot.sizes import SIZES, label, sized_robot
from toolkit.contacts.sequence import ContactSequence
from toolkit.execution.check import Result
from toolkit.execution.config import SCUFF_LIMIT, ExecutionConfig
from toolkit.execution.standard import Standard
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.costs.plan_cost import plan_cost
from toolkit.world.timing import Timing


@pytest.fixture(params=SIZES, ids=label, scope="module")
def size(request):
    return request.param


@pytest.fixture(scope="module")
def sized(size, robot, flat, tmp_path_factory):
    """The short walk of the usual robot, by one of another size: lengths to scale, times to their root."""
    other = sized_robot(tmp_path_factory.mktemp("sized"), size)
    step, pace = 0.2 * other.com_height, np.sqrt(size[0])
    planned = walk(other, 2, step)
    timing = Timing(0.4 * pace, 0.6 * pace)
    steps = tuple(replace(transition, timing=timing) for transition in planned.transitions)
    return Plan(other, flat(step), ContactSequence(planned.start, steps), pace)


def test_its_motion_is_the_same_to_scale(size, sized, walking):
    """To the rounding of the robot's scale, whose force has three digits, and of the solver."""
    length, mass = size
    usual, other = walking.motion, sized.motion
    np.testing.assert_allclose(other.com, length * usual.com, rtol=0.0, atol=1e-4 * length)
    np.testing.assert_allclose(other.force, mass * usual.force, rtol=0.0, atol=1e-3 * mass * 68.0 * 9.81)
    assert other.objective == pytest.approx(np.sqrt(length) * usual.objective, rel=2e-3)  # an integral over time
    cost, least = plan_cost(sized.whole, CostConfig()), plan_cost(walking.whole, CostConfig())
    for name in ("way", "step", "time", "dynamics"):
        assert cost.terms[name] == pytest.approx(length * least.terms[name], rel=2e-3), name


def test_its_postures_are_the_same(size, sized, walking):
    length, mass = size
    usual, other = walking.trajectory, sized.trajectory
    np.testing.assert_allclose(other.times, np.sqrt(length) * usual.times, rtol=1e-12)
    np.testing.assert_allclose(other.qpos[:, 3:], usual.qpos[:, 3:], rtol=0.0, atol=2e-4)
    np.testing.assert_allclose(other.qpos[:, :3], length * usual.qpos[:, :3], rtol=0.0, atol=1e-4 * length)
    np.testing.assert_allclose(other.torque, length * mass * usual.torque, rtol=0.0, atol=length * mass)


def test_its_run_is_held_against_limits_to_scale(size, sized):
    length, _ = size
    standard = Standard.of(sized.whole, ExecutionConfig(), (), 1)
    assert standard.com_rms_limit == pytest.approx(0.02 * length)
    assert standard.scuff_limit == pytest.approx(SCUFF_LIMIT * np.sqrt(length))
    assert standard.slip_limit == 0.02  # simulated contacts creep alike under bodies of all sizes


def test_its_swings_are_the_same_to_scale(size, sized, walking):
    length, _ = size
    for usual, other in zip(walking.paths.segments[:2], sized.paths.segments[:2], strict=True):
        for own, theirs in zip(usual, other, strict=True):
            assert (own.path is None) == (theirs.path is None)
            if own.path is not None and theirs.path is not None:
                u = np.linspace(0.0, 1.0, 21)
                ways = [path.positions(u) - path.start.position for path in (own.path, theirs.path)]
                np.testing.assert_allclose(ways[1], length * ways[0], rtol=0.0, atol=1e-6 * length)


def test_it_walks_as_well_as_the_usual_robot(size, sized, walked):
    length, _ = size
    assert sized.trajectory.feasible, sized.trajectory.reason
    run = sized.run()
    assert {check.name for check in run.checks if check.result is not Result.PASS} == set()
    assert run.com_rms_error < max(1.5 * length * walked.com_rms_error, 1e-4)  # m; simulated contacts give by as much
    assert run.max_slip < 1e-4  # m; simulated contacts creep alike under bodies of all sizes
    assert run.max_torque_ratio < 1.5 * walked.max_torque_ratio
    assert run.solver_failures == 0
