"""Robots that are smaller or larger than the usual one walk as well as it does."""

from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import Plan, walk
from tests.robot.samples import write_scaled
from tests.shipped_robots import OWN
from toolkit.contacts.sequence import ContactSequence
from toolkit.execution.check import Result
from toolkit.robot.loader import load_robot
from toolkit.world.timing import Timing

SIZES = (  # factors on length and mass: a robot of 3 kg, and a giant
    (0.5, 3.0 / 68.0),
    (2.0, 8.0),
)


@pytest.fixture(params=SIZES, ids=lambda size: f"length {size[0]:g}", scope="module")
def size(request):
    return request.param


@pytest.fixture(scope="module")
def sized(size, robot, flat, tmp_path_factory):
    """The short walk of the usual robot, by one of another size: lengths to scale, times to their root."""
    length, mass = size
    other = load_robot(str(write_scaled(tmp_path_factory.mktemp("sized") / "robot", OWN[0], length, mass)))
    step, pace = 0.2 * other.com_height, np.sqrt(length)
    planned = walk(other, 2, step)
    timing = Timing(0.4 * pace, 0.6 * pace)
    steps = tuple(replace(transition, timing=timing) for transition in planned.transitions)
    return Plan(other, flat(step), ContactSequence(planned.start, steps))


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
    assert run.com_rms_error < 1.5 * length * walked.com_rms_error
    assert run.max_slip < 1e-4  # m; simulated contacts creep alike under bodies of all sizes
    assert run.max_torque_ratio < 1.5 * walked.max_torque_ratio
    assert run.solver_failures == 0
