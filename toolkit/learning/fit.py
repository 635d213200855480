"""Training of the transition networks with torch (paper, Sec. VI)."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import save_file
from torch import nn

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.dataset import Samples
from toolkit.prediction.features import TARGETS
from toolkit.prediction.network import HIDDEN, LAYERS, SCHEMA, network_path

Progress = Callable[[str, int, float, float], None]


@dataclass(frozen=True)
class FitConfig:
    """Settings of the training.

    Attributes:
        epochs: most passes over the data; the learning rate falls to zero over them.
        batch: samples per gradient step.
        learning_rate: peak of the one-cycle schedule.
        weight_decay: of AdamW.
        dropout: in the classifier.
        validation: share of the data held out for early stopping.
        patience: epochs without a better validation loss before stopping.
        objective_limit: transitions with a larger objective do not teach the regressor.
        minimum: fewest samples with each label.
        seed: of the split, the initial weights and the shuffling.
    """

    epochs: int = 60
    batch: int = 1024
    learning_rate: float = 2e-3
    weight_decay: float = 1e-4
    dropout: float = 0.0
    validation: float = 0.1
    patience: int = 15
    objective_limit: float = 5e4
    minimum: int = 50
    seed: int = 0


@dataclass(frozen=True)
class Curve:
    """Learning curve: (epochs,) losses on the training and the validation set, and the epoch that was kept."""

    training: np.ndarray
    validation: np.ndarray
    best: int


def _perceptron(inputs: int, outputs: int, dropout: float) -> nn.Sequential:
    widths = [inputs, *[HIDDEN] * (LAYERS - 1), outputs]
    layers: list[nn.Module] = []
    for first, second in zip(widths[:-1], widths[1:], strict=True):
        layers += [nn.Linear(first, second), nn.ReLU(), nn.Dropout(dropout)]
    return nn.Sequential(*layers[:-2])


def _train(
    net: nn.Sequential,
    data: tuple[torch.Tensor, torch.Tensor],
    loss: Callable[[torch.Tensor, torch.Tensor], torch.Tensor],
    config: FitConfig,
    progress: Callable[[int, float, float], None],
) -> Curve:
    """Train in place with early stopping; the weights of the best epoch are kept."""
    inputs, targets = data
    generator = torch.Generator().manual_seed(config.seed)
    order = torch.randperm(len(inputs), generator=generator)
    held = max(1, int(config.validation * len(inputs)))
    check, train = order[:held], order[held:]
    steps = max(1, len(train) // config.batch)
    optimiser = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, config.learning_rate, total_steps=steps * config.epochs, pct_start=0.15
    )
    best, best_epoch, kept = float("inf"), 0, {k: v.clone() for k, v in net.state_dict().items()}
    training, validation = [], []
    for epoch in range(config.epochs):
        net.train()
        shuffled = train[torch.randperm(len(train), generator=generator)]
        total = 0.0
        for step in range(steps):
            rows = shuffled[step * config.batch : (step + 1) * config.batch]
            optimiser.zero_grad(set_to_none=True)
            value = loss(net(inputs[rows]), targets[rows])
            value.backward()
            optimiser.step()
            schedule.step()
            total += float(value.detach())
        net.eval()
        with torch.no_grad():
            held_loss = float(loss(net(inputs[check]), targets[check]))
        training.append(total / steps)
        validation.append(held_loss)
        progress(epoch, training[-1], held_loss)
        if held_loss < best:
            best, best_epoch = held_loss, epoch
            kept = {k: v.clone() for k, v in net.state_dict().items()}
        elif epoch - best_epoch >= config.patience:
            break
    net.load_state_dict(kept)
    net.eval()
    return Curve(np.array(training), np.array(validation), best_epoch)


def _export(
    name: str, net: nn.Sequential, mean: np.ndarray, std: np.ndarray, out_mean: np.ndarray, out_std: np.ndarray
) -> dict[str, np.ndarray]:
    """Weights (inputs, outputs) with both z-scorings folded in."""
    linear = [layer for layer in net if isinstance(layer, nn.Linear)]
    weights = [layer.weight.detach().double().numpy().T for layer in linear]
    biases = [layer.bias.detach().double().numpy() for layer in linear]
    biases[0] = biases[0] - (mean / std) @ weights[0]
    weights[0] = weights[0] / std[:, None]
    weights[-1] = weights[-1] * out_std
    biases[-1] = biases[-1] * out_std + out_mean
    tensors = {}
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        tensors[f"{name}.{layer}.weight"] = np.ascontiguousarray(weight, np.float32)
        tensors[f"{name}.{layer}.bias"] = np.ascontiguousarray(bias, np.float32)
    return tensors


def fit_category(
    category: Category,
    samples: Samples,
    *,
    fingerprint: str,
    folder: Path,
    config: FitConfig,
    progress: Progress = lambda name, epoch, training, validation: None,
) -> dict[str, Curve]:
    """Train both networks of a category and write its file.

    The classifier minimises the logistic loss, the regressor the smooth L1 loss of its scaled outputs: the objective
    by its mean (not centred, as in the original), CoM and velocity z-scored.

    Args:
        category: which one.
        samples: labelled transitions.
        fingerprint: of the robot.
        folder: where `category_<i>.safetensors` goes.
        config: settings.
        progress: called with ("classifier" or "regressor", epoch, training loss, validation loss).

    Returns:
        Learning curves by network.

    Raises:
        DatasetError: too few samples of a label.
    """
    feasible = samples.feasible
    counts = int(feasible.sum()), int((~feasible).sum())
    if min(counts) < config.minimum:
        raise DatasetError(
            f"category {int(category)} has {counts[0]} feasible and {counts[1]} infeasible transitions; "
            f"{config.minimum} of each are needed: collect more"
        )
    torch.manual_seed(config.seed)
    features = samples.features.astype(np.float64)
    mean, std = features.mean(0), np.maximum(features.std(0), 1e-3)
    inputs = torch.from_numpy(((features - mean) / std).astype(np.float32))
    size = features.shape[1]

    classifier = _perceptron(size, 1, config.dropout)
    labels = torch.from_numpy(feasible.astype(np.float32)[:, None])
    curves = {
        "classifier": _train(
            classifier,
            (inputs, labels),
            nn.functional.binary_cross_entropy_with_logits,
            config,
            lambda *state: progress("classifier", *state),
        )
    }

    kept = feasible & (samples.targets[:, 0] < config.objective_limit)
    targets = samples.targets[kept].astype(np.float64)
    out_mean = np.concatenate([[0.0], targets[:, 1:].mean(0)])
    out_std = np.concatenate([[targets[:, 0].mean()], np.maximum(targets[:, 1:].std(0), 1e-4)])
    scaled = torch.from_numpy(((targets - out_mean) / out_std).astype(np.float32))
    regressor = _perceptron(size, TARGETS, 0.0)
    curves["regressor"] = _train(
        regressor,
        (inputs[torch.from_numpy(kept)], scaled),
        lambda output, target: nn.functional.smooth_l1_loss(output, target, beta=0.05),
        config,
        lambda *state: progress("regressor", *state),
    )

    one, zero = np.ones(1), np.zeros(1)
    tensors = _export("classifier", classifier, mean, std, zero, one)
    tensors |= _export("regressor", regressor, mean, std, out_mean, out_std)
    tensors["features.lower"] = features.min(0).astype(np.float32)
    tensors["features.upper"] = features.max(0).astype(np.float32)
    summary = {
        "samples": len(samples),
        "feasible": counts[0],
        "config": asdict(config),
        "epochs": {name: len(curve.training) for name, curve in curves.items()},
        "validation_loss": {name: float(curve.validation.min()) for name, curve in curves.items()},
        "torch": torch.__version__,
    }
    metadata = {
        "schema": SCHEMA,
        "category": str(int(category)),
        "robot": fingerprint,
        "training": json.dumps(summary),
    }
    folder.mkdir(parents=True, exist_ok=True)
    save_file(tensors, network_path(folder, category), metadata)
    return curves
