"""Pairs of geoms that are near each other, as MuJoCo finds them and where it does not."""

from __future__ import annotations

from typing import NamedTuple, Self

import mujoco
import numpy as np


class NearPairs(NamedTuple):
    """Pairs of geoms near each other.

    Attributes:
        geoms: (k, 2) int; the first and the second of each.
        distance: (k,) m.
        normal: (k, 3) from the first to the second.
        point: (k, 3) m; between the two.
    """

    geoms: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    point: np.ndarray

    def of(self, chosen: np.ndarray) -> Self:
        """The chosen ones."""
        return type(self)(*(each[chosen] for each in self))

    def joined(self, others: NearPairs) -> Self:
        """These and others."""
        return type(self)(*(np.concatenate(each) for each in zip(self, others, strict=True)))


_NONE = NearPairs(np.zeros((0, 2), int), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


def set_notice(model: mujoco.MjModel, notice: np.ndarray) -> None:
    """Let collisions of a model report pairs as far apart as the notices (ngeom,) in m of their geoms."""
    model.geom_gap[:] = 0.0
    model.geom_margin[:] = notice
    model.body_margin[:] = 0.0
    np.maximum.at(model.body_margin, model.geom_bodyid, model.geom_margin)  # where collisions are looked for at all


def near_boxes(
    model: mujoco.MjModel, data: mujoco.MjData, boxes: np.ndarray, reach: np.ndarray, notice: np.ndarray
) -> NearPairs:
    """Those of pairs of boxes (k, 2) that are within their notice.

    MuJoCo's collision function finds boxes that are apart only if two faces are opposite.

    Args:
        model: The model.
        data: Its posture.
        boxes: (k, 2) int.
        reach: (k,) m; distances of their centres, beyond which they are not near (see `reach_of`).
        notice: (k,) m.
    """
    first, second = boxes.T
    rows = np.flatnonzero(np.linalg.norm(data.geom_xpos[first] - data.geom_xpos[second], axis=1) < reach)
    if not len(rows):
        return _NONE
    geoms, distance, ends = boxes[rows], np.empty(len(rows)), np.empty((len(rows), 6))
    for row, (a, b) in enumerate(geoms.tolist()):
        distance[row] = mujoco.mj_geomDistance(model, data, a, b, float(notice[rows[row]]), ends[row])
    found = (distance < notice[rows]) & (np.abs(distance) > 1e-9)
    geoms, distance, ends = geoms[found], distance[found], ends[found]
    normal = (ends[:, 3:] - ends[:, :3]) / distance[:, None]
    return NearPairs(geoms, distance, normal, 0.5 * (ends[:, :3] + ends[:, 3:]))


def reach_of(model: mujoco.MjModel, boxes: np.ndarray, notice: np.ndarray) -> np.ndarray:
    """(k,) m; distances of the centres of pairs of boxes (k, 2), beyond which they are farther apart than (k,) m."""
    return notice + model.geom_rbound[boxes[:, 0]] + model.geom_rbound[boxes[:, 1]]
