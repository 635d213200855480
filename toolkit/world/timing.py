"""Timing of a contact transition."""

from __future__ import annotations

from dataclasses import dataclass

LONGEST = 10.0
"""Longest shift and longest swing in s. Time and memory grow with them, and slower motions are no different ones."""


@dataclass(frozen=True)
class Timing:
    """Timing of one contact transition; the default is the paper's.

    Attributes:
        shift: s, with the old stance complete (the CoM shifts).
        swing: s, while the limb moves.
    """

    shift: float = 1.0
    swing: float = 1.0
