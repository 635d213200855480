"""The paper's drawings that need no run: transition models, networks, and sums of predictions from other results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from toolkit.contacts.transition_model import palm_rays, steps_38, steps_60
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.prediction.network import Perceptron, TransitionNetwork
from toolkit.report.colors import LIMB_COLORS, PALM_SURFACE, unit
from toolkit.robot.model import RobotModel
from validation.sequence_objective import Relation, draw_relation

_OUTPUTS = ("feasible or not\n(softmax)", "log of objective (ReLU)\nchange of CoM, velocity (linear)")


def draw_models(robot: RobotModel, path: Path) -> None:
    """The steps of data collection and of experiments, and the rays of a palm."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    first, second, third = figure.subplots(1, 3)
    for axes, steps in ((first, steps_38()), (second, steps_60())):
        _draw_steps(axes, robot, steps)
        axes.set(title=f"{len(steps)} steps of the left foot", xlabel="y [m]", ylabel="x [m]", aspect="equal")
    rays = palm_rays()
    third.scatter(rays[:, 0] / rays[:, 1], rays[:, 2] / rays[:, 1], color=unit(PALM_SURFACE))
    third.set(title=f"{len(rays)} rays from the left shoulder to a wall", aspect="equal")
    third.set(xlabel="forwards / distance of the wall", ylabel="up / distance of the wall")
    _save(figure, path)


def _draw_steps(axes: Any, robot: RobotModel, steps: np.ndarray) -> None:
    half = robot.half_sizes[Limb.LEFT_FOOT]
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half
    for x, y, yaw in [*steps, (0.0, 0.0, 0.0)]:
        limb = Limb.RIGHT_FOOT if (x, y) == (0.0, 0.0) else Limb.LEFT_FOOT
        outline = corners @ rotation_about_z(yaw)[:2, :2].T + [x, y]
        color = unit(LIMB_COLORS[limb])
        axes.add_patch(Polygon(outline[:, ::-1], facecolor=(*color, 0.06), edgecolor=(*color, 0.7), lw=0.8))
    axes.set(xlim=(0.6, -0.2), ylim=(-0.45, 0.65))


def draw_networks(network: TransitionNetwork, path: Path) -> None:
    """Layers of the classifier and of the regressor of a category, as they are loaded."""
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    titles = ("classifier", "regressor")
    parts = (network.classifier, network.regressor)
    for axes, title, part, outputs in zip(figure.subplots(1, 2), titles, parts, _OUTPUTS, strict=True):
        _draw_layers(axes, part, outputs)
        axes.set_title(f"{title} of category {int(network.category) + 1} ({network.category.words})", fontsize=9)
    _save(figure, path)


def _draw_layers(axes: Any, part: Perceptron, outputs: str) -> None:
    widths = [part.weights[0].shape[0], *(weight.shape[1] for weight in part.weights)]
    tallest = max(widths)
    for index, width in enumerate(widths):
        height = 0.15 + 0.85 * width / tallest
        axes.add_patch(Polygon([(index, -height), (index + 0.5, -height), (index + 0.5, height), (index, height)],
                               facecolor="0.85", edgecolor="0.3"))  # fmt: skip
        last = index == len(widths) - 1
        words = "inputs" if index == 0 else outputs if last else "ReLU"
        axes.text(index + 0.25, 0.0, str(width), ha="center", va="center", fontsize=9)
        axes.text(index + 0.25, -1.1, words, ha="center", va="top", fontsize=7)
        if not last:
            axes.annotate("", (index + 1, 0), (index + 0.5, 0), arrowprops={"arrowstyle": "->", "color": "0.3"})
    axes.set(xlim=(-0.3, len(widths)), ylim=(-1.6, 1.1))
    axes.axis("off")


def draw_sums(calibration: dict[str, Any], path: Path) -> Relation:
    """Sums of predictions against objectives of whole sequences, of the learned planner's searches."""
    judged, actual, worlds, infeasible = [], [], [], 0
    for group in calibration["sequences"]:
        if group["planner"] != "learned":
            continue
        for predicted, objective in zip(group["judged"], group["objective"], strict=True):
            if predicted is None or objective is None:
                infeasible += 1
                continue
            judged.append(predicted)
            actual.append(objective)
            worlds.append(group["kind"])
    relation = Relation(np.array(judged), np.array(actual), tuple(worlds), infeasible)
    draw_relation(relation, path)
    return relation


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure).print_figure(str(path), dpi=110)
