"""How a swinging foot gets around the standing one and the leg above it, seen from above."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toolkit.wholebody.swing import SwingPath
from toolkit.wholebody.swing_task import SAMPLES, THICKNESS, StandingLeg, SwingTask

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
STEP, MOST = 0.02, 0.16  # m; the detour grows by STEP until the way is free, at most to MOST


def detour(task: SwingTask, path_of: Callable[[np.ndarray], SwingPath]) -> np.ndarray:
    """(3,) m; horizontal bump that leads a foot around the standing one, zero where the straight way is free.

    `path_of` makes the path with a given bump (3,) in m.
    """
    if task.other is None:
        return np.zeros(3)
    pose, half_size = task.other
    sole = corners(pose.position[None], pose.rotation[None], half_size)[0]
    standing = (sole, sole + task.shin[:2]) if np.any(task.shin) else (sole,)
    u = np.linspace(0.0, 1.0, SAMPLES)

    def gap(bump: np.ndarray) -> tuple[float, float]:
        path = path_of(bump)
        places = path.positions(u)
        moving = corners(places, path.rotations(u), task.half_size)
        apart = np.min([gaps(moving, each) for each in standing], axis=0)
        if task.beside is not None:
            for height in task.scale.length * THICKNESS * np.array([0.0, 0.5, 1.0]):
                apart = np.fmin(apart, _gap_of_leg(task.beside, moving, places[:, 2] + height))
        return float(apart.min()), float(min(apart[0], apart[-1]))

    free, at_ends = gap(np.zeros(3))
    wanted = min(task.gap, at_ends)
    if free >= wanted - 1e-6:
        return np.zeros(3)
    travel = (task.end.position - task.start.position)[:2]
    aside = np.array([-travel[1], travel[0], 0.0])
    length = np.linalg.norm(aside)
    if length < 1e-6:
        return np.zeros(3)
    middle = 0.5 * (task.end.position + task.start.position) - pose.position
    aside *= (1.0 if aside @ middle >= 0.0 else -1.0) / length
    best, best_gap = np.zeros(3), free
    for size in task.scale.length * np.arange(STEP, MOST + 1e-9, STEP):
        reached = gap(size * aside)[0]
        if reached > best_gap:
            best, best_gap = size * aside, reached
        if reached >= wanted - 1e-6:
            break
    return best


def _gap_of_leg(leg: StandingLeg, moving: np.ndarray, height: np.ndarray) -> np.ndarray:
    """(k,) m; separation of convex quadrilaterals `moving` (k, 4, 2) from a leg at heights (k,); NaN where none is."""
    place, radius = leg.at(height)
    square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    return gaps(moving, place[:, None] + radius[:, None, None] * square)


def corners(positions: np.ndarray, rotations: np.ndarray, half_size: np.ndarray) -> np.ndarray:
    """(k, 4, 2) corners of patches seen from above, in order around."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    local = np.concatenate([signs * half_size, np.zeros((4, 1))], 1)
    return (positions[:, None] + np.einsum("kij,cj->kci", rotations, local))[..., :2]


def gaps(moving: np.ndarray, standing: np.ndarray) -> np.ndarray:
    """(k,) m; largest separation of convex quadrilaterals along any edge normal, negative where they overlap.

    Corners in m, in order around: `moving` (k, 4, 2) and `standing` (4, 2) or (k, 4, 2).
    """
    standing = np.broadcast_to(standing, moving.shape)
    gaps = np.full(len(moving), -np.inf)
    for shape in (moving, standing):
        edges = np.roll(shape, -1, axis=1) - shape
        normals = np.stack([edges[..., 1], -edges[..., 0]], -1)
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
        first = np.einsum("kni,kci->knc", normals, moving)
        second = np.einsum("kni,kci->knc", normals, standing)
        apart = np.maximum(first.min(-1) - second.max(-1), second.min(-1) - first.max(-1))
        gaps = np.maximum(gaps, apart.max(-1))
    return gaps
