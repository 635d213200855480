"""The measured curves of a run, as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from toolkit.contacts.schedule import ContactSchedule
from toolkit.execution.result import Execution
from toolkit.geometry.limb import Limb
from toolkit.report.colors import AXES, EXECUTED, LIMB_COLORS, LIMIT, OPTIMISED, unit
from toolkit.report.series import slip_steps, thinned


def draw_plots(path: Path, execution: Execution, schedule: ContactSchedule) -> None:
    """Write a picture of six curves over time: CoM, its error, momenta, CoP margins, torque ratio, slip.

    The ending of `path` gives the format (png, pdf, svg). Panels stay empty where a run has no control tick.
    """
    figure = Figure(figsize=(11, 9), layout="constrained")
    panels = figure.subplots(3, 2, sharex=True)
    if len(execution.samples.tick_times):
        _draw(panels, execution, schedule)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    FigureCanvasAgg(figure).print_figure(str(path), dpi=110)


def _draw(panels: np.ndarray, execution: Execution, schedule: ContactSchedule) -> None:
    """Fill the six panels."""
    samples = execution.samples
    times = samples.tick_times
    (com, error), (momentum, margin), (torque, slip) = panels
    origin = samples.com_planned[0]
    for axis, color in enumerate(AXES):
        com.plot(*thinned(times, samples.com_planned[:, axis] - origin[axis]), "--", color=unit(color), lw=1)
        com.plot(*thinned(times, samples.com[:, axis] - origin[axis]), color=unit(color), label="xyz"[axis])
        momentum.plot(*thinned(times, samples.momentum_planned[:, axis]), "--", color=unit(color), lw=1)
        momentum.plot(*thinned(times, samples.momentum[:, axis]), color=unit(color), label="xyz"[axis])
    com.set(title="CoM from the start (planned dashed)", ylabel="[m]")
    momentum.set(title="linear momentum (planned dashed)", ylabel="[N s]")
    distance = 1e3 * np.linalg.norm(samples.com - samples.com_planned, axis=1)
    error.plot(*thinned(times, distance, worst="max"), color=unit(OPTIMISED), label="distance")
    error.set(title=f"CoM error, RMS {1e3 * execution.com_rms_error:.1f} mm", ylabel="[mm]", ylim=(0, None))
    for limb in Limb:
        values = 1e3 * samples.cop_margin[:, limb]
        if np.isfinite(values).any():
            margin.plot(*thinned(times, values, worst="min"), color=unit(LIMB_COLORS[limb]), label=limb.label)
    margin.axhline(0, color=unit(LIMIT), lw=0.8)
    margin.set(title="CoP to the edge of the patch", ylabel="[mm]")
    torque.plot(*thinned(times, samples.torque_ratio, worst="max"), color=unit(EXECUTED), label="largest joint")
    torque.axhline(1, color=unit(LIMIT), lw=0.8, label="limit")
    torque.set(title="torque / limit", ylim=(0, 1.1))
    if execution.slip:
        edges, values = slip_steps(execution, schedule)
        slip.step(edges, 1e3 * values, where="post", color=unit(EXECUTED), label="stance")
    slip.set(title="largest slip of each stance", ylabel="[mm]", ylim=(0, None))
    for axes in panels.flat:
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8, loc="best")
