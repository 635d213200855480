"""Surroundings: how a world limits where the body may be, as the optimiser of motions needs it."""

from __future__ import annotations

from typing import Protocol

from toolkit.centroidal.problem import CentroidalProblem, ComRoom
from toolkit.contacts.stance import Stance


class Surroundings(Protocol):
    """What is around the robot; see `toolkit.search.moves.body_room.BodyRoom`."""

    def sink(self, stance: Stance) -> float:
        """By how many m the CoM of a robot that stands in a stance has to be lower than at home."""
        ...

    def room(self, problem: CentroidalProblem) -> ComRoom | None:
        """The room of the CoM in a motion over the contacts of a problem; None where the world does not limit it."""
        ...
