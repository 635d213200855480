"""Timing of a contact transition, and the timings among which the planner chooses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

LONGEST = 10.0
"""Longest shift and longest swing in s. Time and memory grow with them, and slower motions are no different ones."""

_PACES = (  # s, s; shifts and swings to choose from, the calmest first; where a pace fails, the next follows
    ((0.35, 0.6), (0.05, 0.3)),
    ((0.6, 0.8), (0.35, 0.6)),
    ((1.0, 1.0), (0.6, 0.8)),
    ((1.4, 1.4), (1.0, 1.0)),
)
_RUN = (0.35, 0.6), (0.04, 0.25)  # s, s; the same where no foot can rest, about the quickest that networks learn
_STRIDES = ((0.25, 0.5),)  # s, s; before `_PACES` where feet roll: what is off grows while one of them stands


@dataclass(frozen=True)
class Timing:
    """Timing of one contact transition; the default is the paper's.

    Attributes:
        shift: Time in which the CoM shifts on the complete old stance, s.
        swing: Time in which the limb moves, s.
    """

    shift: float = 1.0
    swing: float = 1.0

    def times(self, factor: float) -> Timing:
        """It in other time, to the millisecond."""
        return Timing(round(factor * self.shift, 3), round(factor * self.swing, 3))


Timings = tuple[Timing, ...] | Literal["auto"]
"""Timings to choose from; "auto": those of `own_choice`; empty: the world's, or "auto" where it names none."""


def own_choice(factor: float, calmer: int = 0, *, slides: bool = False, rolls: bool = False) -> tuple[Timing, ...]:
    """The timings that a planner may choose from for every transition, the calmest first.

    They scale with the robot's factor on times (`RobotModel.pace`). The more often the pace has yielded (`calmer`),
    the slower they are. On ground that `slides` they are those of a run, whatever has yielded: what counts there is how
    soon the next foot is down, since strides grow with the speed. On feet that roll (`rolls`) it is how soon an error
    is made good by the next step.
    """
    paces = (_STRIDES, *_PACES) if rolls else _PACES
    pace = _RUN if slides else paces[min(calmer, len(paces) - 1)]
    return tuple(Timing(*times).times(factor) for times in pace)


def own_timings(factor: float) -> set[Timing]:
    """All timings that `own_choice` offers at any pace and on any ground to feet that do not roll."""
    walks = {timing for calmer in range(len(_PACES)) for timing in own_choice(factor, calmer)}
    return walks.union(own_choice(factor, slides=True))


def given_timings(asked: Timings, own: Timing | None) -> tuple[Timing, ...]:
    """The timings that are `asked` for, else the world's `own`; empty where they are the planner's to choose."""
    if asked == "auto":
        return ()
    return asked or (() if own is None else (own,))


def timings_of(
    asked: Timings,
    own: Timing | None,
    factor: float,
    calmer: int = 0,
    *,
    slides: bool = False,
    rolls: bool = False,
) -> tuple[Timing, ...]:
    """The timings of a search: those `asked` for, else the world's `own`, else the planner's `own_choice`."""
    return given_timings(asked, own) or own_choice(factor, calmer, slides=slides, rolls=rolls)
