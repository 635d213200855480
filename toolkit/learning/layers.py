"""Perceptrons in torch: their layers, and their exchange with the networks of `prediction`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from toolkit.prediction.network import HIDDEN, LAYERS, Perceptron


def perceptron(inputs: int, outputs: int) -> nn.Sequential:
    """Linear layers with ReLU units between them, in the widths of `prediction.network`."""
    widths = [inputs, *[HIDDEN] * (LAYERS - 1), outputs]
    layers: list[nn.Module] = []
    for first, second in zip(widths[:-1], widths[1:], strict=True):
        layers += [nn.Linear(first, second), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


def linear_layers(net: nn.Sequential) -> list[nn.Linear]:
    """The layers that have weights."""
    return [layer for layer in net if isinstance(layer, nn.Linear)]


@dataclass(frozen=True)
class Scaling:
    """How inputs and outputs are z-scored.

    Attributes:
        mean, std: (d,) Mean and standard deviation of the inputs.
        out_mean, out_std: (k,) Mean and standard deviation of the outputs.
    """

    mean: np.ndarray
    std: np.ndarray
    out_mean: np.ndarray
    out_std: np.ndarray

    def fold(self, net: nn.Sequential) -> Perceptron:
        """The network with the scaling of inputs and outputs folded into its layers."""
        linear = linear_layers(net)
        weights = [layer.weight.detach().double().numpy().T for layer in linear]
        biases = [layer.bias.detach().double().numpy() for layer in linear]
        biases[0] = biases[0] - (self.mean / self.std) @ weights[0]
        weights[0] = weights[0] / self.std[:, None]
        weights[-1] = weights[-1] * self.out_std
        biases[-1] = biases[-1] * self.out_std + self.out_mean
        return Perceptron(
            tuple(np.ascontiguousarray(weight, np.float32) for weight in weights),
            tuple(np.ascontiguousarray(bias, np.float32) for bias in biases),
        )

    def unfold(self, start: Perceptron, net: nn.Sequential) -> None:
        """Give the layers the values of a trained network: the inverse of `fold`."""
        weights = [weight.astype(np.float64) for weight in start.weights]
        biases = [bias.astype(np.float64) for bias in start.biases]
        biases[0] += self.mean @ weights[0]
        weights[0] *= self.std[:, None]
        weights[-1] /= self.out_std
        biases[-1] = (biases[-1] - self.out_mean) / self.out_std
        with torch.no_grad():
            for layer, weight, bias in zip(linear_layers(net), weights, biases, strict=True):
                layer.weight.copy_(torch.from_numpy(weight.T))
                layer.bias.copy_(torch.from_numpy(bias))
