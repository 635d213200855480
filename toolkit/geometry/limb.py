"""The contact limbs of a humanoid."""

from __future__ import annotations

from enum import IntEnum


class Limb(IntEnum):
    """Contact limb; the value indexes the limb axis of every (..., 4, ...) array in the toolkit."""

    LEFT_FOOT = 0
    RIGHT_FOOT = 1
    LEFT_PALM = 2
    RIGHT_PALM = 3

    @property
    def label(self) -> str:
        """Name in files and sites: `left_foot`, `right_foot`, `left_palm`, `right_palm`."""
        return self.name.lower()

    @property
    def is_foot(self) -> bool:
        """Whether the limb is a foot."""
        return self < 2

    @property
    def is_left(self) -> bool:
        """Whether the limb is on the left."""
        return self % 2 == 0

    @property
    def mirrored(self) -> Limb:
        """The same limb of the other side."""
        return Limb(self ^ 1)

    @classmethod
    def from_label(cls, label: str) -> Limb:
        """Limb of a label such as `left_foot`; raises KeyError otherwise."""
        return cls[label.upper()]


FEET = (Limb.LEFT_FOOT, Limb.RIGHT_FOOT)
PALMS = (Limb.LEFT_PALM, Limb.RIGHT_PALM)
