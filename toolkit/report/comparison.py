"""Runs side by side: their figures, and the settings in which they differ."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from toolkit.execution.result import Execution
from toolkit.geometry.limb import Limb
from toolkit.report.saved_run import SavedRun

NOTHING = "-"
"""Stands for a figure that a run does not have."""
_UNCOMPARED = {"pictures", "video", "no_recording", "plan"}
"""Options that change nothing of a run."""


class Figure(NamedTuple):
    """A figure of a run: its name, its unit, and where it comes from.

    The source is a stage and a key of the report with a factor, or a function of the run.
    """

    name: str
    unit: str
    source: tuple[str, str, float] | Callable[[SavedRun], Any]


@dataclass(frozen=True)
class Comparison:
    """Figures of several runs.

    Attributes:
        labels: A short, different name of each run.
        figures: Name, unit and a value for each run; None where a run does not have it.
        settings: Name and a value for each run, of the settings in which the runs differ.
    """

    labels: tuple[str, ...]
    figures: tuple[tuple[str, str, tuple[Any, ...]], ...]
    settings: tuple[tuple[str, tuple[Any, ...]], ...]


def compare(runs: Sequence[SavedRun]) -> Comparison:
    """Set runs side by side, in their order."""
    figures = tuple((name, unit, tuple(_value(run, source) for run in runs)) for name, unit, source in FIGURES)
    kept = [figure for figure in figures if any(value is not None and value != "" for value in figure[2])]
    return Comparison(_labels(runs), tuple(kept), _differing(runs))


def momentum_rates(execution: Execution) -> np.ndarray:
    """(C, 6) N and N m; rates of the linear momentum and of the angular one about the CoM, from the measured contacts.

    They follow from the contact wrenches w_i at r_i: m c'' = sum f_i + m g and k' = sum (r_i - c) x f_i + tau_i.
    """
    samples, scene = execution.samples, execution.scene
    mass = float(scene.body_subtreemass[scene.jnt_bodyid[0]])
    force, moment = samples.wrench[..., :3], samples.wrench[..., 3:]
    lever = np.nan_to_num(samples.limb_pose[..., :3] - samples.com[:, None])
    linear = force.sum(1) + mass * np.array(scene.opt.gravity)
    return np.hstack([linear, (np.cross(lever, force) + moment).sum(1)])


def comparison_table(comparison: Comparison, title: str) -> Table:
    """A row per figure and a column per run, then the settings that differ."""
    table = Table(box=box.SIMPLE, pad_edge=False, title=Text(title), title_justify="left")
    table.add_column("")
    table.add_column("unit")
    for label in comparison.labels:
        table.add_column(Text(label), justify="right", overflow="fold")
    for name, unit, values in comparison.figures:
        table.add_row(name, unit, *(_cell(value) for value in values))
    if comparison.settings:
        table.add_section()
        for name, values in comparison.settings:
            table.add_row(Text(name), Text("setting", style="dim"), *(Text(word(value)) for value in values))
    return table


def as_markdown(comparison: Comparison) -> str:
    """The comparison as Markdown tables."""
    header = ["", "unit", *comparison.labels]
    rows = [[name, unit, *(word(value) for value in values)] for name, unit, values in comparison.figures]
    text = _markdown(header, rows)
    if not comparison.settings:
        return f"{text}\n\nThe settings are the same.\n"
    rows = [[name, *(word(value) for value in values)] for name, values in comparison.settings]
    return f"{text}\n\nSettings that differ:\n\n{_markdown(['', *comparison.labels], rows)}\n"


def as_csv(comparison: Comparison, folders: Sequence[Any]) -> str:
    """The comparison as CSV: a row per run, a column per figure (its unit in brackets) and per setting that differs."""
    names = [f"{name} [{unit}]" if unit else name for name, unit, _ in comparison.figures]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["run", "folder", *names, *(f"setting {name}" for name, _ in comparison.settings)])
    for index, (label, folder) in enumerate(zip(comparison.labels, folders, strict=True)):
        columns = [values for _, _, values in comparison.figures] + [values for _, values in comparison.settings]
        cells = ["" if values[index] is None else values[index] for values in columns]
        writer.writerow([label, str(folder), *cells])
    return stream.getvalue()


def word(value: Any) -> str:
    """A value as a table shows it."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _cell(value: Any) -> Text:
    """A value with the colour of what it says."""
    style = {"PASS": "bold green", "FAIL": "bold red"}.get(value, "") if isinstance(value, str) else ""
    return Text(word(value), style=style)


def _markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table, the first column to the left, the others to the right."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join(
        "| " + " | ".join(" ".join(cell.replace("|", "/").split()) for cell in row) + " |" for row in lines
    )


def _labels(runs: Sequence[SavedRun]) -> tuple[str, ...]:
    """The last part of each folder, and as many before it as tell the runs apart; a number where nothing does."""
    parts = [os.path.abspath(run.folder).split(os.sep) for run in runs]
    for count in range(1, max(map(len, parts)) + 1):
        labels = ["/".join(part[-count:]) for part in parts]
        if len(set(labels)) == len(labels):
            return tuple(labels)
    return tuple(f"{part[-1]} ({index + 1})" for index, part in enumerate(parts))


def _value(run: SavedRun, source: tuple[str, str, float] | Callable[[SavedRun], Any]) -> Any:
    """A figure of one run; None where it does not have it."""
    if callable(source):
        return source(run)
    stage, key, factor = source
    value = run.report.stages[stage][key]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return value if isinstance(value, int) and factor == 1 else factor * value
    return value if isinstance(value, str) else None


def _differing(runs: Sequence[SavedRun]) -> tuple[tuple[str, tuple[Any, ...]], ...]:
    """Settings and versions in which runs differ."""
    settings = [
        {"seed": run.report.seed}
        | {name: value for name, value in run.report.options.items() if name not in _UNCOMPARED}
        | {f"version of {name}": version for name, version in run.report.versions.items()}
        for run in runs
    ]
    names = dict.fromkeys(name for each in settings for name in each)
    rows = ((name, tuple(each.get(name) for each in settings)) for name in names)
    return tuple((name, values) for name, values in rows if any(value != values[0] for value in values))


def _planning_seconds(run: SavedRun) -> float | None:
    """Seconds until there was a joint trajectory."""
    stages = run.report.stages
    found = [stages["planning"]["heuristic_seconds"], *(stages[name]["seconds"] for name in _PLANNED)]
    known = [float(value) for value in found if isinstance(value, (int, float))]
    return sum(known) if known else None


def _mean_rate(part: slice) -> Callable[[SavedRun], float | None]:
    """Mean norm over the run of a part of the momenta's rates."""

    def mean(run: SavedRun) -> float | None:
        if run.execution is None:
            return None
        return float(np.linalg.norm(momentum_rates(run.execution)[:, part], axis=1).mean())

    return mean


def _palm_share(run: SavedRun) -> float | None:
    """Largest force on a palm, over the robot's weight."""
    if run.execution is None:
        return None
    scene, palms = run.execution.scene, [limb for limb in Limb if not limb.is_foot]
    weight = float(scene.body_subtreemass[scene.jnt_bodyid[0]] * np.linalg.norm(scene.opt.gravity))
    return float(np.linalg.norm(run.execution.samples.wrench[:, palms, :3], axis=-1).max()) / weight


_PLANNED = ("planning", "dynamics", "wholebody")
FIGURES = (
    Figure("verdict", "", lambda run: run.report.verdict),
    Figure("reason", "", lambda run: run.report.reason or None),
    Figure("world", "", lambda run: run.report.world),
    Figure("robot", "", lambda run: run.report.robot),
    Figure("transitions", "", ("planning", "contacts", 1)),
    Figure("with a palm", "", ("planning", "palm_contacts", 1)),
    Figure("sequences tested", "", ("planning", "sequences_tested", 1)),
    Figure("first feasible sequence after", "s", ("planning", "first_feasible_seconds", 1.0)),
    Figure("search", "s", ("planning", "seconds", 1.0)),
    Figure("planning in all", "s", _planning_seconds),
    Figure("objective J", "", ("dynamics", "objective", 1.0)),
    Figure("planned friction margin", "", ("dynamics", "min_friction_margin", 1.0)),
    Figure("planned CoP margin", "mm", ("dynamics", "min_cop_margin", 1e3)),
    Figure("simulated", "s", ("execution", "simulated_seconds", 1.0)),
    Figure("distance to the goal", "m", ("execution", "final_goal_distance", 1.0)),
    Figure("largest slip", "mm", ("execution", "max_slip", 1e3)),
    Figure("largest impulse of a scuff", "N s", ("execution", "max_scuff_impulse", 1.0)),
    Figure("CoM error, RMS", "mm", ("execution", "com_rms_error", 1e3)),
    Figure("touchdown error", "mm", ("execution", "max_touchdown_error", 1e3)),
    Figure("torque / limit", "", ("execution", "max_torque_ratio", 1.0)),
    Figure("velocity / limit", "", ("execution", "max_velocity_ratio", 1.0)),
    Figure("rate of linear momentum, mean", "N", _mean_rate(slice(0, 3))),
    Figure("rate of angular momentum, mean", "N m", _mean_rate(slice(3, 6))),
    Figure("largest palm force / weight", "", _palm_share),
    Figure("unplanned contacts", "", ("execution", "unplanned_contacts", 1)),
    Figure("replans that left the plan", "", ("execution", "replan_departures", 1)),
    Figure("control ticks without a solution", "", ("execution", "solver_failures", 1)),
    Figure("real-time factor", "", ("execution", "real_time_factor", 1.0)),
)
"""What runs are compared by, in order."""
