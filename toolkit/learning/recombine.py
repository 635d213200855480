"""Transitions put together from parts of stored ones: feet of one, palms of another, the state of a third.

Steep objectives are learnt from many different stances, not from many states of the same ones: where feet may stand is
what decides how far a network's errors on new terrain exceed those on what it has seen. Most of what is put together so
is infeasible or cheap; networks can tell which part is worth a label (`learning.enrich`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.contacts.category import Category
from toolkit.learning.dataset import Samples
from toolkit.learning.evaluate import AT_DEFAULT, at_default
from toolkit.learning.sensitivity import MOVING
from toolkit.prediction.features import COM, CONTACT, LAYOUT, MIRROR, TIMING_AND_FRICTION, contact_count, feature_size

_FEET = 2  # the first contacts


@dataclass(frozen=True)
class RecombineConfig:
    """How parts are drawn and displaced.

    Attributes:
        power: transitions lend their feet and state in proportion to their objective to this power.
        exchange: share of feet that are turned as others are, each by itself; and of states that are those of others.
        foot: m and rad, standard deviations of a foot's displacement;
        palm: the same of a palm.
        com: m, and
        velocity: m/s; the same of the state.
    """

    power: float = 0.35
    exchange: float = 0.4
    foot: tuple[float, float] = (0.02, 0.08)
    palm: tuple[float, float] = (0.05, 0.12)
    com: float = 0.02
    velocity: float = 0.08


@dataclass(frozen=True)
class _Parts:
    """Feet (n, 2, 3, 3) as place, x and z axis; CoM and velocity (n, 2, 3); how likely each row is drawn (n,)."""

    feet: np.ndarray
    state: np.ndarray
    chance: np.ndarray

    def draw(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Feet and state of random rows, half of them mirrored."""
        rows = rng.choice(len(self.chance), count, p=self.chance / self.chance.sum())
        feet, state = self.feet[rows], self.state[rows]
        mirrored = rng.random(count) < 0.5
        feet[mirrored] = feet[mirrored, ::-1] * MIRROR
        state[mirrored] *= MIRROR
        return feet, state


def recombined(
    shard: Mapping[Category, Samples],
    category: Category,
    count: int,
    config: RecombineConfig,
    rng: np.random.Generator,
) -> np.ndarray:
    """Features of transitions at the paper's timing and friction, put together from feasible ones of all categories.

    Feet and state come from any category, each as often, palms and new contacts from the category itself; then each
    contact and the state are displaced. Tiles are tilted each by itself, so feet may be turned each by itself.

    Args:
        shard: labelled transitions by category.
        category: of the result.
        count: how many.
        config: how.
        rng: randomness.

    Returns:
        (count, d) features in canonical form; no rows where the shard has no feasible transition of the category.
    """
    groups = {other: at_default(samples) for other, samples in shard.items()}
    groups = {other: group.select(np.flatnonzero(group.feasible)) for other, group in groups.items()}
    groups = {other: group for other, group in groups.items() if len(group)}
    if category not in groups:
        return np.zeros((0, feature_size(category)))
    parts = _parts(groups, config.power)
    feet, state = parts.draw(count, rng)
    swapped = rng.random(count) < config.exchange
    state[swapped] = parts.draw(count, rng)[1][swapped]
    for foot in range(_FEET):
        swapped = rng.random(count) < config.exchange
        feet[swapped, foot, 1:] = parts.draw(count, rng)[0][swapped, foot, 1:]
    own = _contacts(groups[category], category)
    contacts = np.concatenate([feet, own[rng.integers(len(own), size=count), _FEET:]], axis=1)

    limbs = [*LAYOUT[category][0], MOVING[category]][: contact_count(category)]
    place, turn = np.array([config.foot if limb.is_foot else config.palm for limb in limbs]).T
    contacts[:, :, 0] += place[:, None] * rng.normal(size=(count, len(limbs), 3))
    turns = turn[:, None] * rng.normal(size=(count, len(limbs), 3))
    rotations = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(count, len(limbs), 3, 3)
    contacts[:, :, 1:] = np.einsum("nkij,nkaj->nkai", rotations, contacts[:, :, 1:])
    state = state + np.array([config.com, config.velocity])[:, None] * rng.normal(size=(count, 2, 3))
    return _canonical(contacts, state)


def _contacts(group: Samples, category: Category) -> np.ndarray:
    """(n, k, 3, 3) place, x and z axis of each contact."""
    count = contact_count(category)
    return group.features[:, : CONTACT * count].astype(float).reshape(-1, count, 3, 3)


def _parts(groups: Mapping[Category, Samples], power: float) -> _Parts:
    feet, state, chance = [], [], []
    for category, group in groups.items():
        feet.append(_contacts(group, category)[:, :_FEET])
        state.append(group.features[:, COM.start : TIMING_AND_FRICTION.start].astype(float).reshape(-1, 2, 3))
        weight = np.maximum(group.targets[:, 0].astype(float), 1e-3) ** power
        chance.append(weight / weight.sum())
    return _Parts(np.concatenate(feet), np.concatenate(state), np.concatenate(chance))


def _canonical(contacts: np.ndarray, state: np.ndarray) -> np.ndarray:
    """(n, d) features of contacts (n, k, 3, 3) and states (n, 2, 3) in the frame of the mean of the feet, yaw only."""
    ahead = contacts[:, :_FEET, 1, :2]
    ahead = (ahead / np.linalg.norm(ahead, axis=2, keepdims=True)).sum(1)
    cosine, sine = (ahead / np.linalg.norm(ahead, axis=1, keepdims=True)).T
    turn = np.zeros((len(contacts), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = cosine, sine, -sine, cosine, 1.0
    middle = contacts[:, :_FEET, 0].mean(1)
    contacts, state = contacts.copy(), state.copy()
    contacts[:, :, 0] -= middle[:, None]
    state[:, 0] -= middle
    contacts = np.einsum("nij,nkaj->nkai", turn, contacts)
    state = np.einsum("nij,naj->nai", turn, state)
    others = np.tile(AT_DEFAULT, (len(contacts), 1))
    return np.concatenate([contacts.reshape(len(contacts), -1), state.reshape(len(contacts), -1), others], axis=1)
