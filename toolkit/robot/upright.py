"""Whether the shapes of a model that nobody has described yet stand or lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.geometry.pose import Pose
from toolkit.robot.draft import compiled
from toolkit.robot.source import ModelSource, read_model

_CLEARLY = 0.5  # of the distance from shapes to centres of mass must be saved by turning them


def read_upright(path: Path) -> ModelSource:
    """A model file without the collision shapes that cannot be read, turned upright where its masses say so.

    A COLLADA file may say that its y axis points up. Most programs do not care, and most models are made for them; the
    others have shapes far from their links' centres of mass unless they are turned.

    Raises:
        RobotError: As `read_model`.
        ValueError: MuJoCo cannot compile the file.
    """
    turned = read_model(path, lenient=True, upright=True)
    if not turned.turned:
        return turned
    source = read_model(path, lenient=True)
    return turned if _astray(turned) < _CLEARLY * _astray(source) else source


def _astray(source: ModelSource) -> float:
    """Sum of mass times distance, kg m, between the links' centres of mass and the boxes around their shapes."""
    model = compiled(source.spec)[0]
    astray = 0.0
    for geom in np.flatnonzero(model.geom_contype | model.geom_conaffinity):
        body, pose = model.geom_bodyid[geom], Pose.from_quaternion(model.geom_pos[geom], model.geom_quat[geom])
        local = pose.rotation.T @ (model.body_ipos[body] - pose.position)
        centre, half = model.geom_aabb[geom].reshape(2, 3)
        outside = np.maximum(np.abs(local - centre) - half, 0.0)
        astray += float(model.body_mass[body]) * float(np.linalg.norm(outside))
    return astray
