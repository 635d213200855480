"""A recording in which several runs are shown together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from toolkit.drafts import write_whole
from toolkit.errors import InputError
from toolkit.execution.result import Execution
from toolkit.report.colors import RUNS, Color
from toolkit.report.comparison import Comparison, as_markdown, momentum_rates
from toolkit.report.draw import draw_goal, draw_scene, recording
from toolkit.report.meshes import static_bodies
from toolkit.report.motion_scene import TIMELINE, draw_com, draw_motion, frames
from toolkit.report.saved_run import SavedRun
from toolkit.report.series import plot, thinned
from toolkit.report.views import ahead_of

APPLICATION = "comparison of runs"
RATE = 30.0  # Hz of everything drawn in 3D
GAP = 0.6  # m between scenes that stand side by side
MARGIN = 1.0  # m of floor that is drawn beyond a run's way
LARGEST = 8.0  # m; a scene that is wider is cut to this for its place beside the others
CURVES = {
    "com_error": "CoM off its plan [mm]",
    "com_height": "Height of the CoM [m]",
    "torque": "Largest torque / limit",
    "linear_rate": "Rate of the linear momentum [N]",
    "angular_rate": "Rate of the angular momentum [N m]",
    "palms": "Force on the palms [N]",
}
"""Entity and title of each curve that is drawn for every run."""


def write_comparison_recording(path: Path, comparison: Comparison, runs: Sequence[SavedRun]) -> None:
    """Write a recording of runs: side by side, their CoM paths in one scene, their curves, and the tables.

    Args:
        path: File to write; it appears whole or not at all.
        comparison: The figures of these runs.
        runs: The runs. Those that were not executed are in the tables alone.

    Raises:
        InputError: None of the runs was executed, or the file cannot be written.
    """
    shown = [
        (label, run.execution, RUNS[index % len(RUNS)])
        for index, (label, run) in enumerate(zip(comparison.labels, runs, strict=True))
        if run.execution is not None
    ]
    if not shown:
        raise InputError("none of these runs was executed; there is nothing to show in a recording")
    places = _places([execution for _, execution, _ in shown])
    with recording(path, APPLICATION, " and ".join(comparison.labels), write_whole) as stream:
        stream.send_blueprint(_blueprint([execution for _, execution, _ in shown], places))
        text = rr.TextDocument(as_markdown(comparison), media_type=rr.MediaType.MARKDOWN)
        stream.log("tables", text, static=True)
        for root in ("side", "together"):
            stream.log(root, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        draw_scene(stream, shown[0][1].scene, "together")
        draw_goal(stream, shown[0][1].standard.goal, "together")
        for index, (label, execution, color) in enumerate(shown):
            _draw_run(stream, index, label, execution, color, places[index])
            _plot_run(stream, index, label, execution, color)


def _draw_run(
    stream: rr.RecordingStream, index: int, label: str, execution: Execution, color: Color, place: _Place
) -> None:
    """Draw one run in its place beside the others, and its CoM in the common scene."""
    root, samples = f"side/run_{index + 1}", execution.samples
    rows = frames(samples.tick_times, RATE)
    times, com = samples.tick_times[rows], samples.com[rows]
    stream.log(root, rr.Transform3D(translation=place.shift), static=True)
    draw_scene(stream, execution.scene, root, place.floor)
    draw_goal(stream, execution.standard.goal, root)
    draw_motion(stream, execution.scene, times, samples.qpos[rows], root)
    draw_com(stream, "executed", color, com, times, root=root)
    name = rr.Points3D([com[0] + [0.0, 0.0, 1.1]], radii=0.0, colors=color, labels=[label], show_labels=True)
    stream.log(f"{root}/name", name, static=True)
    draw_com(stream, f"run_{index + 1}", color, com, times, root="together")
    end = rr.Points3D([com[-1]], radii=0.02, colors=color, labels=[label], show_labels=True)
    stream.log(f"together/com/run_{index + 1}/end", end, static=True)


def _plot_run(stream: rr.RecordingStream, index: int, label: str, execution: Execution, color: Color) -> None:
    """Send the curves of one run."""
    samples, rates = execution.samples, momentum_rates(execution)
    values = {
        "com_error": 1e3 * np.linalg.norm(samples.com - samples.com_planned, axis=1),
        "com_height": samples.com[:, 2],
        "torque": samples.torque_ratio,
        "linear_rate": np.linalg.norm(rates[:, :3], axis=1),
        "angular_rate": np.linalg.norm(rates[:, 3:], axis=1),
        "palms": np.linalg.norm(samples.wrench[:, 2:, :3], axis=-1).sum(1),
    }
    for name in CURVES:
        curve = thinned(samples.tick_times, values[name], worst="max")
        plot(stream, f"curves/{name}/run_{index + 1}", *curve, label, color)


class _Place(NamedTuple):
    """Where a run is drawn: how far it is moved (3,), and the corners (4, 2) of its floor before that, in m."""

    shift: np.ndarray
    floor: np.ndarray


def _places(executions: Sequence[Execution]) -> list[_Place]:
    """A place for each run, one beside the other at a right angle to the way of the first one."""
    ahead, _ = ahead_of(_way(executions[0]))
    aside = np.array([ahead[1], -ahead[0]])
    places, end = [], 0.0
    for execution in executions:
        low, high = _extent(execution, aside)
        along = _way(execution)[:, :2] @ ahead
        near, far = along.min() - MARGIN, along.max() + MARGIN
        corners = np.array([near * ahead + low * aside, far * ahead + low * aside])
        floor = np.vstack([corners, corners[::-1] + (high - low) * aside])
        shift = end - low if places else 0.0
        places.append(_Place(np.append(shift * aside, 0.0), floor[::-1]))
        end = shift + high + GAP
    return places


def _extent(execution: Execution, aside: np.ndarray) -> tuple[float, float]:
    """From where to where a scene and a robot's CoM reach along a direction (2,), in m; infinite planes left out."""
    model, data = execution.scene, mujoco.MjData(execution.scene)
    mujoco.mj_kinematics(model, data)
    along = execution.samples.com[:, :2] @ aside
    low, high = [float(along.min()) - MARGIN], [float(along.max()) + MARGIN]
    for geom in np.flatnonzero(static_bodies(model)[model.geom_bodyid] & (model.geom_rbound > 0)):
        rotation, half = data.geom_xmat[geom].reshape(3, 3)[:2], model.geom_aabb[geom, 3:]
        centre = float((data.geom_xpos[geom][:2] + rotation @ model.geom_aabb[geom, :3]) @ aside)
        reach = float(np.abs(rotation.T @ aside) @ half)
        low.append(centre - reach)
        high.append(centre + reach)
    middle = float(along.mean())
    return max(min(low), middle - LARGEST / 2), min(max(high), middle + LARGEST / 2)


def _way(execution: Execution) -> np.ndarray:
    """(k, 3) m; the CoM's path, and the goal at its height."""
    com = execution.samples.com
    return np.vstack([com, [*execution.standard.goal.position[:2], com[-1, 2]]])


def _blueprint(executions: Sequence[Execution], places: Sequence[_Place]) -> rrb.Blueprint:
    """The layout: both scenes in tabs on the left, curves in tabs and the tables on the right."""
    ways = [_way(execution) for execution in executions]
    moved = np.vstack([way + place.shift for way, place in zip(ways, places, strict=True)])
    beside = rrb.Spatial3DView(origin="side", name="Side by side", eye_controls=_eye(ways[0], moved), line_grid=False)
    eye = _eye(ways[0], np.vstack(ways))
    together = rrb.Spatial3DView(origin="together", name="CoM paths in one scene", eye_controls=eye, line_grid=False)
    views = [
        rrb.TimeSeriesView(origin=f"curves/{name}", name=title, plot_legend=rrb.PlotLegend(visible=True))
        for name, title in CURVES.items()
    ]
    pairs = [rrb.Vertical(*views[i : i + 2], name=tab) for i, tab in ((0, "CoM"), (2, "Torque, momentum"), (4, "More"))]
    tables = rrb.TextDocumentView(origin="tables", name="Tables")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Tabs(beside, together, active_tab=0),
            rrb.Vertical(rrb.Tabs(*pairs, active_tab=0), tables, row_shares=[1, 1]),
            column_shares=[3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        auto_views=False,
    )


def _eye(way: np.ndarray, seen: np.ndarray) -> rrb.EyeControls3D:
    """A camera ahead of the first run's way, to its left and above, that sees all of (k, 3) m."""
    (x, y), _ = ahead_of(way)
    middle, size = (seen.min(0) + seen.max(0)) / 2, float(np.linalg.norm(np.ptp(seen[:, :2], axis=0)))
    direction = np.array([0.8 * x - 0.35 * y, 0.8 * y + 0.35 * x, 0.6])
    return rrb.EyeControls3D(
        position=middle + (2.2 + 0.85 * size) * direction, look_target=middle - [0.0, 0.0, 0.3], eye_up=(0.0, 0.0, 1.0)
    )
