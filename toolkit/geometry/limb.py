"""The contact limbs of a humanoid: the table from which everything else about limbs is derived."""

from __future__ import annotations

from enum import IntEnum


class Limb(IntEnum):
    """Contact limb; its number indexes the limb axis of every (..., len(Limb), ...) array in the toolkit.

    Each row of the table holds the number, the side and the kind. Feet come first, as the contacts of every stance do.

    Attributes:
        is_left: Whether the limb is on the left.
        is_foot: Whether the limb is a foot; the others are palms.
    """

    is_left: bool
    is_foot: bool

    LEFT_FOOT = 0, "left", "foot"
    RIGHT_FOOT = 1, "right", "foot"
    LEFT_PALM = 2, "left", "palm"
    RIGHT_PALM = 3, "right", "palm"

    def __new__(cls, number: int, side: str, kind: str) -> Limb:
        """Make the member of one row."""
        limb = int.__new__(cls, number)
        limb._value_ = number
        limb.is_left, limb.is_foot = side == "left", kind == "foot"
        return limb

    @property
    def label(self) -> str:
        """Name in files and sites: `left_foot`, `right_foot`, `left_palm`, `right_palm`."""
        return self.name.lower()

    @property
    def outward(self) -> float:
        """1 on the left, -1 on the right: the sign of a way along y, and of a turn about z, that leads outward."""
        return 1.0 if self.is_left else -1.0

    @property
    def mirrored(self) -> Limb:
        """The same limb of the other side."""
        return _MIRROR[self]

    @classmethod
    def from_label(cls, label: str) -> Limb:
        """Limb of a label such as `left_foot`; raises KeyError otherwise."""
        return cls[label.upper()]


FEET = tuple(limb for limb in Limb if limb.is_foot)
PALMS = tuple(limb for limb in Limb if not limb.is_foot)
_MIRROR = {
    limb: next(other for other in Limb if other.is_foot == limb.is_foot and other.is_left != limb.is_left)
    for limb in Limb
}
