"""Planes fitted to the neighbourhood of each place of a scan, and the noise of the scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from toolkit.scanning.samples import Samples, cells_of

_BLOCK = 20_000  # places whose neighbours are held at once
_LEAST_NEIGHBOURS = 8
_QUIET = 0.3  # share of the places that is taken to lie on flat ground, where only noise is seen


@dataclass(frozen=True)
class LocalPlanes:
    """Planes of the neighbourhoods of places.

    Attributes:
        places: Points (p, 3) float on the planes, m.
        normals: Unit normals (p, 3), outward where the scan says what is outside.
        spread: Root mean square distance of the neighbours from their plane, (p,) float, m.
        sided: Whether the scan says which side is outside, (p,) bool.
        weight: Area of the neighbours, (p,) float, m^2.
    """

    places: np.ndarray
    normals: np.ndarray
    spread: np.ndarray
    sided: np.ndarray
    weight: np.ndarray

    @property
    def noise(self) -> float:
        """Standard deviation of the scan's noise along normals, m: the spread where the scan is flattest."""
        return float(np.quantile(self.spread, _QUIET)) if len(self.spread) else 0.0


def local_planes(samples: Samples, radius: float) -> LocalPlanes:
    """Fit a plane to the thin points within `radius` m of every place; places are half a radius apart."""
    thin, weight = samples.thin, samples.weight
    turned = np.column_stack(
        [np.bincount(samples.owner, samples.turned[:, axis], minlength=len(thin)) for axis in range(3)]
    )
    owner, count = cells_of(thin, radius / 2)
    places = _sums(owner, thin, count) / np.bincount(owner, minlength=count)[:, None]
    tree, found = KDTree(thin), []
    for begin in range(0, count, _BLOCK):
        block = places[begin : begin + _BLOCK]
        pairs = KDTree(block).sparse_distance_matrix(tree, radius, output_type="ndarray")
        found.append(_fitted(block, thin, weight, turned, pairs["i"], pairs["j"]))
    joined = [np.concatenate(column) for column in zip(*found, strict=True)]
    enough = joined.pop() >= _LEAST_NEIGHBOURS
    return LocalPlanes(*(column[enough] for column in joined))


def _sums(owner: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Sums (count, d) of the values (n, d) of each owner (n,)."""
    return np.column_stack([np.bincount(owner, column, count) for column in values.T])


def _fitted(places, points, weight, turned, owner, other) -> tuple[np.ndarray, ...]:
    """Places on their planes, normals, spread, sides, weight and number of the neighbours `other` of each place."""
    count = len(places)
    share = weight[other]
    total = np.maximum(np.bincount(owner, share, count), 1e-12)
    offset = points[other] - places[owner]
    mean = _sums(owner, share[:, None] * offset, count) / total[:, None]
    offset -= mean[owner]
    products = [share * offset[:, a] * offset[:, b] for a in range(3) for b in range(3)]
    spread = np.stack([np.bincount(owner, product, count) for product in products], axis=1) / total[:, None]
    values, vectors = np.linalg.eigh(spread.reshape(-1, 3, 3))
    normals = vectors[:, :, 0]
    outside = np.einsum("pi,pi->p", _sums(owner, turned[other], count), normals)
    normals = np.where(outside < 0, -1.0, 1.0)[:, None] * normals
    centre = places + mean
    flat = places - np.einsum("pi,pi->p", places - centre, normals)[:, None] * normals
    flat[total <= 1e-12] = places[total <= 1e-12]
    number = np.bincount(owner, minlength=count)
    return flat, normals, np.sqrt(np.maximum(values[:, 0], 0.0)), np.abs(outside) > 0.3 * total, total, number
