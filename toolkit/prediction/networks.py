"""NetworkEvaluator: judges transitions with the learned networks (paper, Sec. VI)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.contacts.category import Category, categories_of, category_rows
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.errors import NetworkError
from toolkit.geometry.limb import Limb
from toolkit.prediction.evaluator import TransitionBatch, TransitionEvaluator
from toolkit.prediction.features import ahead, encode
from toolkit.prediction.friction import allowed, rests
from toolkit.prediction.network import TransitionNetwork, load_network, network_path
from toolkit.robot.model import RobotModel
from toolkit.world.world import Goal

_HASTY = 0.25  # of the swing; a limb whose shift is shorter lifts off at once
_HASTY_COST = 1.6  # J of such transitions over the prediction, in sequences that mix them with calm ones


def load_networks(robot: RobotModel, folder: Path | None = None) -> dict[Category, TransitionNetwork]:
    """The networks of every category that the robot can perform.

    Args:
        robot: The robot, whose `networks/` folder is read unless `folder` is given.
        folder: Another folder of networks.

    Raises:
        NetworkError: See `load_network`.
    """
    folder = folder or robot.folder / "networks"
    return {
        category: load_network(network_path(folder, category), category, robot.fingerprint)
        for category in categories_of(robot)
    }


def digest(folder: Path) -> str:
    """Digest of the networks in a folder; other networks have another one."""
    found = hashlib.sha256()
    for path in sorted(folder.glob("*.safetensors")):
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()


@dataclass(frozen=True)
class NetworkEvaluator(TransitionEvaluator):
    """Judges by networks, also beyond their training.

    More time or friction than in the training is judged as the most of it. Of less they can only guess, and the
    optimisation of a sequence on arrival has the last word. A search finds more that way than with the optimiser as
    judge, which takes a hundred times as long.

    What a transition costs whose limb lifts off at once depends on the pace of what follows, which the networks are not
    told. A search that may choose between such transitions and calm ones would prefer them where they are understated.
    So their objectives are multiplied by what they come to along the sequences of such searches (`hasty`). Where no
    contact can rest, all that follows is as quick, and nothing is understated. There, CoM states are moved to what
    friction allows (`toolkit.prediction.friction`).

    Attributes:
        networks: Networks by category.
        goal: Where the sequences lead.
        hasty: Factor on the predicted objective of transitions whose limb lifts off at once.
    """

    networks: dict[Category, TransitionNetwork]
    goal: Goal
    hasty: float = _HASTY_COST

    def evaluate(
        self, stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
    ) -> TransitionBatch:
        """Judge transitions; see `TransitionEvaluator`.

        Raises:
            NetworkError: The state or a contact is not finite, or there is no network for a category.
        """
        all_rows, n = TransitionRows.of(transitions), len(transitions)
        feasible, objective = np.zeros(n, bool), np.zeros(n)
        end_com, end_velocity = np.zeros((n, 3)), np.zeros((n, 3))
        untrained, resting = 0, rests(stance)
        numbers = category_rows(stance, all_rows)
        group = len(Limb) * numbers + all_rows.limb
        for code in dict.fromkeys(group.tolist()):
            rows = np.flatnonzero(group == code)
            same = all_rows if len(rows) == n else all_rows.select(rows)
            category = Category(numbers[rows[0]])
            network = self.networks.get(category)
            if network is None:
                raise NetworkError(f"no network for category {int(category)} ({category.words}) is loaded")
            frame, features = encode(stance, com, com_velocity, same)
            if not np.isfinite(features).all():
                raise NetworkError(f"a query of category {int(category)} holds NaN or infinite values")
            untrained += int((~network.knows(features)).sum())
            features = network.within(features)
            accepted = network.feasible(features)
            feasible[rows] = accepted
            if accepted.any():
                way = ahead(frame.point(self.goal.position), self.goal.radius)
                outputs = network.predict(features[accepted], way).astype(float)
                kept = rows[accepted]
                lifts_at_once = (all_rows.shift[kept] < _HASTY * all_rows.swing[kept]) & resting
                objective[kept] = np.where(lifts_at_once, self.hasty, 1.0) * outputs[:, 0]
                end_com[kept] = frame.point_back(outputs[:, 1:4])
                end_velocity[kept] = frame.vector_back(outputs[:, 4:7])
                if not resting:
                    seconds, ends = (all_rows.shift + all_rows.swing)[kept], (end_com[kept], end_velocity[kept])
                    end_com[kept], end_velocity[kept] = allowed(stance, com, com_velocity, seconds, *ends)
        return TransitionBatch(feasible, objective, end_com, end_velocity, untrained=untrained)
