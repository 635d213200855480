"""Check: a measured value, its limit and the result."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum


class Result(StrEnum):
    """Result of a check."""

    PASS = "PASS"
    FAIL = "FAIL"
    NOT_CHECKED = "NOT_CHECKED"


@dataclass(frozen=True)
class Check:
    """One measured value held against its limit.

    Attributes:
        name: What is measured, e.g. `slip`.
        limit: The value may not exceed it.
        unit: SI unit; "" for counts and flags.
        value: The measured value; inf or NaN where undefined, None where not measured.
    """

    name: str
    limit: float
    unit: str = ""
    value: float | None = None

    @property
    def result(self) -> Result:
        """PASS where the value is finite and within the limit, NOT_CHECKED where there is none."""
        if self.value is None:
            return Result.NOT_CHECKED
        return Result.PASS if math.isfinite(self.value) and self.value <= self.limit else Result.FAIL
