"""A picture of each family: its parameters against the outcome."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from toolkit.drafts import write_whole
from validation.jobs import ERROR, Record
from validation.map_families import Axis, Family
from validation.map_trial import FAILURES, IMPOSSIBLE, NO_SEQUENCE, OUTCOMES, PASS

_LOOKS = {
    PASS: ("o", "#2a9d4a"),
    FAILURES["start"]: ("v", "#8a5a2b"),
    FAILURES["dynamics"]: ("^", "#8e44ad"),
    FAILURES["wholebody"]: ("s", "#e08a00"),
    FAILURES["execution"]: ("D", "#d62f2f"),
    NO_SEQUENCE: ("P", "#2f6fd6"),
    IMPOSSIBLE: ("x", "#888888"),
    ERROR: ("*", "#000000"),
}
"""Marker and colour of each outcome."""
_SMALL = 6  # points; letters of reasons
_APART = 0.012  # of the range of an axis; between seeds of a drawn family's world


def draw_map(path: Path, family: Family, records: Sequence[Record]) -> None:
    """Write the picture of a family as PNG: one row a seed where it has one parameter, else a plane of two.

    Raises:
        InputError: It cannot be written.
    """
    single = len(family.axes) == 1
    figure = Figure(figsize=(11, 4.2) if single else (11, 7.5), layout="constrained")
    axes = figure.subplots()
    (_draw_line if single else _draw_plane)(axes, family, records)
    counts = Counter(record["outcome"] for record in records)
    for outcome in OUTCOMES:
        if counts[outcome]:
            marker, color = _LOOKS[outcome]
            label = f"{outcome} ({counts[outcome]})"
            axes.scatter([], [], marker=marker, color=color, label=label)
    axes.set_title(family.name.replace("_", " "))
    figure.legend(loc="outside right upper", fontsize=8)
    content = io.BytesIO()
    FigureCanvasAgg(figure).print_figure(content, dpi=110)
    write_whole(path, content.getvalue(), "--results")


def _draw_line(axes: Axes, family: Family, records: Sequence[Record]) -> None:
    """The parameter against the seeds, reasons above each value."""
    (axis,) = family.axes
    seeds = sorted({record["seed"] for record in records})
    for record in records:
        marker, color = _LOOKS[record["outcome"]]
        axes.scatter(record["values"][0], seeds.index(record["seed"]), marker=marker, color=color)
    for value in sorted({record["values"][0] for record in records}):
        shorts = Counter(r["short"] for r in records if r["values"][0] == value and not r["passed"])
        text = "\n".join(shorts)
        axes.text(value, len(seeds) - 0.6, text, rotation=90, fontsize=_SMALL, ha="center", va="bottom")
    axes.set_yticks(range(len(seeds)), [f"seed {seed}" for seed in seeds])
    axes.set_ylim(-0.6, len(seeds) + 3.0)
    axes.set_xlabel(axis.label)
    axes.set_xlim(_ends(axis))


def _draw_plane(axes: Axes, family: Family, records: Sequence[Record]) -> None:
    """One parameter against the other, seeds side by side, reasons below each world."""
    first, second = family.axes
    step = _APART * abs(first.hard - first.easy)
    seeds = sorted({record["seed"] for record in records})
    for record in records:
        marker, color = _LOOKS[record["outcome"]]
        x = record["values"][0] + step * (seeds.index(record["seed"]) - (len(seeds) - 1) / 2)
        axes.scatter(x, record["values"][1], marker=marker, color=color)
    for x, y in sorted({tuple(record["values"]) for record in records}):
        shorts = Counter(r["short"] for r in records if tuple(r["values"]) == (x, y) and not r["passed"])
        text = "\n".join(shorts)
        axes.annotate(text, (x, y), (0, -6), textcoords="offset points", fontsize=_SMALL, ha="center", va="top")
    axes.set_xlabel(first.label)
    axes.set_ylabel(second.label)
    axes.set_xlim(_ends(first))
    axes.set_ylim(_ends(second))


def _ends(axis: Axis) -> tuple[float, float]:
    """Ends of a drawn axis, which leads from the easy end, left or below, to the hard one."""
    room = 0.07 * (axis.hard - axis.easy)
    return axis.easy - room, axis.hard + room
