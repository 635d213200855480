"""Time of a network query, for tables."""

from __future__ import annotations

import time

import numpy as np

from toolkit.prediction.network import TransitionNetwork


def query_seconds(network: TransitionNetwork, batch: int, *, repeats: int = 200) -> float:
    """Median seconds of judging a batch: feasibility, objective and CoM state of every transition in it."""
    features = np.random.default_rng(0).uniform(network.lower, network.upper, (batch, len(network.lower)))
    features = features.astype(np.float32)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        network.feasible(features)
        network.predict(features)
        times.append(time.perf_counter() - start)
    return float(np.median(times))
