"""Networks: a classifier and a regressor per category, evaluated in NumPy, stored as safetensors."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open

from toolkit.contacts.category import Category
from toolkit.errors import NetworkError
from toolkit.prediction.features import AHEAD, COM, TARGETS, TIMING_AND_FRICTION, feature_size

SCHEMA = "transition-network-5"
HIDDEN = 256
LAYERS = 4  # three hidden ones and the output
OBJECTIVE_SCALE = 30.0  # objectives below it are learnt in proportion to themselves, larger ones to their logarithm


@dataclass(frozen=True)
class Perceptron:
    """ReLU layers; the z-scoring of the inputs is folded into the first one, that of the outputs into the last.

    Attributes:
        weights: Weights of each layer, (inputs, outputs) float32.
        biases: Biases of each layer, (outputs,) float32.
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs (n, k) float32 for inputs (n, d)."""
        x = np.asarray(inputs, np.float32)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = x @ weight
            x += bias
            np.maximum(x, 0.0, out=x)
        return x @ self.weights[-1] + self.biases[-1]


def stored(net: Perceptron, lower: np.ndarray, upper: np.ndarray) -> Perceptron:
    """A perceptron as files hold it: weights in half precision, those of the first layer for inputs within -1 and 1.

    Args:
        net: The perceptron.
        lower: (d,) least features of the training.
        upper: (d,) greatest ones. Inputs after them are within -1 and 1 as they are.
    """
    centre, reach = _middle(lower, upper, len(net.weights[0]))
    first, bias = net.weights[0] * reach[:, None], net.biases[0] + centre @ net.weights[0]
    weights = [weight.astype(np.float16) for weight in (first, *net.weights[1:])]
    return Perceptron(tuple(weights), (bias.astype(np.float32), *net.biases[1:]))


def restored(net: Perceptron, lower: np.ndarray, upper: np.ndarray) -> Perceptron:
    """The perceptron of one that was `stored`."""
    centre, reach = _middle(lower, upper, len(net.weights[0]))
    weights = [weight.astype(np.float32) for weight in net.weights]
    weights[0] /= reach[:, None]
    return Perceptron(tuple(weights), (net.biases[0] - centre @ weights[0], *net.biases[1:]))


def _middle(lower: np.ndarray, upper: np.ndarray, inputs: int) -> tuple[np.ndarray, np.ndarray]:
    """Middle and half width of the ranges of inputs; 1 where there is no width, and where none is given."""
    middle, reach = np.zeros(inputs, np.float32), np.ones(inputs, np.float32)
    middle[: len(lower)], half = (lower + upper) / 2, (upper - lower) / 2
    reach[: len(lower)] = np.where(half > 0.0, half, 1.0)
    return middle, reach


def feasibility(classifier: Perceptron, features: np.ndarray) -> np.ndarray:
    """(n,) bool; whether the classifier predicts that transitions (n, d) are feasible."""
    return classifier(features)[:, 0] > 0.0


def compressed(objective: np.ndarray) -> np.ndarray:
    """The regressor's output for an objective: log(1 + objective / scale)."""
    return np.log1p(objective / OBJECTIVE_SCALE)


def expanded(output: np.ndarray) -> np.ndarray:
    """The objective (not negative) for an output of the regressor."""
    return OBJECTIVE_SCALE * np.expm1(np.clip(output, 0.0, 20.0))


def with_goal(features: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Inputs (n, d + 2) float32 of the regressor: features (n, d), and `features.ahead` (n, 2) or (2,)."""
    inputs = np.empty((len(features), features.shape[1] + AHEAD), np.float32)
    inputs[:, :-AHEAD], inputs[:, -AHEAD:] = features, goal
    return inputs


def outcome(regressor: Perceptron, features: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """(n, 7) float32 objective, CoM and velocity of transitions (n, d), canonical; `goal` is `ahead` (n, 2) or (2,).

    The regressor gives the compressed objective, which spans four orders of magnitude, and the change of the CoM, which
    is small. Both are easier to learn in this form.
    """
    outputs = regressor(with_goal(features, goal))
    outputs[:, 0] = expanded(outputs[:, 0])
    outputs[:, 1:4] += features[:, COM]
    return outputs


@dataclass(frozen=True)
class TransitionNetwork:
    """The two networks of one category.

    Attributes:
        category: Category of the transitions that they judge.
        classifier: Features -> (n, 1) log-odds of being feasible (a softmax over two classes is their logistic).
        regressor: Features and where the goal lies -> (n, 7), see `outcome`.
        lower, upper: (d,) range of the training features.
        metadata: The file's notes on its training.
    """

    category: Category
    classifier: Perceptron
    regressor: Perceptron
    lower: np.ndarray
    upper: np.ndarray
    metadata: dict[str, str]

    @cached_property
    def _least(self) -> np.ndarray:
        """Least timing and friction (3,) of the training, with 1 % of the ranges to spare."""
        lower, upper = self.lower[TIMING_AND_FRICTION], self.upper[TIMING_AND_FRICTION]
        return lower - 0.01 * (upper - lower) - 1e-6

    def knows(self, features: np.ndarray) -> np.ndarray:
        """(n,) bool: whether the timing and friction of features (n, d) are at least the least of the training."""
        return np.all(features[:, TIMING_AND_FRICTION] >= self._least, axis=1)

    def within(self, features: np.ndarray) -> np.ndarray:
        """Features (n, d) with timing and friction of at most the greatest of the training.

        Longer times and more friction hardly make a transition harder, so that a judgement there holds beyond.
        """
        within = features.copy()
        within[:, TIMING_AND_FRICTION] = np.minimum(features[:, TIMING_AND_FRICTION], self.upper[TIMING_AND_FRICTION])
        return within

    def feasible(self, features: np.ndarray) -> np.ndarray:
        """(n,) bool; whether transitions with features (n, d) are feasible."""
        return feasibility(self.classifier, features)

    def predict(self, features: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """(n, 7) float32 objective (not negative), CoM and velocity for features (n, d); see `outcome`."""
        return outcome(self.regressor, features, goal)


def network_path(folder: Path, category: Category) -> Path:
    """File of a category in a robot's `networks/` folder."""
    return folder / f"category_{int(category)}.safetensors"


def load_network(path: Path, category: Category, fingerprint: str) -> TransitionNetwork:
    """Load and check one file.

    Args:
        path: The safetensors file.
        category: The expected category.
        fingerprint: Fingerprint of the robot that will use it.

    Raises:
        NetworkError: Missing or truncated file, wrong schema, category, robot or shapes, values that are not finite.
    """
    remedy = "train it with: python -m toolkit.train collect, then fit"
    if not path.is_file():
        raise NetworkError(f"{path}: no such network; {remedy}")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = dict(file.metadata() or {})
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a mapping)
    except (SafetensorError, OSError) as error:
        raise NetworkError(f"{path}: not a readable safetensors file ({error}); {remedy}") from None
    expected = {"schema": SCHEMA, "category": str(int(category)), "robot": fingerprint}
    for key, value in expected.items():
        if metadata.get(key) != value:
            raise NetworkError(f"{path}: {key} is {metadata.get(key)!r}, expected {value!r}; {remedy}")
    size = feature_size(category)
    lower, upper = (_tensor(path, tensors, f"features.{name}", (size,)) for name in ("lower", "upper"))
    parts = []
    for name, inputs, outputs in (("classifier", size, 1), ("regressor", size + AHEAD, TARGETS)):
        widths = [inputs, *[HIDDEN] * (LAYERS - 1), outputs]
        weights, biases = [], []
        for layer in range(LAYERS):
            weights.append(_tensor(path, tensors, f"{name}.{layer}.weight", (widths[layer], widths[layer + 1])))
            biases.append(_tensor(path, tensors, f"{name}.{layer}.bias", (widths[layer + 1],)))
        parts.append(restored(Perceptron(tuple(weights), tuple(biases)), lower, upper))
    return TransitionNetwork(category, parts[0], parts[1], lower, upper, metadata)


def _tensor(path: Path, tensors: dict[str, np.ndarray], name: str, shape: tuple[int, ...]) -> np.ndarray:
    if name not in tensors:
        raise NetworkError(f"{path}: tensor {name} is missing; train the networks again")
    tensor = np.ascontiguousarray(tensors[name], np.float32)
    if tensor.shape != shape:
        raise NetworkError(f"{path}: tensor {name} is {tensor.shape}, expected {shape}; train the networks again")
    if not np.isfinite(tensor).all():
        raise NetworkError(f"{path}: tensor {name} holds values that are not finite; train the networks again")
    return tensor


def training_summary(network: TransitionNetwork) -> dict:
    """The file's notes on its training, as a dictionary.

    Raises:
        NetworkError: The notes are no JSON dictionary.
    """
    try:
        notes = json.loads(network.metadata.get("training", "{}"))
    except (ValueError, RecursionError):
        notes = None
    if not isinstance(notes, dict):
        raise NetworkError("the notes on the training in a network's file are no JSON; train the networks again")
    return notes
