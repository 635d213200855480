"""Goals beside figures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

MET, NOT_MET, NOT_CHECKED = "met", "not met", "not checked"


@dataclass(frozen=True)
class Goal:
    """A figure and what is asked of it.

    Attributes:
        name: what is measured.
        wanted: what is asked, in words.
        figure: what was found, in words.
        result: "met", "not met" or "not checked".
    """

    name: str
    wanted: str
    figure: str
    result: str

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return dict(vars(self))


def at_most(name: str, value: float | None, limit: float, unit: str = "", digits: int = 3) -> Goal:
    """A figure that may not exceed a limit; None: not measured; a figure that is not finite is not within it."""
    wanted = f"at most {limit:g} {unit}".strip()
    if value is None:
        return Goal(name, wanted, "-", NOT_CHECKED)
    result = MET if math.isfinite(value) and value <= limit else NOT_MET
    return Goal(name, wanted, f"{value:.{digits}g} {unit}".strip(), result)


def at_least(name: str, value: float | None, limit: float, unit: str = "", digits: int = 3) -> Goal:
    """A figure that may not fall below a limit; None: not measured."""
    wanted = f"at least {limit:g} {unit}".strip()
    if value is None:
        return Goal(name, wanted, "-", NOT_CHECKED)
    result = MET if math.isfinite(value) and value >= limit else NOT_MET
    return Goal(name, wanted, f"{value:.{digits}g} {unit}".strip(), result)


def count(name: str, successes: int, trials: int, wanted: int, of: int) -> Goal:
    """Successes of trials against `wanted` successes `of` so many.

    With fewer trials than `of` the goal cannot be met; it is missed as soon as more trials failed than may fail.
    """
    text = f"{wanted} of {of}"
    figure = f"{successes} of {trials}"
    if trials - successes > of - wanted and trials <= of:
        return Goal(name, text, figure, NOT_MET)
    if trials < of:
        return Goal(name, text, figure, NOT_CHECKED)
    return Goal(name, text, figure, MET if successes * of >= wanted * trials else NOT_MET)


def every(name: str, successes: int, trials: int) -> Goal:
    """All trials have to succeed; without a trial nothing is checked."""
    result = NOT_CHECKED if not trials else MET if successes == trials else NOT_MET
    return Goal(name, "all", f"{successes} of {trials}", result)
