"""Surroundings: how a world limits where body and feet may be, as the optimiser of motions needs it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

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

    def leans(self, problem: CentroidalProblem) -> np.ndarray | None:
        """How far shins may lean over the contacts of a problem (`CentroidalProblem.lean`); None: nothing is there."""
        ...

    def foot_hits(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """(n,) bool; whether feet whose soles are at (n, 3) m and (n, 3, 3) touch what stands beside them."""
        ...
