"""Gradient descent: one network learns one task, with early stopping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from toolkit.learning.layers import linear_layers
from toolkit.learning.tasks import Classification, Regression

WEIGHT_DECAY = 1e-4
COARSE = 0.8  # share of the epochs that compute in bfloat16, which is twice as fast on processors that have it


@dataclass(frozen=True)
class FitConfig:
    """Settings of the training.

    Attributes:
        epochs: Largest number of passes over the data; the learning rate falls to zero over them.
        classifier_share: The share of `epochs` for the classifier, which learns faster.
        batch: Number of samples per gradient step.
        learning_rate: Peak of the one-cycle schedule.
        patience: Number of epochs without a better validation loss before training stops.
        device: The device that torch computes on.
        seed: Seed of the initial weights and of the shuffling.
        length: Factor on the lengths of the robot (`toolkit.robot.scale`).
        pace: Factor on the times of its planner's own timings (`RobotModel.pace`).
    """

    epochs: int = 120
    classifier_share: float = 0.2
    batch: int = 512
    learning_rate: float = 4e-3
    patience: int = 40
    device: str = "cpu"
    seed: int = 0
    length: float = 1.0
    pace: float = 1.0


@dataclass(frozen=True)
class Curve:
    """Learning curve: (epochs,) losses on the training and the validation set, and the epoch that was kept."""

    training: np.ndarray
    validation: np.ndarray
    best: int


def _optimisers(net: nn.Sequential, config: FitConfig, orthogonal: bool) -> list[torch.optim.Optimizer]:
    """AdamW; where `orthogonal`, Muon for the matrices of all layers but the last."""
    hidden = [layer.weight for layer in linear_layers(net)[:-1]] if orthogonal else []
    others = [part for part in net.parameters() if not any(part is weight for weight in hidden)]
    rate, decay = config.learning_rate, WEIGHT_DECAY
    result: list[torch.optim.Optimizer] = [torch.optim.AdamW(others, rate, weight_decay=decay, fused=True)]
    if hidden:
        result.append(torch.optim.Muon(hidden, rate, weight_decay=decay, adjust_lr_fn="match_rms_adamw"))
    return result


def draw(share: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Random rows in random order, each with its share as probability; their number varies by one at most."""
    order = torch.randperm(len(share), generator=generator, device=share.device)
    wheel = share[order].cumsum(0) + torch.rand(1, generator=generator, device=share.device, dtype=share.dtype)
    return order[wheel.floor() > (wheel - share[order]).floor()]


def descend(
    net: nn.Sequential,
    task: Classification | Regression,
    config: FitConfig,
    progress: Callable[[int, float, float], None],
    held_out: np.ndarray,
    *,
    orthogonal: bool = False,
) -> Curve:
    """Train in place with early stopping; the weights of the best epoch are kept.

    Args:
        net: The network. It is on the CPU and in evaluation mode afterwards.
        task: What the network learns.
        config: Settings.
        progress: Is called with the epoch, the training loss and the validation loss.
        held_out: (n,) bool; samples that decide on early stopping and are not trained on.
        orthogonal: Whether Muon trains the hidden layers, which needs fewer steps than AdamW.
    """
    device = torch.device(config.device)
    net.to(device)
    generator = torch.Generator(device).manual_seed(config.seed)
    trained, held = (torch.from_numpy(np.flatnonzero(rows)).to(device) for rows in (~held_out, held_out))
    share = task.share[trained]
    drawn = int(share.sum() - 1e-6 * len(share)) if bool((share < 1.0).any()) else len(share)
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
        order = trained[draw(share, generator)]
        total = torch.zeros((), device=device)
        coarse = device.type == "cpu" and epoch < COARSE * config.epochs
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
            error = float(task.error(net, held))
        training.append(float(total) / steps)
        validation.append(error)
        progress(epoch, training[-1], error)
        if error < best:
            best, best_epoch = error, epoch
            kept = {k: v.clone() for k, v in net.state_dict().items()}
        elif epoch - best_epoch >= config.patience:
            break
    net.load_state_dict(kept)
    net.cpu().eval()
    return Curve(np.array(training), np.array(validation), best_epoch)
