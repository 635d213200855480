"""Rates with Wilson's intervals, medians with quartiles, and figures beside the paper's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from validation.map_table import wilson
from validation.tables import number


def rate(successes: int, trials: int) -> str:
    """Successes of trials with Wilson's interval at 95 %."""
    interval = wilson(successes, trials)
    if interval is None:
        return "0/0"
    low, high = (100 * end for end in interval)
    return f"{successes}/{trials} ({low:.0f} to {high:.0f} %)"


def spread(values: Sequence[float], spec: str = ".3g", factor: float = 1.0) -> str:
    """Median with quartiles of values times a factor; "-" of nothing."""
    if not len(values):
        return "-"
    low, middle, high = factor * np.percentile(values, [25, 50, 75])
    return f"{middle:{spec}} [{low:{spec}}, {high:{spec}}]"


@dataclass(frozen=True)
class Compared:
    """A figure of the paper and ours.

    Attributes:
        name: What it is, with its unit.
        paper: The paper's, as it is printed there; "-" where it has none.
        ours: Ours, as it is to be printed.
        value: Ours as a number; None where there is none.
        published: The paper's as a number; None where it has none.
        better: 1 where more is better, -1 where less is, 0 where neither is.
        why: A sentence on what differs and why.
    """

    name: str
    paper: str
    ours: str
    value: float | None
    published: float | None
    better: int
    why: str

    @property
    def worse(self) -> bool:
        """Whether ours is worse than the paper's; one that we have not is worse too."""
        if self.published is None or not self.better:
            return False
        return self.value is None or self.better * (self.value - self.published) < 0

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of a table."""
        return self.name, self.ours, self.paper, self.why

    @property
    def record(self) -> dict[str, Any]:
        """For a JSON file."""
        return {**asdict(self), "worse": self.worse}


HEADER = ("figure", "ours", "the paper", "what differs, and why")


def worse_first(where: str, rows: Sequence[Compared]) -> list[str]:
    """A line for each figure in which ours is worse."""
    lines = []
    for row in rows:
        if row.worse:
            ours = "none" if row.value is None else number(row.value, ".4g")
            lines.append(f"- {where}, {row.name}: {ours} against the paper's {row.paper}. {row.why}")
    return lines
