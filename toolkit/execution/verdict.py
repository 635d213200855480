"""The checks that an execution decides."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.execution.check import Check, Result
from toolkit.execution.config import ExecutionConfig

RANGE_TOLERANCE = 1e-3  # rad; of joint ranges: limits of the simulation are soft


@dataclass(frozen=True)
class Measured:
    """What the checks look at; units as in `Execution`.

    Attributes:
        completed: the plan was run to its end, on its feet.
        fall_reason: "" where the robot did not fall.
        range_excess: rad; largest excess of a joint beyond its range.
        goal_radius: m.
        friction_mismatches: contacts whose friction was not the world's.
        missed_touchdowns: planned contacts that were never made.
        max_slip, com_rms_error, max_torque_ratio, max_velocity_ratio, final_goal_distance: as in `Execution`.
        unplanned_contacts: number of distinct geom pairs.
    """

    completed: bool
    fall_reason: str
    max_slip: float
    com_rms_error: float
    max_torque_ratio: float
    max_velocity_ratio: float
    range_excess: float
    final_goal_distance: float
    goal_radius: float
    unplanned_contacts: int
    friction_mismatches: int
    missed_touchdowns: int


def execution_checks(measured: Measured, config: ExecutionConfig) -> tuple[Check, ...]:
    """Hold what was measured against its limits.

    Args:
        measured: values.
        config: limits.

    Returns:
        Checks, the gravest first.
    """
    return (
        Check("upright", 0.0, "", float(bool(measured.fall_reason))),
        Check("completed", 0.0, "", float(not measured.completed)),
        Check("touchdowns", 0.0, "", float(measured.missed_touchdowns)),
        Check("goal_distance", measured.goal_radius, "m", measured.final_goal_distance),
        Check("unplanned_contacts", 0.0, "", float(measured.unplanned_contacts)),
        Check("friction", 0.0, "", float(measured.friction_mismatches)),
        Check("slip", config.slip_limit, "m", measured.max_slip),
        Check("com_rms_error", config.com_rms_limit, "m", measured.com_rms_error),
        Check("torque_ratio", 1.0, "", measured.max_torque_ratio),
        Check("joint_range", RANGE_TOLERANCE, "rad", measured.range_excess),
        Check("velocity_ratio", 1.0, "", measured.max_velocity_ratio),
    )


def failure_reason(checks: tuple[Check, ...], fall_reason: str = "") -> str:
    """One line on the first check that did not pass, "" where all were measured and did.

    Args:
        checks: as `execution_checks` gives them.
        fall_reason: how the robot fell, if it did.
    """
    if not checks:
        return "nothing was checked"
    if fall_reason:
        return f"the robot fell: {fall_reason}"
    for check in checks:
        if check.result is Result.NOT_CHECKED:
            return f"{check.name} was not checked"
        if check.result is Result.FAIL:
            return f"{check.name} is {check.value:.3g} {check.unit}".rstrip() + f", the limit is {check.limit:.3g}"
    return ""
