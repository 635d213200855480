"""The layout in which the viewer opens a recording."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb

from toolkit.report.motion_scene import TIMELINE


def blueprint(start: np.ndarray, goal: np.ndarray, *, executed: bool, searched: bool) -> rrb.Blueprint:
    """Big 3D view with the contact lanes below it on the left; curves in tabs and the text on the right.

    Args:
        start: (3,) m and
        goal: (3,) m: what the camera should have in view.
        executed: whether there are measured curves.
        searched: whether there is a search to show.

    Returns:
        The blueprint, on the run's timeline, playing.
    """
    scene = rrb.Spatial3DView(
        origin="world",
        name="Scene",
        eye_controls=_eye(start, goal),
        overrides={"world/search": rrb.EntityBehavior(visible=False)},
        line_grid=False,
    )
    lanes = rrb.StateTimelineView(origin="contacts", name="Contacts, planned and measured")
    momenta = [
        _curves("linear_momentum", "Linear momentum [N s]"),
        _curves("angular_momentum", "Angular momentum [N m s]"),
    ]
    if executed:
        tabs = [
            rrb.Vertical(
                _curves("tracking", "Tracking error [mm]"), _curves("slip", "Slip of each stance [mm]"), name="Tracking"
            ),
            rrb.Vertical(*momenta, name="Momenta"),
            rrb.Vertical(
                _curves("cop_margin", "CoP to the edge [mm]"), _curves("force", "Contact force [N]"), name="Contacts"
            ),
            rrb.Vertical(_curves("torque_ratio", "Largest torque / limit"), name="Torques"),
        ]
    else:
        tabs = [rrb.Vertical(*momenta, name="Momenta")]
    if searched:
        bars = rrb.BarChartView(origin="search/best_cost", name="Cost of the best solution over the search's seconds")
        solutions = rrb.TextDocumentView(origin="search/solutions", name="Solutions")
        tabs.append(rrb.Vertical(bars, solutions, name="Search"))
    right = rrb.Vertical(
        rrb.Tabs(*tabs, active_tab=0), rrb.TextDocumentView(origin="summary", name="Verdict"), row_shares=[3, 2]
    )
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


def _eye(start: np.ndarray, goal: np.ndarray) -> rrb.EyeControls3D:
    """A camera to the right of the way from start to goal that has both in view."""
    way = np.array(goal[:2]) - start[:2]
    length = float(np.linalg.norm(way))
    ahead = way / length if length > 0.1 else np.array([1.0, 0.0])
    side = np.array([ahead[1], -ahead[0]])
    middle = np.array([*(start[:2] + goal[:2]) / 2, (start[2] + goal[2]) / 2 + 0.7])
    distance = 2.3 + 0.75 * length
    position = middle + distance * np.array([*(0.8 * side + 0.45 * ahead), 0.38])
    return rrb.EyeControls3D(position=position, look_target=middle, eye_up=(0.0, 0.0, 1.0))
