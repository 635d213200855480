"""Reasons for which candidates are rejected."""

from __future__ import annotations

from enum import IntEnum

from toolkit.physics.leg import LIMITS


class Reason(IntEnum):
    """Reasons of rejection, numbered from 0, which stands for none; kernels and Python write these numbers.

    Each limit of `toolkit.physics.leg.LIMITS` has the member that is its name in capitals.

    Attributes:
        words: The reason in words, for messages.
        of_palm: Whether it is about palms alone. Palms are an option, so a lack of walls explains no lack of plans.
    """

    words: str
    of_palm: bool

    def __new__(cls, words: str, of_palm: bool = False):
        """The next number, with its words."""
        member = int.__new__(cls, len(cls.__members__))
        member._value_ = len(cls.__members__)
        member.words, member.of_palm = words, of_palm
        return member

    NONE = ""
    NO_SURFACE = "no surface holds the sole"
    CLOSE = "soles too close"
    HIGH = "step too high"
    BODY = "body hits the world"
    LEG_LENGTH = "leg length out of range"
    ANKLE_ROLL = "ankle roll out of range"
    ANKLE_PITCH = "ankle pitch out of range"
    HIP_YAW = "hip yaw out of range"
    HIP_ROLL = "hip roll out of range"
    HIP_PITCH = "hip pitch out of range"
    CROSSES = "swing foot crosses the stance leg"
    FAST = "swing too fast"
    STILL = "no movement"
    NO_WALL = "no surface holds the palm", True
    FAR = "palm out of reach", True
    WRONG_SIDE = "palm on the wrong side of the body", True
    FACING = "palm faces away", True
    DYNAMICS = "dynamics"
    COSTLY = "cannot lead to a better plan"
    ARM = "arm out of reach of its palm"
    EXCLUDED = "rejected by a later stage"
    SHANK = "a leg hits the world"
    KNEES = "legs hit each other"
    POSTURE = "no posture of the arm holds the palm", True
    FOOT = "a foot hits what stands beside it"


OF_LIMIT = tuple(Reason[limit.name.upper().replace(" ", "_")].value for limit in LIMITS)
"""The reason of each limit of a leg, in the order of `LIMITS`."""
