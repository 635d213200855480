"""Encodings of transitions compared.

Orientations as axes of the contacts' frames (ours) stand against Tait-Bryan angles (the paper's).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.contacts.category import Category
from toolkit.errors import InputError
from toolkit.learning.samples import Samples
from toolkit.prediction.features import CONTACT, ahead

AXES, ANGLES = "axes of each contact's frame", "Tait-Bryan angles with copies at ±2π"
NEAR = 0.5  # rad; angles so near to ±π are copied
MOST_COPIES = 3  # of one sample


@dataclass(frozen=True)
class EncodingScore:
    """How well networks learn from an encoding.

    Attributes:
        inputs: length of the feature vector.
        rows: training samples, copies included.
        accuracy: of the feasibility.
        relative_objective_error, com_error (m), velocity_error (m/s): mean, of those whose outcome is known.
    """

    inputs: int
    rows: int
    accuracy: float
    relative_objective_error: float
    com_error: float
    velocity_error: float


def tait_bryan(features: np.ndarray, category: Category) -> np.ndarray:
    """The paper's encoding: each contact's axes replaced by yaw, pitch and roll in [-pi, pi).

    Args:
        features: (n, feature_size) as `encode` gives them.
        category: of the transitions.

    Returns:
        (n, 6 * contacts + 9) float.
    """
    count = len(category.contact_limbs)
    contacts = features[:, : CONTACT * count].reshape(len(features), count, CONTACT)
    x, z = contacts[..., 3:6], contacts[..., 6:9]
    y = np.cross(z, x)
    yaw = np.arctan2(x[..., 1], x[..., 0])
    pitch = np.arctan2(-x[..., 2], np.hypot(x[..., 0], x[..., 1]))
    roll = np.arctan2(y[..., 2], z[..., 2])
    poses = np.concatenate([contacts[..., :3], np.stack([yaw, pitch, roll], -1)], axis=-1)
    return np.concatenate([poses.reshape(len(features), -1), features[:, CONTACT * count :]], axis=1)


def with_copies(features: np.ndarray, contacts: int, *, near: float = NEAR) -> tuple[np.ndarray, np.ndarray]:
    """Samples and their copies with each angle near ±π turned by 2π (paper, Sec. VI).

    Args:
        features: (n, d) as `tait_bryan` gives them.
        contacts: number of them.
        near: rad; how near to ±π an angle is copied.

    Returns:
        (m, d) features and (m,) rows that they come from, the n samples first.
    """
    angles = [6 * contact + 3 + axis for contact in range(contacts) for axis in range(3)]
    parts, sources = [features], [np.arange(len(features))]
    for column in angles:
        rows = np.flatnonzero(np.abs(features[:, column]) > np.pi - near)
        copies = features[rows].copy()
        copies[:, column] -= 2 * np.pi * np.sign(copies[:, column])
        parts.append(copies)
        sources.append(rows)
    copies, rows = np.concatenate(parts[1:]), np.concatenate(sources[1:])
    kept = np.arange(len(rows)) < MOST_COPIES * len(features)
    return np.concatenate([features, copies[kept]]), np.concatenate([sources[0], rows[kept]])


def compare_encodings(
    train: Samples, test: Samples, category: Category, *, epochs: int, seed: int = 0
) -> dict[str, EncodingScore]:
    """Train the same two networks on the same samples in all encodings.

    Args:
        train: samples to learn from.
        test: samples to be judged on.
        category: which one.
        epochs: of each training.
        seed: of weights and shuffling.

    Raises:
        InputError: torch is not installed.
    """
    try:
        from toolkit.learning.descent import FitConfig
        from toolkit.learning.fit import train_networks
    except ImportError:
        raise InputError("the comparison of encodings needs torch: pip install -e '.[train]'") from None
    config = FitConfig(epochs=epochs, seed=seed)
    contacts = len(category.contact_limbs)
    results = {}
    for name in (AXES, ANGLES):
        learnt, asked = train, test
        if name == ANGLES:
            features, rows = with_copies(tait_bryan(train.features, category), contacts)
            learnt = replace(train.select(rows), features=features.astype(np.float32))
            asked = replace(test, features=tait_bryan(test.features, category).astype(np.float32))
        trained = train_networks(learnt, config)
        feasible = trained.feasible(asked.features)
        good = asked.known
        outputs, targets = trained.predict(asked.features[good], ahead(asked.goal[good])), asked.targets[good]
        results[name] = EncodingScore(
            inputs=learnt.features.shape[1],
            rows=len(learnt),
            accuracy=float((feasible == asked.feasible).mean()),
            relative_objective_error=float(np.abs(outputs[:, 0] - targets[:, 0]).mean() / targets[:, 0].mean()),
            com_error=float(np.linalg.norm(outputs[:, 1:4] - targets[:, 1:4], axis=1).mean()),
            velocity_error=float(np.linalg.norm(outputs[:, 4:7] - targets[:, 4:7], axis=1).mean()),
        )
    return results
