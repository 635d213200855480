"""Timing of a contact transition."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """Timing of one contact transition; the default is the paper's.

    Attributes:
        shift: Time in which the CoM shifts on the complete old stance, s.
        swing: Time in which the limb moves, s.
    """

    shift: float = 1.0
    swing: float = 1.0
