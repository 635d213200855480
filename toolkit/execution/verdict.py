"""The checks that an execution decides."""

from __future__ import annotations

from toolkit.execution.check import Check, Result
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.contact_meter import Press, Touch
from toolkit.execution.standard import Standard

RANGE_TOLERANCE = 1e-3  # rad; excess over joint ranges, because limits of the simulation are soft

OF_PACE = ("torque_ratio", "joint_range", "velocity_ratio")
"""Checks of the joints' limits: where one of them decides, a calmer pace may help."""


def execution_checks(
    values: dict[str, float], goal_radius: float, config: ExecutionConfig | Standard
) -> tuple[Check, ...]:
    """Hold what was measured against its limits, the gravest check first.

    Args:
        values: By check: a flag that something went wrong, a number of events, or a value in the check's unit.
        goal_radius: Largest distance to the goal in m.
        config: Limits.
    """
    limits = {
        "upright": (0.0, ""),
        "completed": (0.0, ""),
        "touchdowns": (0.0, ""),
        "goal_distance": (goal_radius, "m"),
        "balance": (0.0, "m"),
        "unplanned_contacts": (0.0, ""),
        "friction": (0.0, ""),
        "scuff": (config.scuff_limit, "m/s"),
        "slip": (config.slip_limit, "m"),
        "com_rms_error": (config.com_rms_limit, "m"),
        "torque_ratio": (1.0, ""),
        "joint_range": (RANGE_TOLERANCE, "rad"),
        "velocity_ratio": (1.0, ""),
    }
    return tuple(Check(name, limit, unit, values[name]) for name, (limit, unit) in limits.items())


def failure_reason(
    checks: tuple[Check, ...], fall_reason: str, touch: Touch | None = None, press: Press | None = None
) -> str:
    """One line on the fall or else on the first check that failed, and on what touched or pressed; "" where all passed.

    The first unplanned contact is named where those are the failure, and links that pressed on each other anyway.
    """
    failed = next((check for check in checks if check.result is not Result.PASS), None)
    if fall_reason:
        reason = f"the robot fell: {fall_reason}"
    elif failed is not None:
        reason = f"{failed.name} is {failed.value:.3g} {failed.unit}".rstrip() + f", the limit is {failed.limit:.3g}"
    else:
        return ""
    if touch is not None and not fall_reason and failed is not None and failed.name == "unplanned_contacts":
        reason = f"{reason}; {touch.robot} touched {touch.world} at {touch.time:.2f} s"
    if press is None:
        return reason
    what = f"{press.first} and {press.second} pressed on each other"
    return f"{reason}; {what} with {press.force:.0f} N at {press.time:.2f} s"


def is_too_fast(checks: tuple[Check, ...], fall_reason: str) -> bool:
    """Whether the joints' limits alone are why a run does not pass."""
    failed = [check.name for check in checks if check.result is not Result.PASS]
    return bool(failed) and not fall_reason and all(name in OF_PACE for name in failed)
