"""Every check fails on a broken execution, and the reason says what broke."""

import pytest

from toolkit.execution.check import Result
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.contact_meter import Press, Touch
from toolkit.execution.verdict import execution_checks, failure_reason, is_too_fast

GOOD = {
    "upright": 0.0,
    "completed": 0.0,
    "touchdowns": 0.0,
    "goal_distance": 0.05,
    "balance": 0.0,
    "unplanned_contacts": 0.0,
    "friction": 0.0,
    "scuff": 0.01,
    "slip": 0.001,
    "com_rms_error": 0.002,
    "torque_ratio": 0.8,
    "joint_range": 0.0,
    "velocity_ratio": 0.7,
}
BROKEN = {
    "upright": 1.0,
    "completed": 1.0,
    "touchdowns": 1.0,
    "goal_distance": 0.201,
    "balance": 0.01,
    "unplanned_contacts": 1.0,
    "friction": 1.0,
    "scuff": 0.0501,
    "slip": 0.0201,
    "com_rms_error": 0.0201,
    "torque_ratio": 1.001,
    "joint_range": 0.01,
    "velocity_ratio": 1.001,
}


def checked(values):
    return execution_checks(values, 0.2, ExecutionConfig())


def results(values):
    return {check.name: check.result for check in checked(values)}


def test_a_good_execution_passes_every_check():
    assert set(results(GOOD).values()) == {Result.PASS}
    assert failure_reason(checked(GOOD), "") == ""


def test_links_that_pressed_are_named_where_a_run_fails():
    press = Press("left_thigh", "right_thigh", 3.254, 91.3)
    words = "; left_thigh and right_thigh pressed on each other with 91 N at 3.25 s"
    assert failure_reason(checked(GOOD), "", press=press) == ""
    assert failure_reason(checked(GOOD), "it sank", press=press) == "the robot fell: it sank" + words
    reason = failure_reason(checked(GOOD | {"slip": BROKEN["slip"]}), "", press=press)
    assert reason.endswith("the limit is 0.02" + words)


def test_what_touched_first_is_named_where_that_is_the_failure():
    touch, broken = Touch("left_forearm", "world/wall", 7.384), {"unplanned_contacts": BROKEN["unplanned_contacts"]}
    words = "; left_forearm touched world/wall at 7.38 s"
    assert failure_reason(checked(GOOD | broken), "", touch).endswith("the limit is 0" + words)
    assert "touched" not in failure_reason(checked(GOOD | {"slip": BROKEN["slip"]}), "", touch)
    assert "touched" not in failure_reason(checked(GOOD | broken), "it sank", touch)


def test_every_check_has_a_broken_input():
    assert set(BROKEN) == set(results(GOOD))


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_execution_fails_that_check_alone_and_says_so(name):
    broken = GOOD | {name: BROKEN[name]}
    found = results(broken)
    assert found.pop(name) is Result.FAIL
    assert set(found.values()) == {Result.PASS}
    reason = failure_reason(checked(broken), "")
    assert reason.startswith(f"{name} is ") and "\n" not in reason


def test_a_fall_is_the_reason():
    assert failure_reason(checked(GOOD | {"upright": 1.0}), "torso touched") == "the robot fell: torso touched"


@pytest.mark.parametrize("name", ["slip", "com_rms_error", "torque_ratio", "goal_distance"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_undefined_values_never_pass(name, value):
    assert results(GOOD | {name: value})[name] is Result.FAIL


@pytest.mark.parametrize(
    ("broken", "fall", "expected"),
    [
        ({}, "", False),
        ({"torque_ratio": 1.1}, "", True),
        ({"joint_range": 0.01, "velocity_ratio": 1.2}, "", True),
        ({"joint_range": 0.01, "slip": 0.5}, "", False),
        ({"joint_range": 0.01}, "torso touched", False),
    ],
)
def test_joints_alone_are_a_matter_of_pace(broken, fall, expected):
    assert is_too_fast(checked(GOOD | broken), fall) == expected
