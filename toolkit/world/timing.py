"""Timing of a contact transition."""

from __future__ import annotations

from dataclasses import dataclass

LONGEST = 10.0
"""Longest shift and longest swing in s. Time and memory grow with them, and slower motions are no different ones."""


@dataclass(frozen=True)
class Timing:
    """Timing of one contact transition; the default is the paper's.

    Attributes:
        shift: Time in which the CoM shifts on the complete old stance, s.
        swing: Time in which the limb moves, s.
    """

    shift: float = 1.0
    swing: float = 1.0
