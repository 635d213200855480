"""Timing of a contact transition."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """Timing of one contact transition; the default is the paper's.

    Attributes:
        shift: s, with the old stance complete (the CoM shifts).
        swing: s, while the limb moves.
    """

    shift: float = 1.0
    swing: float = 1.0
