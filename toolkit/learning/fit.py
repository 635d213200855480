"""Training of the transition networks with torch (paper, Sec. VI)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import save_file

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError, InputError, NetworkError
from toolkit.learning.descent import Curve, FitConfig, descend
from toolkit.learning.layers import Scaling, perceptron
from toolkit.learning.samples import PAPER, PLANNED, Samples, Split, join
from toolkit.learning.tasks import Classification, Regression
from toolkit.prediction.features import AHEAD, COM, TARGETS, TIMING, ahead
from toolkit.prediction.network import (
    SCHEMA,
    Perceptron,
    compressed,
    feasibility,
    load_network,
    network_path,
    outcome,
    stored,
    training_summary,
    with_goal,
)
from toolkit.robot.scale import Scale
from toolkit.world.timing import own_timings

BLURRED = 2  # copies of each sample whose CoM state is disturbed
# m and m/s for a body of the usual size (`toolkit.robot.scale`); usual errors of predicted states
COM_BLUR, VELOCITY_BLUR = np.array([0.015, 0.015, 0.008]), np.array([0.04, 0.04, 0.02])
SHORT = 0.1  # m for a body of the usual size; a search ends up to so far within its goal region
MINIMUM = 50  # least number of samples with each label
OBJECTIVE_LIMIT = 5e4  # the regressor does not learn from transitions with a larger objective

Progress = Callable[[str, int, float, float], None]
"""Is called with "classifier" or "regressor", the epoch, the training loss and the validation loss."""


@dataclass(frozen=True)
class TrainedNetworks:
    """A classifier and a regressor, and their learning curves."""

    classifier: Perceptron
    regressor: Perceptron
    curves: dict[str, Curve]

    def feasible(self, features: np.ndarray) -> np.ndarray:
        """(n,) bool; whether the transitions with features (n, d) are feasible."""
        return feasibility(self.classifier, features)

    def predict(self, features: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """(n, 7) objective, CoM (m) and CoM velocity (m/s) of the transitions with features (n, d); see `outcome`."""
        return outcome(self.regressor, features, goal)


def check_device(device: str) -> None:
    """Make sure that torch can compute on a device.

    Raises:
        InputError: It cannot.
    """
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"--device {device}: torch cannot compute there ({reason}); use --device cpu") from None


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let torch compute with so many threads for a while."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def train_networks(
    samples: Samples,
    config: FitConfig,
    progress: Progress = lambda *state: None,
    *,
    classifier: Perceptron | None = None,
    start: Perceptron | None = None,
) -> TrainedNetworks:
    """Train both networks on samples, in any encoding whose last columns are those of `features.encode`.

    The classifier minimises the logistic loss, the regressor the smooth L1 loss of its scaled outputs. These are the
    compressed objective, not centred, as in the original, and the z-scored displacement and velocity of the CoM. The
    regressor is told where the sequence ends, as a search ends within its goal region. The worlds of the validation
    split decide on early stopping, those of the test split are not used.

    Args:
        samples: Labelled transitions of one category.
        config: Settings.
        progress: See `Progress`.
        classifier: A classifier that is kept, so that only the regressor is trained.
        start: The regressor whose training continues; None for random weights.
    """
    torch.manual_seed(config.seed)
    samples = join([samples.of(Split.TRAINING), samples.of(Split.VALIDATION)])

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(values.astype(np.float32)).to(config.device)

    features = samples.features.astype(np.float64)
    mean, std = features.mean(0), np.maximum(features.std(0), 1e-3)
    inputs = tensor((features - mean) / std)
    size, curves = features.shape[1], {}
    if classifier is None:
        net = perceptron(size, 1)
        curves["classifier"] = descend(
            net,
            Classification(inputs, tensor(samples.feasible[:, None])),
            replace(config, epochs=max(1, round(config.classifier_share * config.epochs))),
            lambda *state: progress("classifier", *state),
            _held_out(samples),
        )
        classifier = Scaling(mean, std, np.zeros(1), np.ones(1)).fold(net)

    kept = np.flatnonzero(samples.known & (samples.targets[:, 0] < OBJECTIVE_LIMIT))
    kept = np.repeat(kept, 1 + BLURRED)
    features, rng = features[kept], np.random.default_rng(config.seed)
    _blur(features, np.arange(len(kept)) % (1 + BLURRED) > 0, Scale(config.length), rng)
    goal = ahead(samples.goal[kept].astype(np.float64), config.length * rng.uniform(0.0, SHORT, len(kept)))
    targets = samples.targets[kept].astype(np.float64)
    targets[:, 0] = compressed(targets[:, 0])
    targets[:, 1:4] -= features[:, COM]
    out_mean = np.concatenate([[0.0], targets[:, 1:].mean(0)])
    mean, std = np.append(mean, np.zeros(AHEAD)), np.append(std, np.ones(AHEAD))
    scaling = Scaling(mean, std, out_mean, np.maximum(targets.std(0), 1e-4))
    regressor = perceptron(size + AHEAD, TARGETS)
    if start is not None:
        scaling.unfold(start, regressor)
    task = Regression(
        tensor(samples.features[kept, TIMING]),
        tensor((with_goal(features, goal) - mean) / std),
        tensor((targets - out_mean) / scaling.out_std),
        {PAPER, PLANNED, *own_timings(config.pace)},
    )
    held_out = _held_out(samples.select(kept))
    curves["regressor"] = descend(
        regressor, task, config, lambda *state: progress("regressor", *state), held_out, orthogonal=True
    )
    return TrainedNetworks(classifier, scaling.fold(regressor), curves)


def _blur(features: np.ndarray, rows: np.ndarray, scale: Scale, rng: np.random.Generator) -> None:
    """Disturb the CoM states of some rows of features (n, d) as predictions of a search are wrong for a body of a size.

    In a search, a transition begins in the state that is predicted after the one before. What is learned of disturbed
    states with the labels of the true ones does not amplify such errors.
    """
    usual = np.concatenate([scale.length * COM_BLUR, scale.speed * VELOCITY_BLUR])
    spread = rng.uniform(0.0, 2.0, (rows.sum(), 1)) * usual
    features[rows, COM.start : COM.stop + 3] += spread * rng.normal(size=(rows.sum(), 6))


def _held_out(samples: Samples) -> np.ndarray:
    """(n,) bool; samples that decide on early stopping: the validation split, or the last ones where it is empty."""
    held_out = np.isin(samples.world % 10, Split.VALIDATION.value)
    if not held_out.any():
        held_out[-max(1, len(samples) // 20) :] = True
    return held_out


def fit_category(
    category: Category,
    samples: Samples,
    *,
    fingerprint: str,
    folder: Path,
    config: FitConfig,
    progress: Progress = lambda *state: None,
    keep_classifier: bool = False,
    refine: bool = False,
) -> dict[str, Curve]:
    """Train both networks of a category and write its file.

    Args:
        category: The category.
        samples: Labelled transitions of the category.
        fingerprint: Fingerprint of the robot.
        folder: Folder of the file `category_<i>.safetensors`.
        config: Settings.
        progress: See `Progress`.
        keep_classifier: Whether to keep the classifier of the existing file and train only the regressor.
        refine: Whether to do the same and to continue the training of the file's regressor.

    Returns:
        Learning curves by network.

    Raises:
        DatasetError: There are too few samples of a label.
        NetworkError: The existing file is wanted, but is missing or does not fit.
    """
    known, infeasible = int(samples.known.sum()), int((~samples.feasible).sum())
    if min(known, infeasible) < MINIMUM:
        raise DatasetError(
            f"category {int(category)} has {known} transitions of whole motions and {infeasible} infeasible ones; "
            f"{MINIMUM} of each are needed: collect more"
        )
    path, classifier, start, before = network_path(folder, category), None, None, {}
    if keep_classifier or refine:
        kept = load_network(path, category, fingerprint)
        classifier, start, before = kept.classifier, kept.regressor if refine else None, training_summary(kept)
    trained = train_networks(samples, config, progress, classifier=classifier, start=start)
    lower, upper = samples.features.min(0), samples.features.max(0)
    tensors = {
        f"{name}.{layer}.{part}": array
        for name, net in (
            ("classifier", stored(trained.classifier, lower, upper)),
            ("regressor", stored(trained.regressor, lower, upper)),
        )
        for part, arrays in (("weight", net.weights), ("bias", net.biases))
        for layer, array in enumerate(arrays)
    }
    tensors["features.lower"], tensors["features.upper"] = lower, upper
    metadata = {
        "schema": SCHEMA,
        "category": str(int(category)),
        "robot": fingerprint,
        "training": json.dumps(_summary(samples, config, trained.curves, before)),
    }
    folder.mkdir(parents=True, exist_ok=True)
    save_file(tensors, path, metadata)
    return trained.curves


def _summary(samples: Samples, config: FitConfig, curves: dict[str, Curve], before: dict) -> dict:
    """Summary of the training for the network file; `before` is the summary of a network that was kept."""
    losses = {
        name: [[float(f"{value:.3g}") for value in values] for values in (curve.training, curve.validation)]
        for name, curve in curves.items()
    }
    return {
        "samples": len(samples),
        "feasible": int(samples.feasible.sum()),
        "config": asdict(config),
        "config_before": before.get("config"),
        "labelled": int(samples.known.sum()),
        "epochs": before.get("epochs", {}) | {name: len(curve.training) for name, curve in curves.items()},
        "validation_loss": before.get("validation_loss", {})
        | {name: float(curve.validation.min()) for name, curve in curves.items()},
        "curves": before.get("curves", {}) | losses,
        "torch": torch.__version__,
    }


def is_trained(category: Category, folder: Path, fingerprint: str, config: FitConfig, samples: int) -> bool:
    """Whether a folder holds networks of a category that were trained with these settings on as many samples."""
    try:
        summary = training_summary(load_network(network_path(folder, category), category, fingerprint))
    except NetworkError:
        return False
    return summary.get("config") == asdict(config) and summary.get("samples") == samples


def saved_curves(folder: Path, fingerprint: str) -> dict[Category, dict]:
    """Learning curves of all networks in a folder."""
    found = {}
    for category in Category:
        with suppress(NetworkError):  # there is none, or it belongs to another robot or has an older format
            network = load_network(network_path(folder, category), category, fingerprint)
            found[category] = training_summary(network)["curves"]
    return found
