"""Training of the transition networks with torch (paper, Sec. VI)."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from safetensors.numpy import save_file
from torch import nn

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.dataset import Samples
from toolkit.learning.evaluate import AT_DEFAULT
from toolkit.learning.tangent import TangentSpace, with_gradient
from toolkit.prediction.features import COM, TARGETS
from toolkit.prediction.network import (
    HIDDEN,
    LAYERS,
    OBJECTIVE_SCALE,
    SCHEMA,
    Perceptron,
    TransitionNetwork,
    compressed,
    feasibility,
    network_path,
    outcome,
    training_summary,
)

Progress = Callable[[str, int, float, float], None]
_SILENT: Progress = lambda name, epoch, training, validation: None  # noqa: E731


@dataclass(frozen=True)
class FitConfig:
    """Settings of the training.

    Attributes:
        epochs: most passes over the data for the regressor; the learning rate falls to zero over them.
        classifier_share: the same for the classifier, as a part of `epochs`: it learns faster.
        batch: samples per gradient step.
        learning_rate: peak of the one-cycle schedule.
        weight_decay: of AdamW.
        dropout: in the classifier.
        width: of the smooth L1 loss, below which it is quadratic, in standard deviations of an output.
        objective_weight: of the objective's loss beside those of the six other outputs.
        sensitivity_weight: of the loss of the objective's derivatives, where samples have them: their mean, scaled by
            the features' spreads, see `learning.tangent`. They tell as much as many more labels.
        sensitivity_width: of their smooth L1 loss; nearly L1, for the objective has edges.
        default_weight: of samples with the paper's timing and friction beside the others, for the regressor: the others
            take part in one of so many epochs.
        orthogonal: whether the regressor's hidden layers are trained with Muon, which needs fewer steps; else by AdamW.
        validation: share of the data held out for early stopping: the last ones, which come from other terrain.
        patience: epochs without a better validation loss before stopping.
        coarse: share of the epochs that compute in bfloat16, twice as fast on processors that have it.
        device: torch's name of where to compute.
        objective_limit: transitions with a larger objective do not teach the regressor.
        minimum: fewest samples with each label.
        seed: of the initial weights and the shuffling.
    """

    epochs: int = 120
    classifier_share: float = 0.2
    batch: int = 512
    learning_rate: float = 4e-3
    weight_decay: float = 1e-4
    dropout: float = 0.0
    width: float = 0.02
    objective_weight: float = 3.0
    sensitivity_weight: float = 20.0
    sensitivity_width: float = 0.005
    default_weight: float = 3.0
    orthogonal: bool = True
    validation: float = 0.05
    patience: int = 40
    coarse: float = 0.8
    objective_limit: float = 5e4
    minimum: int = 50
    device: str = "cpu"
    seed: int = 0


@dataclass(frozen=True)
class Curve:
    """Learning curve: (epochs,) losses on the training and the validation set, and the epoch that was kept."""

    training: np.ndarray
    validation: np.ndarray
    best: int


@dataclass(frozen=True)
class TrainedNetworks:
    """A classifier and a regressor, and how they learnt."""

    classifier: Perceptron
    regressor: Perceptron
    curves: dict[str, Curve]

    def feasible(self, features: np.ndarray) -> np.ndarray:
        """(n,) bool for features (n, d)."""
        return feasibility(self.classifier, features)

    def predict(self, features: np.ndarray) -> np.ndarray:
        """(n, 7) objective, CoM and velocity for features (n, d)."""
        return outcome(self.regressor, features)


def _perceptron(inputs: int, outputs: int, dropout: float) -> nn.Sequential:
    widths = [inputs, *[HIDDEN] * (LAYERS - 1), outputs]
    layers: list[nn.Module] = []
    for first, second in zip(widths[:-1], widths[1:], strict=True):
        layers += [nn.Linear(first, second), nn.ReLU(), nn.Dropout(dropout)]
    return nn.Sequential(*layers[:-2])


class _Task(Protocol):
    """What a network learns from numbered samples.

    Attributes:
        share: (n,) of the epochs that each sample takes part in.
    """

    share: torch.Tensor

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """What training lowers."""
        ...

    def error(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """What is watched on samples that were held out."""
        ...


class _Classification:
    """Inputs (n, d), and whether each is feasible (n, 1)."""

    def __init__(self, inputs: torch.Tensor, targets: torch.Tensor):
        self._inputs, self._targets = inputs, targets
        self.share = torch.ones(len(inputs), dtype=torch.float64, device=inputs.device)

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        return nn.functional.binary_cross_entropy_with_logits(net(self._inputs[rows]).float(), self._targets[rows])

    error = loss


class _Regression:
    """Inputs (n, d) and scaled outputs (n, 7), by the smooth L1 loss; the derivatives of the objective where known.

    Args:
        features: (n, d), and
        inputs: (n, d) the same z-scored by
        std: (d,).
        targets: (n, 7).
        slopes: (n, k) derivatives of the first target (`learning.sensitivity`), NaN where unknown; None without any.
        config: of the training.
    """

    def __init__(
        self,
        features: torch.Tensor,
        inputs: torch.Tensor,
        std: torch.Tensor,
        targets: torch.Tensor,
        slopes: torch.Tensor | None,
        config: FitConfig,
    ):
        self._features, self._inputs, self._std, self._targets, self._config = features, inputs, std, targets, config
        self._weights = torch.ones(TARGETS, device=targets.device)
        self._weights[0] = config.objective_weight
        default = features.new_tensor(AT_DEFAULT)
        others = ((features[:, -3:] - default).abs() > 1e-5).any(1)
        self.share = torch.where(others, 1.0 / config.default_weight, 1.0).double()
        if others.all():
            self.share[:] = 1.0
        self._known = self._slopes = None
        if slopes is not None and config.sensitivity_weight > 0.0:
            self._tangent = TangentSpace(features)
            self._known = ~slopes.isnan().any(1)
            self._slopes = self._tangent.of_sensitivity(features, slopes.nan_to_num())

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        if self._known is None or self._slopes is None:
            return self._of_values(net(self._inputs[rows]), rows).mean()
        outputs, gradient = with_gradient(net, self._inputs[rows])
        found = self._tangent.of_gradient(self._features[rows], gradient.float() / self._std)
        width = self._config.sensitivity_width
        each = nn.functional.smooth_l1_loss(found, self._slopes[rows], beta=width, reduction="none").mean(1)
        slope = (each * self._known[rows]).mean()
        return self._of_values(outputs, rows).mean() + self._config.sensitivity_weight * slope

    def error(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        share = self.share[rows].float()
        return (self._of_values(net(self._inputs[rows]), rows) * share).sum() / share.sum()

    def _of_values(self, outputs: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        """(n,) loss of each sample's outputs."""
        width = self._config.width
        each = nn.functional.smooth_l1_loss(outputs.float(), self._targets[rows], beta=width, reduction="none")
        return (each * self._weights).mean(1)


def _optimisers(net: nn.Sequential, config: FitConfig, orthogonal: bool) -> list[torch.optim.Optimizer]:
    """AdamW, or Muon for the matrices of all layers but the last."""
    hidden = [layer.weight for layer in net if isinstance(layer, nn.Linear)][:-1] if orthogonal else []
    others = [part for part in net.parameters() if not any(part is weight for weight in hidden)]
    rate, decay = config.learning_rate, config.weight_decay
    result: list[torch.optim.Optimizer] = [torch.optim.AdamW(others, rate, weight_decay=decay, fused=True)]
    if hidden:
        result.append(torch.optim.Muon(hidden, rate, weight_decay=decay, adjust_lr_fn="match_rms_adamw"))
    return result


def _draw(share: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Rows in random order, each with its share as probability; the sum of the shares, rounded down, or one more."""
    order = torch.randperm(len(share), generator=generator, device=share.device)
    wheel = share[order].cumsum(0) + torch.rand(1, generator=generator, device=share.device, dtype=share.dtype)
    return order[wheel.floor() > (wheel - share[order]).floor()]


def _train(
    net: nn.Sequential,
    task: _Task,
    config: FitConfig,
    progress: Callable[[int, float, float], None],
    *,
    orthogonal: bool = False,
) -> Curve:
    """Train in place with early stopping; the weights of the best epoch are kept."""
    samples = len(task.share)
    device = torch.device(config.device)
    net.to(device)
    generator = torch.Generator(device).manual_seed(config.seed)
    count = samples - max(1, int(config.validation * samples))
    held_out = torch.arange(count, samples, device=device)
    share = task.share[:count]
    drawn = int(share.sum() - 1e-6 * count) if bool((share < 1.0).any()) else count
    size = max(1, min(config.batch, drawn))
    steps = max(1, drawn // size)
    optimisers = _optimisers(net, config, orthogonal)
    schedules = [
        torch.optim.lr_scheduler.OneCycleLR(
            each, config.learning_rate, total_steps=steps * config.epochs, pct_start=0.15, cycle_momentum=False
        )
        for each in optimisers
    ]
    best, best_epoch, kept = float("inf"), 0, {k: v.clone() for k, v in net.state_dict().items()}
    training, validation = [], []
    for epoch in range(config.epochs):
        net.train()
        order = _draw(share, generator)
        total = torch.zeros((), device=device)
        coarse = device.type == "cpu" and epoch < config.coarse * config.epochs
        for step in range(steps):
            rows = order[step * size : (step + 1) * size]
            net.zero_grad(set_to_none=True)
            with torch.autocast("cpu", torch.bfloat16, enabled=coarse):
                value = task.loss(net, rows)
            value.backward()
            for optimiser, schedule in zip(optimisers, schedules, strict=True):
                optimiser.step()
                schedule.step()
            total += value.detach()
        net.eval()
        with torch.no_grad():
            held = float(task.error(net, held_out))
        training.append(float(total) / steps)
        validation.append(held)
        progress(epoch, training[-1], held)
        if held < best:
            best, best_epoch = held, epoch
            kept = {k: v.clone() for k, v in net.state_dict().items()}
        elif epoch - best_epoch >= config.patience:
            break
    net.load_state_dict(kept)
    net.cpu().eval()
    return Curve(np.array(training), np.array(validation), best_epoch)


def _folded(
    net: nn.Sequential, mean: np.ndarray, std: np.ndarray, out_mean: np.ndarray, out_std: np.ndarray
) -> Perceptron:
    """The layers with both z-scorings folded in."""
    linear = [layer for layer in net if isinstance(layer, nn.Linear)]
    weights = [layer.weight.detach().double().numpy().T for layer in linear]
    biases = [layer.bias.detach().double().numpy() for layer in linear]
    biases[0] = biases[0] - (mean / std) @ weights[0]
    weights[0] = weights[0] / std[:, None]
    weights[-1] = weights[-1] * out_std
    biases[-1] = biases[-1] * out_std + out_mean
    return Perceptron(
        tuple(np.ascontiguousarray(weight, np.float32) for weight in weights),
        tuple(np.ascontiguousarray(bias, np.float32) for bias in biases),
    )


def _unfolded(
    net: nn.Sequential,
    start: Perceptron,
    mean: np.ndarray,
    std: np.ndarray,
    out_mean: np.ndarray,
    out_std: np.ndarray,
) -> None:
    """Give the layers the values of a trained network: `_folded` the other way round."""
    weights = [weight.astype(np.float64) for weight in start.weights]
    biases = [bias.astype(np.float64) for bias in start.biases]
    biases[0] += mean @ weights[0]
    weights[0] *= std[:, None]
    weights[-1] /= out_std
    biases[-1] = (biases[-1] - out_mean) / out_std
    linear = [layer for layer in net if isinstance(layer, nn.Linear)]
    with torch.no_grad():
        for layer, weight, bias in zip(linear, weights, biases, strict=True):
            layer.weight.copy_(torch.from_numpy(weight.T))
            layer.bias.copy_(torch.from_numpy(bias))


def train_networks(
    samples: Samples,
    config: FitConfig,
    progress: Progress = _SILENT,
    *,
    classifier: Perceptron | None = None,
    start: Perceptron | None = None,
) -> TrainedNetworks:
    """Train both networks on samples, in any encoding whose last columns are those of `features.encode`.

    The classifier minimises the logistic loss, the regressor the smooth L1 loss of its scaled outputs: the
    compressed objective, not centred, as in the original; way of the CoM and velocity z-scored. Where samples say how
    their objective changes, the regressor learns that too (Sobolev training; only in the encoding of `features`).

    Args:
        samples: labelled transitions of one category.
        config: settings.
        progress: called with ("classifier" or "regressor", epoch, training loss, validation loss).
        classifier: kept as it is where given; only the regressor is trained.
        start: regressor to go on from; None: from random weights.
    """
    torch.manual_seed(config.seed)
    feasible = samples.feasible
    features = samples.features.astype(np.float64)
    mean, std = features.mean(0), np.maximum(features.std(0), 1e-3)
    inputs = torch.from_numpy(((features - mean) / std).astype(np.float32)).to(config.device)
    size = features.shape[1]

    curves = {}
    if classifier is None:
        net = _perceptron(size, 1, config.dropout)
        truth = torch.from_numpy(feasible.astype(np.float32)[:, None]).to(config.device)
        curves["classifier"] = _train(
            net,
            _Classification(inputs, truth),
            replace(config, epochs=max(1, round(config.classifier_share * config.epochs))),
            lambda *state: progress("classifier", *state),
        )
        classifier = _folded(net, mean, std, np.zeros(1), np.ones(1))

    kept = feasible & (samples.targets[:, 0] < config.objective_limit)
    targets = samples.targets[kept].astype(np.float64)
    targets[:, 0] = compressed(targets[:, 0])
    targets[:, 1:4] -= features[kept, COM]
    out_mean = np.concatenate([[0.0], targets[:, 1:].mean(0)])
    out_std = np.maximum(targets.std(0), 1e-4)
    slopes = None
    if samples.sensitivity is not None:
        scale = (OBJECTIVE_SCALE + samples.targets[kept, :1]) * out_std[0]  # of the compressed objective
        slopes = torch.from_numpy((samples.sensitivity[kept] / scale).astype(np.float32)).to(config.device)
    rows = torch.from_numpy(np.flatnonzero(kept)).to(config.device)
    regressor = _perceptron(size, TARGETS, 0.0)
    if start is not None:
        _unfolded(regressor, start, mean, std, out_mean, out_std)
    task = _Regression(
        torch.from_numpy(samples.features[kept]).to(config.device),
        inputs[rows],
        torch.from_numpy(std.astype(np.float32)).to(config.device),
        torch.from_numpy(((targets - out_mean) / out_std).astype(np.float32)).to(config.device),
        slopes,
        config,
    )
    curves["regressor"] = _train(
        regressor, task, config, lambda *state: progress("regressor", *state), orthogonal=config.orthogonal
    )
    return TrainedNetworks(classifier, _folded(regressor, mean, std, out_mean, out_std), curves)


def fit_category(
    category: Category,
    samples: Samples,
    *,
    fingerprint: str,
    folder: Path,
    config: FitConfig,
    progress: Progress = _SILENT,
    kept: TransitionNetwork | None = None,
    refine: bool = False,
) -> dict[str, Curve]:
    """Train both networks of a category and write its file.

    Args:
        category: which one.
        samples: labelled transitions.
        fingerprint: of the robot.
        folder: where `category_<i>.safetensors` goes.
        config: settings.
        progress: called with ("classifier" or "regressor", epoch, training loss, validation loss).
        kept: whose classifier is taken over; only the regressor is trained.
        refine: whether training goes on from the regressor of `kept`.

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
    classifier, start = (None, None) if kept is None else (kept.classifier, kept.regressor if refine else None)
    trained = train_networks(samples, config, progress, classifier=classifier, start=start)
    tensors = {
        f"{name}.{layer}.{part}": array
        for name, net in (("classifier", trained.classifier), ("regressor", trained.regressor))
        for part, arrays in (("weight", net.weights), ("bias", net.biases))
        for layer, array in enumerate(arrays)
    }
    tensors["features.lower"] = samples.features.min(0)
    tensors["features.upper"] = samples.features.max(0)
    curves, before = trained.curves, {} if kept is None else training_summary(kept)
    summary = {
        "samples": len(samples),
        "feasible": counts[0],
        "config": asdict(config),
        "config_before": before.get("config"),
        "known_sensitivities": 0 if samples.sensitivity is None else int((~np.isnan(samples.sensitivity[:, 0])).sum()),
        "epochs": before.get("epochs", {}) | {name: len(curve.training) for name, curve in curves.items()},
        "validation_loss": before.get("validation_loss", {})
        | {name: float(curve.validation.min()) for name, curve in curves.items()},
        "curves": before.get("curves", {})
        | {
            name: [[float(f"{value:.3g}") for value in losses] for losses in (curve.training, curve.validation)]
            for name, curve in curves.items()
        },
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
