"""Finding: what a check found wrong, and when."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """One violated check.

    Attributes:
        text: one line for a person.
        time: s; where it is worst, or where it happens first.
    """

    text: str
    time: float
