"""What the paper could not know: its friction pyramid against the exact cone, and its claim about the steep slope."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from toolkit.centroidal.problem import STANDARD_GRAVITY
from validation.jobs import Record
from validation.page.plans import COLUMNS, Section
from validation.page.spread import rate, spread
from validation.pyramid_trial import CONE, PYRAMID
from validation.tables import markdown_table, values

SLOPE_ANGLE, SLOPE_FRICTION, SLOPE_LENGTH = 30.0, 0.5, 3.0  # degrees; coefficient; m
PAPERS_CONTACTS, PAPERS_STEP = 31, 2.0  # shown; s each


def friction_section(records: Sequence[Record]) -> Section:
    """Both cones on the same contacts: how many motions there are, what they are like, what the simulation says."""
    lines, figures, content = [], [], {}
    for kind in dict.fromkeys(record["kind"] for record in records):
        same = [record for record in records if record["kind"] == kind and record["motions"]]
        for name in (PYRAMID, CONE):
            motions = [record["motions"][name] for record in same]
            lines.append(_line(kind, name, motions))
            figures.append(_figures(kind, name, motions))
            content[f"{kind} {name}"] = motions
    header = ("world", "friction", "motions found", "need more friction than there is", "friction used / held")
    header += ("rejected by the simulation", "of those beyond the cone", "why")
    second = ("world", "friction", *(column.name for column in COLUMNS[1:]))
    text = "\n\n".join([NOTE, markdown_table(header, lines), markdown_table(second, figures), slope_text()])
    return Section("Exact cones against the paper's pyramid", text, [], content)


NOTE = (
    "The same contacts, the paper's weights, timing (1 s + 1 s) and friction, no margins, solved by Ipopt twice: with "
    "|fx| + |fy| <= sqrt(2) mu fz and with the circular cone inside it. On slopes the steps are even ones of about "
    "0.1 m of way each, as the paper's 31 are; elsewhere they are the planner's. MuJoCo carries both out with the same "
    "controller. Motions of the cone without margins are rejected now and then too: their line is the control."
)


def _line(kind: str, name: str, motions: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    found = [motion for motion in motions if motion["feasible"]]
    beyond = [motion for motion in found if motion["beyond_cone"] > 1.001]
    simulated = [motion for motion in found if "executed" in motion]
    sliding = [motion for motion in beyond if "executed" in motion]
    reasons = dict.fromkeys(motion.get("reason") or motion.get("execution_reason", "") for motion in motions)
    return (
        kind,
        name,
        rate(len(found), len(motions)),
        rate(len(beyond), len(found)),
        spread(values(found, "beyond_cone"), ".2f"),
        rate(sum(not motion["executed"] for motion in simulated), len(simulated)) if simulated else "-",
        rate(sum(not motion["executed"] for motion in sliding), len(sliding)) if sliding else "-",
        "; ".join(reason for reason in reasons if reason),
    )


def _figures(kind: str, name: str, motions: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    found = [motion for motion in motions if motion["feasible"]]
    paths = [("objective",), *(column.path for column in COLUMNS[2:])]
    return kind, name, *(spread(values(found, *path)) for path in paths)


def slope_figures(
    angle: float = SLOPE_ANGLE, friction: float = SLOPE_FRICTION, length: float = SLOPE_LENGTH
) -> dict[str, float]:
    """Numbers of a slope of an angle in degrees, a friction coefficient and a length in m.

    Returns:
        The friction angles of the cone and of the pyramid along its axes, in degrees; the least acceleration down the
        slope in m/s^2 with contacts on it alone; the longest time in s on it and the least speed in m/s at its end,
        from rest at its top.
    """
    tilt = math.radians(angle)
    least = STANDARD_GRAVITY * (math.sin(tilt) - friction * math.cos(tilt))
    return {
        "cone_angle": math.degrees(math.atan(friction)),
        "pyramid_angle": math.degrees(math.atan(math.sqrt(2.0) * friction)),
        "acceleration": least,
        "seconds": math.sqrt(2.0 * length / least) if least > 0.0 else math.inf,
        "speed": math.sqrt(2.0 * length * least) if least > 0.0 else 0.0,
    }


def slope_text() -> str:
    """The claim about the slope worked out."""
    found = slope_figures()
    claimed = PAPERS_CONTACTS * PAPERS_STEP
    return (
        f"**The slope.** The paper shows {PAPERS_CONTACTS} contacts of {PAPERS_STEP:g} s on the way down a slope of "
        f"{SLOPE_ANGLE:g} degrees and {SLOPE_LENGTH:g} m with friction {SLOPE_FRICTION:g}: {claimed:g} s. With "
        f"Coulomb's cone a contact holds {found['cone_angle']:.1f} degrees. On a steeper plane the force along it, at "
        "most mu times the normal one, cannot make up for gravity, whatever the robot does with its body: with all "
        "contacts on the slope, forces add up to F_n along the normal and at most mu F_n up the slope. The CoM stays "
        "near a plane parallel to the slope, so F_n = m g cos a on average, and it accelerates downwards by at least "
        f"g (sin a - mu cos a) = {found['acceleration']:.3f} m/s². From rest at the top, the slope is left at "
        f"{found['speed']:.2f} m/s or more, after at most {found['seconds']:.2f} s, not {claimed:g} s. The pyramid "
        f"|fx| + |fy| <= sqrt(2) mu fz holds {found['pyramid_angle']:.1f} degrees along its axes, on which the robot "
        "can stand for ever: such plans are made of friction that is not there. The pyramid touches the cone halfway "
        "between its axes, so a foot turned by 45 degrees about its normal would have been refused: the claim hangs "
        "on the heading."
    )
