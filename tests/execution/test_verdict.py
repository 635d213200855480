"""Every check fails on a broken execution, and the reason says what broke."""

import dataclasses

import pytest

from toolkit.execution.check import Result
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.verdict import Measured, execution_checks, failure_reason

GOOD = Measured(
    completed=True,
    fall_reason="",
    max_slip=0.001,
    com_rms_error=0.002,
    max_torque_ratio=0.8,
    max_velocity_ratio=0.7,
    range_excess=0.0,
    final_goal_distance=0.05,
    goal_radius=0.2,
    unplanned_contacts=0,
    friction_mismatches=0,
    missed_touchdowns=0,
)
BROKEN = {
    "upright": {"fall_reason": "torso touched the world"},
    "completed": {"completed": False},
    "touchdowns": {"missed_touchdowns": 1},
    "goal_distance": {"final_goal_distance": 0.201},
    "unplanned_contacts": {"unplanned_contacts": 1},
    "friction": {"friction_mismatches": 1},
    "slip": {"max_slip": 0.0201},
    "com_rms_error": {"com_rms_error": 0.0201},
    "torque_ratio": {"max_torque_ratio": 1.001},
    "joint_range": {"range_excess": 0.01},
    "velocity_ratio": {"max_velocity_ratio": 1.001},
}


def results(measured):
    return {check.name: check.result for check in execution_checks(measured, ExecutionConfig())}


def test_a_good_execution_passes_every_check():
    assert set(results(GOOD).values()) == {Result.PASS}
    assert failure_reason(execution_checks(GOOD, ExecutionConfig())) == ""


def test_every_check_has_a_broken_input():
    assert set(BROKEN) == set(results(GOOD))


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_execution_fails_that_check_alone_and_says_so(name):
    measured = dataclasses.replace(GOOD, **BROKEN[name])
    found = results(measured)
    assert found.pop(name) is Result.FAIL
    assert set(found.values()) == {Result.PASS}
    reason = failure_reason(execution_checks(measured, ExecutionConfig()), measured.fall_reason)
    assert reason and "\n" not in reason
    if name == "upright":
        assert "torso touched the world" in reason


@pytest.mark.parametrize("field", ["max_slip", "com_rms_error", "max_torque_ratio", "final_goal_distance"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_undefined_values_never_pass(field, value):
    assert Result.FAIL in results(dataclasses.replace(GOOD, **{field: value})).values()
