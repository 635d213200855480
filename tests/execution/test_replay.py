"""A replay goes through the recorded states bit for bit and measures every check anew."""

import dataclasses

import numpy as np
import pytest

from toolkit.errors import ExecutionError
from toolkit.execution.check import Check, Result
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import Disturbance
from toolkit.execution.replay import checks_difference, difference, replay_run
from toolkit.execution.run import execute


def changed(execution, **values):
    """The execution with other controls."""
    return dataclasses.replace(execution, controls=dataclasses.replace(execution.controls, **values))


def assert_equal(one, other):
    """Everything that was measured is equal, bit for bit; a clock may have gone differently."""
    for name, value in one.named().items():
        if name not in ("tick_seconds", "real_time_factor") and not name.startswith("replan"):
            np.testing.assert_array_equal(value, other.named()[name], err_msg=name)


def test_a_replay_is_the_run_itself(walked):
    shares = []
    again = replay_run(walked, observer=shares.append)
    assert difference(walked, again) == ""
    assert_equal(walked, again)
    assert shares == sorted(shares) and shares[0] == 0.0 and 0.9 < shares[-1] < 1.0


def test_a_pushed_run_on_a_finer_clock_replays_with_its_pushes(walking):
    disturbance = Disturbance(push=40.0, push_time=0.401, mass_error=0.03, terrain_offset=0.002, delay=0.002)
    config = ExecutionConfig(timestep=0.001, control_decimation=2, disturbance=disturbance)
    execution = walking.run(config=config, rng=np.random.default_rng(2))
    push = execution.controls.push
    assert push is not None and np.count_nonzero(push.any(1)) == 200  # 0.2 s of steps of 1 ms
    again = replay_run(execution)
    assert difference(execution, again) == ""
    assert_equal(execution, again)
    assert difference(execution, replay_run(changed(execution, push=None)))


def test_a_fall_is_replayed_as_a_fall(walking):
    weak = dataclasses.replace(walking.robot, torque_limit=0.01 * walking.robot.torque_limit)
    fell = execute(dataclasses.replace(walking.whole, robot=weak))
    again = replay_run(fell)
    assert fell.fall is not None and again.fall == fell.fall and again.failure == fell.failure
    assert difference(fell, again) == ""


def test_a_simulation_that_diverged_is_replayed_as_that(standing):
    trajectory = standing.whole.trajectory
    wild = trajectory.qvel.copy()
    wild[0, -1] = 1e11
    plan = dataclasses.replace(standing.whole, trajectory=dataclasses.replace(trajectory, qvel=wild))
    fell = execute(plan, config=ExecutionConfig(timestep=0.001, control_decimation=2))
    again = replay_run(fell)
    assert fell.fall is not None and fell.fall.reason.startswith("the simulation diverged: ")
    assert again.fall == fell.fall and again.failure == fell.failure and difference(fell, again) == ""


def test_other_controls_differ_from_their_first_tick_on(walked):
    ctrl = walked.controls.ctrl.copy()
    ctrl[100] += 1e-9
    again = replay_run(changed(walked, ctrl=ctrl))
    assert difference(walked, again).startswith("the states are others from 0.202 s on")


def test_a_run_without_torques_fails_its_replay(walked):
    again = replay_run(changed(walked, ctrl=0.0 * walked.controls.ctrl))
    assert again.fall is not None and not again.completed
    failed = {check.name for check in again.checks if check.result is not Result.PASS}
    assert {"upright", "completed", "touchdowns"} <= failed
    assert "the states are others" in difference(walked, again)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"slip_limit": 1e-9}, "slip"),
        ({"com_rms_limit": 1e-9}, "com_rms_error"),
        ({"ticks": 10**6}, "completed"),
    ],
)
def test_a_stricter_standard_fails_its_check(walked, changes, name):
    strict = dataclasses.replace(walked, standard=dataclasses.replace(walked.standard, **changes))
    again = replay_run(strict)
    assert {check.name for check in again.checks if check.result is Result.FAIL} == {name}
    assert again.failure is not None and again.failure.reason.startswith(name)


def test_limits_of_joints_are_held_against_the_replay(walked):
    robot = walked.standard.robot
    weak = dataclasses.replace(robot, torque_limit=0.1 * robot.torque_limit, velocity_limit=0.01 * robot.velocity_limit)
    again = replay_run(dataclasses.replace(walked, standard=dataclasses.replace(walked.standard, robot=weak)))
    failed = {check.name for check in again.checks if check.result is Result.FAIL}
    assert {"torque_ratio", "velocity_ratio"} <= failed


def test_a_limb_that_may_not_touch_is_an_unplanned_contact(walked):
    samples = dataclasses.replace(walked.samples, may_touch=np.zeros_like(walked.samples.may_touch))
    again = replay_run(dataclasses.replace(walked, samples=samples))
    values = {check.name: check.value for check in again.checks}
    assert values["unplanned_contacts"] >= 2.0
    assert difference(walked, again).startswith("unplanned_contacts is ")


def test_steps_that_do_not_fit_the_ticks_are_refused(walked):
    with pytest.raises(ExecutionError, match="steps in"):
        replay_run(changed(walked, ctrl=walked.controls.ctrl[:-1]))


def test_a_check_that_the_record_tells_otherwise_is_named():
    slip = Check("slip", 0.02, "m", 0.001)
    assert checks_difference([slip], [slip]) == ""
    other = dataclasses.replace(slip, value=0.002)
    assert checks_difference([other], [slip]) == (
        "slip is 0.001 of at most 0.02 m, in the record 0.002 of at most 0.02"
    )
    assert checks_difference([], [slip]) == "the record has no check slip"
