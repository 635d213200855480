"""Failure: why a stage rejected a plan, and where."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.geometry.limb import Limb


@dataclass(frozen=True)
class Failure:
    """Why a stage rejected a plan; what is unknown is None.

    Attributes:
        reason: One line for a person.
        time: When it happens first, or where it is worst, in s since the plan began.
        transition: Index of the transition in which it happens; the number of transitions for the final rest.
        limb: The limb that it happens to.
        knot: The knot of the centroidal motion at which a constraint is violated most.
        too_fast: Whether joints had to turn faster or harder than they can; a calmer pace may help.
        stretched: Whether a leg had to go beyond a limit of its posture or length; wider margins in a search may help.
        at_any_pace: Whether a link touches the world, or a palm has no way clear of it, for which no pace is to blame.
    """

    reason: str
    time: float | None = None
    transition: int | None = None
    limb: Limb | None = None
    knot: int | None = None
    too_fast: bool = False
    stretched: bool = False
    at_any_pace: bool = False
