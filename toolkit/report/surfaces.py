"""The surfaces extracted from a world, as a table and as a recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rich import box
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from toolkit.drafts import write_whole
from toolkit.report.colors import FOOT_SURFACE, PALM_SURFACE, START
from toolkit.report.draw import draw_goal, draw_scene, draw_surfaces, recording
from toolkit.report.views import ahead_of
from toolkit.world.world import World


def surface_table(world: World) -> Table:
    """A row per surface: index, geom, position, area, angle, friction, how far it bears, pieces, feet or palms."""
    feet = sum(surface.serves_foot for surface in world.surfaces)
    palms = sum(surface.serves_palm for surface in world.surfaces)
    title = f"{escape(world.name)}: {len(world.surfaces)} surfaces, {feet} for feet, {palms} for palms"
    table = Table(box=box.SIMPLE, pad_edge=False, title=title, title_justify="left")
    names = ("index", "geom", "x, y, z, m", "area, m²", "from up, deg", "friction", "bears, mm", "pieces", "serves")
    for name in names:
        table.add_column(name, justify="left" if name in ("geom", "serves") else "right")
    for surface in world.surfaces:
        serves = [name for name, yes in (("foot", surface.serves_foot), ("palm", surface.serves_palm)) if yes]
        table.add_row(
            str(surface.index),
            Text(surface.geom),
            " ".join(f"{value:.2f}" for value in np.round(surface.pose.position, 2) + 0.0),
            f"{surface.region.area:.4f}",
            f"{np.degrees(np.arccos(np.clip(surface.normal[2], -1, 1))):.1f}",
            f"{surface.friction:g}",
            f"{1e3 * surface.bearing:.0f}" if np.isfinite(surface.bearing) else "all",
            str(len(surface.pieces)),
            ", ".join(serves),
        )
    return table


def write_surface_recording(
    path: Path, world: World, also: Callable[[rr.RecordingStream], None] = lambda stream: None
) -> None:
    """Write a recording of a world's geoms with its surfaces, their outlines and normals, the start and the goal.

    Args:
        path: file to write; it appears whole or not at all.
        world: the world.
        also: draws what is to be seen beside them.

    Raises:
        InputError: it cannot be written.
    """
    with recording(path, "contact surfaces", world.name, write_whole) as stream:
        scene = rrb.Spatial3DView(
            origin="world",
            name="Surfaces: blue for feet, amber for palms",
            eye_controls=_eye(world),
            line_grid=False,
        )
        panels = (rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"))
        stream.send_blueprint(rrb.Blueprint(scene, *panels, rrb.TimePanel(state="hidden"), auto_views=False))
        draw_scene(stream, world.mujoco_model)
        draw_surfaces(stream, world.surfaces, alpha=140)
        draw_goal(stream, world.goal)
        for name, color in (("foot", FOOT_SURFACE), ("palm", PALM_SURFACE)):
            group = [s for s in world.surfaces if (s.serves_foot if name == "foot" else not s.serves_foot)]
            arrows = rr.Arrows3D(
                origins=[surface.pose.position for surface in group],
                vectors=[0.12 * surface.normal for surface in group],
                colors=color,
                radii=0.006,
                labels=[str(surface.index) for surface in group],
                show_labels=len(world.surfaces) <= 40,
            )
            stream.log(f"world/surfaces/{name}/normals", arrows, static=True)
        heading = rr.Arrows3D(
            origins=[world.start.position + [0.0, 0.0, 0.02]],
            vectors=[0.3 * world.start.rotation[:, 0]],
            colors=START,
            radii=0.01,
            labels=["start"],
        )
        stream.log("world/start", heading, static=True)
        also(stream)


def _eye(world: World) -> rrb.EyeControls3D:
    """A camera above and to the right of the way from start to goal."""
    start, goal = world.start.position, world.goal.position
    middle, (ahead, length) = (start + goal) / 2, ahead_of(np.array([start, goal]))
    side = np.array([ahead[1], -ahead[0]])
    position = middle + (2.0 + 0.7 * length) * np.array([*(0.7 * side - 0.4 * ahead), 0.7])
    return rrb.EyeControls3D(position=position, look_target=middle, eye_up=(0.0, 0.0, 1.0))
