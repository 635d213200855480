"""Where the variables of a centroidal program are: stages of states, wrenches, slacks and landing points.

Stage t has the state at knot t, the wrench and two slacks of each contact of step t, and the excess and the body's
slack of the step. The last stage has a state and the body's slack. See `stages.steps` and `stages.rows` for the
variables and their units. The parts of a program that know nothing but this are here too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from toolkit.centroidal.stages.blocks import Block
from toolkit.centroidal.stages.method import Prices
from toolkit.centroidal.stages.rows import CONTACT_ROWS, EVEN
from toolkit.centroidal.stages.steps import STATE, WRENCH
from toolkit.geometry.limb import FEET, Limb

CONTACT = WRENCH + 2  # variables of a contact: its wrench and its slacks
SLACKS = 2  # of a step: its excess and the body's slack
PAIRS = len(FEET) + 1  # one for each foot's contact, and one for the contact that the foot in the air has left
AIR = len(FEET)


@dataclass(frozen=True)
class Landing:
    """Room for a foot's next contact.

    Attributes:
        limb: The foot.
        step: The first step in which the foot is in the air.
        lower, upper: (2,) m; range of the contact's displacement along its own axes.
    """

    limb: Limb
    step: int
    lower: np.ndarray
    upper: np.ndarray


@dataclass(frozen=True)
class Layout:
    """Where things are among the variables of a stage.

    Attributes:
        size: (N + 1,) number of variables of each stage.
        states: How many of them are states.
        wrench: (N, 4) first variable of a limb's wrench; -1 where not active.
        slack: (N + 1, 2) variables of the excess and of the body's slack; at the last knot both are the body's.
        landing: (N,) first variable of a landing point that is chosen in a step; -1 where none is.
        moving: Whether contacts are displaced by variables.
    """

    size: np.ndarray
    states: int
    wrench: np.ndarray
    slack: np.ndarray
    landing: np.ndarray
    moving: bool

    @classmethod
    def of(cls, active: np.ndarray, landings: Sequence[int] | None = None) -> Layout:
        """Layout for (N, 4) active contacts; `landings` are the steps that choose a landing point, None for none."""
        moving = landings is not None
        states = STATE + 2 * PAIRS * moving
        after = states + CONTACT * active.sum(1)
        chooses = np.zeros(len(active), bool)
        chooses[list(landings or ())] = True
        size = np.append(after + SLACKS + 2 * chooses, states + 1)
        wrench = np.where(active, states + CONTACT * (np.cumsum(active, 1) - 1), -1)
        slack = np.concatenate([after[:, None] + np.arange(SLACKS), np.full((1, SLACKS), states)])
        return cls(size, states, wrench, slack, np.where(chooses, after + SLACKS, -1), moving)

    def pair(self, which: int | np.ndarray) -> np.ndarray:
        """(..., 2) variables of the displacement of a foot's contact, or of the one left (`AIR`), in any stage."""
        return indices(STATE + 2 * np.asarray(which), 2)

    def chosen(self, item: Landing) -> np.ndarray:
        """(2,) variables of the displacement of a landing point in the step that chooses it."""
        return self.landing[item.step] + np.arange(2)

    def displaced(self, limb: np.ndarray) -> np.ndarray:
        """(n,) first variable of the displacement of limbs' contacts; -1 where they stay."""
        return np.where((limb < len(FEET)) & self.moving, STATE + 2 * limb, -1)

    def sources(self, landings: Sequence[Landing]) -> np.ndarray:
        """(N, 2 P) variables that become the displacements of the next stage; see `Steps`."""
        source = np.tile(np.arange(STATE, self.states), (len(self.landing), 1))
        for item in landings:
            source[item.step, 2 * AIR : 2 * AIR + 2] = self.pair(item.limb)
            source[item.step, 2 * item.limb : 2 * item.limb + 2] = self.chosen(item)
        return source

    def moved(self, knot: np.ndarray, foot: int | np.ndarray) -> np.ndarray:
        """(n, 2) variables that displace a foot's contact at knots; (n, 0) where contacts stay."""
        if not self.moving:
            return np.zeros((len(knot), 0), int)
        return np.broadcast_to(self.pair(foot), (len(knot), 2))

    def contacts(self, step: np.ndarray, limb: np.ndarray) -> np.ndarray:
        """(n, 9) variables of the rows of contacts."""
        return side_by_side(len(step), indices(self.wrench[step, limb], CONTACT), self.slack[step, :1], dtype=int)

    def legs(self, knot: np.ndarray, foot: int | np.ndarray) -> np.ndarray:
        """(n, k) variables of the limits of stance legs."""
        return side_by_side(len(knot), range(3), self.slack[knot, 1:], self.moved(knot, foot), dtype=int)

    def torques(self, step: np.ndarray, foot: int | np.ndarray) -> np.ndarray:
        """(n, k) variables of the joint torques of stance legs."""
        wrench = indices(self.wrench[step, foot], WRENCH)
        return side_by_side(len(step), range(6), wrench, self.slack[step, 1:], self.moved(step, foot), dtype=int)

    def distances(self, knot: np.ndarray, foot: int | np.ndarray) -> np.ndarray:
        """(n, k) variables of the lengths of legs in the air and of arms."""
        moved = [self.moved(knot, which) for which in (foot, AIR)]
        return side_by_side(len(knot), range(6), self.slack[knot, 1:], *moved, dtype=int)

    def heights(self, knot: np.ndarray, foot: np.ndarray) -> np.ndarray:
        """(n, k) variables of the height of the CoM above the lowest foot."""
        return side_by_side(len(knot), [2], self.slack[knot, 1:], self.moved(knot, foot), dtype=int)


def side_by_side(count: int, *parts: np.ndarray | Sequence[float], dtype: type = float) -> np.ndarray:
    """(count, k) the columns of parts beside each other; a part of one axis is the same in all rows."""
    arrays = [np.asarray(part, dtype) for part in parts]
    ends = list(accumulate(array.shape[-1] for array in arrays))
    found = np.empty((count, ends[-1]), dtype)
    for begin, end, array in zip([0, *ends], ends, arrays, strict=False):
        found[:, begin:end] = array
    return found


def indices(first: np.ndarray, size: int) -> np.ndarray:
    """(..., size) consecutive indices from first ones."""
    return np.asarray(first)[..., None] + np.arange(size)


def contact_block(layout: Layout, active: np.ndarray, parameters: np.ndarray) -> Block:
    """Cones of (N, 4) active contacts, for the parameters (C, p) that `rows.prepare_contacts` lists."""
    step, limb = np.nonzero(active)
    return Block.of(step, layout.contacts(step, limb), parameters, CONTACT_ROWS)


def slack_prices(layout: Layout, price: np.ndarray, excess: float) -> Prices:
    """Prices of the excess and the body's slack, for the prices (N,) of slacks in each step; see `Regularisers`."""
    n, slack = len(price), layout.slack
    linear = np.concatenate([excess * price, price, price[-1:]])
    stage, variable = np.append(np.arange(n), np.arange(n + 1)), np.append(slack[:-1, 0], slack[:, 1])
    return Prices(stage, variable, linear, EVEN * linear, np.zeros(2 * n + 1))


def start_slacks(
    y: np.ndarray,
    layout: Layout,
    active: np.ndarray,
    price: np.ndarray,
    excess: float,
    gap: float,
    most: float = np.inf,
) -> None:
    """Start the slacks of a motion y (N + 1, m) where their prices balance the barrier, at most at `most`.

    Contacts are (N, 4) active; price (N,) and excess are as in `slack_prices`, the gap is the complementarity.
    """
    step, limb = np.nonzero(active)
    knot, balance = np.arange(len(price) + 1), np.minimum(gap / price, most)
    y[step[:, None], indices(layout.wrench[step, limb] + WRENCH, 2)] = balance[step, None]
    y[knot, layout.slack[:, 1]] = np.append(balance, balance[-1])
    y[knot[:-1], layout.slack[:-1, 0]] = np.minimum(gap / (excess * price), most)


def single_bounds(layout: Layout, active: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stages (n,), variables (n, 1) and parameters (n, 2) of the bounds of single variables.

    Contacts are (N, 4) active; their largest normal forces (4,) are in weights.
    """
    step, limb = np.nonzero(active)
    knot, wrench = np.arange(len(active) + 1), layout.wrench[step, limb]
    most = most[limb]
    finite = np.isfinite(most)
    lower = [(step, wrench + 2), (step, wrench + 6), (step, wrench + 7), (knot[:-1], layout.slack[:-1, 0])]
    lower.append((knot, layout.slack[:, 1]))
    stages, variables = (np.concatenate(part) for part in zip(*lower, strict=True))
    parameters = np.tile([1.0, 0.0], (len(stages) + finite.sum(), 1))
    parameters[len(stages) :] = np.stack([-np.ones(finite.sum()), -most[finite]], 1)
    stages, variables = np.append(stages, step[finite]), np.append(variables, wrench[finite] + 2)
    return stages, variables[:, None], parameters
