"""The layout in which the viewer opens a recording."""

from __future__ import annotations

import mujoco
import numpy as np
import rerun.blueprint as rrb

from toolkit.report.motion_scene import TIMELINE
from toolkit.report.views import ahead_of, best_direction


def blueprint(
    model: mujoco.MjModel, way: np.ndarray, *, executed: bool, momenta: bool, searched: bool = True
) -> rrb.Blueprint:
    """A large 3D view with the contact lanes below it on the left; curves in tabs and the text on the right.

    Args:
        model: The world alone; the camera is on the side where it hides least.
        way: (k, 3) m, k >= 2; points on the ground from start to goal.
        executed: Whether there are measured curves.
        momenta: Whether there are planned or measured momenta.
        searched: Whether there is a search to show.
    """
    scene = rrb.Spatial3DView(
        origin="world",
        name="Scene",
        eye_controls=_eye(model, way),
        overrides={"world/search": rrb.EntityBehavior(visible=False)},
        line_grid=False,
    )
    lanes = rrb.StateTimelineView(origin="contacts", name="Contacts, planned and measured")
    tabs = []
    if executed:
        errors = _curves("tracking", "Tracking error [mm]"), _curves("slip", "Slip of each stance [mm]")
        tabs.append(rrb.Vertical(*errors, name="Tracking"))
    if momenta:
        linear = _curves("linear_momentum", "Linear momentum [N s]")
        tabs.append(rrb.Vertical(linear, _curves("angular_momentum", "Angular momentum [N m s]"), name="Momenta"))
    if executed:
        contacts = _curves("cop_margin", "CoP to the edge [mm]"), _curves("force", "Contact force [N]")
        tabs.append(rrb.Vertical(*contacts, name="Contacts"))
        tabs.append(rrb.Vertical(_curves("torque_ratio", "Largest torque / limit"), name="Torques"))
    if searched:
        bars = rrb.BarChartView(origin="search/best_cost", name="Cost of the best solution over the search's seconds")
        solutions = rrb.TextDocumentView(origin="search/solutions", name="Solutions")
        tabs.append(rrb.Vertical(bars, solutions, name="Search"))
    text = rrb.TextDocumentView(origin="summary", name="Verdict")
    right = rrb.Vertical(rrb.Tabs(*tabs, active_tab=0), text, row_shares=[3, 2])
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(scene, lanes, row_shares=[7, 2]), right, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        auto_views=False,
    )


def _curves(entity: str, name: str) -> rrb.TimeSeriesView:
    """One view of curves."""
    return rrb.TimeSeriesView(origin=f"series/{entity}", name=name, plot_legend=rrb.PlotLegend(visible=True))


def _eye(model: mujoco.MjModel, way: np.ndarray) -> rrb.EyeControls3D:
    """A camera that sees the whole way, from the side where the world hides least."""
    ahead, length = ahead_of(way)
    heading = float(np.arctan2(ahead[1], ahead[0]))
    middle = (way.min(0) + way.max(0)) / 2 + [0.0, 0.0, 0.7]
    distance = 2.3 + 0.75 * length
    seen = np.concatenate([way + [0.0, 0.0, 0.9], way + [0.0, 0.0, 0.1]])
    direction = best_direction(model, seen, middle, heading, distance, (22.0, 40.0, 60.0))
    return rrb.EyeControls3D(position=middle + distance * direction, look_target=middle, eye_up=(0.0, 0.0, 1.0))
