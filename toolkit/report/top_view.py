"""A picture of a plan seen from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, PathPatch, Polygon
from matplotlib.path import Path as Outline

from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Contact
from toolkit.report.colors import (
    EXECUTED,
    FOOT_SURFACE,
    GOAL,
    LIMB_COLORS,
    OPTIMISED,
    OTHER_SURFACE,
    PALM_SURFACE,
    PREDICTED,
    START,
    unit,
)
from toolkit.search.result import Solution
from toolkit.world.surface import Surface
from toolkit.world.world import World

BORDER = 0.4  # m shown around everything


def draw_top_view(path: Path, plan: MotionPlan, solution: Solution, executed: np.ndarray | None = None) -> None:
    """Write a picture of a plan from above: surfaces, numbered contacts, the CoM, start and goal; axes in metres.

    Args:
        path: The file; its ending gives the format (png, pdf, svg).
        plan: Contacts, world, and optimised CoM, which is left out where it is not feasible.
        solution: The search's solution, for the predicted CoM and the cost.
        executed: (C, 3) m; measured CoM.
    """
    world, robot = plan.world, plan.robot
    contacts = _numbered(plan.sequence)
    paths = _centres(solution, plan.motion, executed)
    low, high = _extent(world, [contact.pose.position[:2] for contact, _ in contacts])
    width, height = high - low
    scale = min(14.0 / width, 9.0 / height)
    figure = Figure(figsize=(max(width * scale, 4.0) + 1.0, max(height * scale, 2.5) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.set_facecolor("0.97")

    for surface in sorted(world.surfaces, key=lambda item: item.pose.position[2]):
        _draw_surface(axes, surface)
    x, y = world.start.position[:2]
    axes.plot(x, y, marker="o", color=unit(START), zorder=3)
    nose = 0.15 * world.start.rotation[:2, 0]
    axes.annotate("", (x + nose[0], y + nose[1]), (x, y), arrowprops={"arrowstyle": "->", "color": unit(START)})
    centre = (float(world.goal.position[0]), float(world.goal.position[1]))
    axes.add_patch(Circle(centre, world.goal.radius, facecolor="none", edgecolor=unit(GOAL), lw=2.5, zorder=3))
    for contact, number in contacts:
        _draw_contact(axes, contact, robot.half_sizes[contact.limb], number)
    for name, (points, color, style) in paths.items():
        axes.plot(points[:, 0], points[:, 1], style, color=unit(color), lw=1.8, ms=3, label=name, zorder=6)
    limbs = sorted({contact.limb for contact, _ in contacts})
    entries = [
        Line2D([], [], marker="s", ls="", color=unit(LIMB_COLORS[x]), label=x.label.replace("_", " ")) for x in limbs
    ]
    entries += [Line2D([], [], marker="o", ls="", color=unit(START), label="start")]
    entries += [Line2D([], [], marker="o", ls="", mfc="none", mec=unit(GOAL), mew=2, label="goal")]
    entries += [Line2D([], [], color=unit(color), label=f"CoM {name}") for name, (_, color, _) in paths.items()]
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries), frameon=False, fontsize=8)
    count = len(plan.sequence.transitions)
    axes.set_title(f"{robot.name} in {world.name}: {count} transitions, cost {solution.cost:.2f}", fontsize=10)
    FigureCanvasAgg(figure).print_figure(str(path), dpi=130)


def _numbered(sequence: ContactSequence) -> list[tuple[Contact, int]]:
    """All contacts with the numbers of their transitions, 0 for the start."""
    made = [(t.contact, i + 1) for i, t in enumerate(sequence.transitions) if t.contact is not None]
    return [*((contact, 0) for contact in sequence.start.contacts), *made]


def _centres(
    solution: Solution, motion: CentroidalMotion, executed: np.ndarray | None
) -> dict[str, tuple[np.ndarray, tuple[int, int, int], str]]:
    """The known CoM paths by name, with their colours and line styles."""
    paths: dict[str, tuple[np.ndarray, tuple[int, int, int], str]] = {}
    if len(solution.com):
        paths["predicted"] = (solution.com, PREDICTED, "o--")
    if motion.feasible:
        times = np.linspace(0, motion.problem.times[-1], 20 * motion.problem.steps + 1)
        paths["optimised"] = (np.array([motion.sample(float(time))[0] for time in times]), OPTIMISED, "-")
    if executed is not None:
        paths["executed"] = (executed, EXECUTED, ":")
    return paths


def _extent(world: World, points: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Corners (2,), (2,) m of the part shown: start, goal and contacts, with the surfaces near them."""
    goal = world.goal
    around = [world.start.position[:2], goal.position[:2] - goal.radius, goal.position[:2] + goal.radius, *points]
    low, high = np.min(around, axis=0) - BORDER, np.max(around, axis=0) + BORDER
    corners = [surface.rings[0][:, :2] for surface in world.surfaces]
    if corners:
        everything = np.concatenate(corners)
        low = np.maximum(low - 0.3, np.minimum(low, everything.min(0) - 0.1))
        high = np.minimum(high + 0.3, np.maximum(high, everything.max(0) + 0.1))
    return low, high


def _flat(ring: np.ndarray) -> np.ndarray:
    """(k, 3) points of (k, 2) points in the surface frame."""
    return np.concatenate([ring, np.zeros((len(ring), 1))], axis=1)


def _draw_surface(axes, surface: Surface) -> None:
    """Draw a surface with its holes; a steep one appears as a line."""
    color = FOOT_SURFACE if surface.serves_foot else PALM_SURFACE if surface.serves_palm else OTHER_SURFACE
    vertices, codes = [], []
    for ring in surface.rings:
        points = ring[:, :2]
        vertices += [*points, points[0]]
        codes += [Outline.MOVETO, *[Outline.LINETO] * (len(points) - 1), Outline.CLOSEPOLY]
    outline = Outline(np.array(vertices), codes)
    axes.add_patch(PathPatch(outline, facecolor=(*unit(color), 0.18), edgecolor=unit(color), lw=1.0, zorder=1))


def _draw_contact(axes, contact: Contact, half_size: np.ndarray, number: int) -> None:
    """Draw a patch with its number; a patch on a wall appears as a line."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    corners = contact.pose @ _flat(signs * half_size)
    color = unit(LIMB_COLORS[contact.limb])
    shade = 0.25 if number == 0 else 0.6
    axes.add_patch(Polygon(corners[:, :2], facecolor=(*color, shade), edgecolor=color, lw=1.8, zorder=4))
    if number:
        x, y = contact.pose.position[:2] + (0.0 if contact.limb.is_foot else 0.06) * contact.pose.normal[:2]
        axes.text(x, y, str(number), ha="center", va="center", fontsize=8, zorder=7)
