"""Learning curves as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from toolkit.contacts.category import Category
from toolkit.report.colors import EXECUTED, OPTIMISED, unit

Losses = tuple[Sequence[float], Sequence[float]]


def draw_curves(curves: Mapping[Category, Mapping[str, Losses]], path: Path) -> None:
    """Write a picture of learning curves: a row per category, a column per network.

    Each network has its losses per epoch on the training and on the validation set. The weights of the epoch with the
    lowest validation loss were kept. The ending of `path` gives the format (png, pdf, svg).
    """
    columns = sorted({name for networks in curves.values() for name in networks})
    rows = max(len(curves), 1)
    figure = Figure(figsize=(4.5 * max(len(columns), 1), 2.0 * rows + 0.4), layout="constrained")
    panels = figure.subplots(rows, max(len(columns), 1), squeeze=False)
    for row, (category, networks) in enumerate(curves.items()):
        for column, name in enumerate(columns):
            axes = panels[row, column]
            axes.set_title(f"{int(category)} {category.words}: {name}", fontsize=8)
            if name in networks:
                _draw(axes, networks[name])
    for axes in panels[-1]:
        axes.set_xlabel("epoch", fontsize=8)
    FigureCanvasAgg(figure).print_figure(str(path), dpi=100)


def _draw(axes, losses: Losses) -> None:
    """Draw one panel."""
    training, validation = losses
    axes.semilogy(training, color=unit(OPTIMISED), label="training")
    axes.semilogy(validation, color=unit(EXECUTED), label="validation")
    axes.axvline(int(np.argmin(validation)), color="0.5", lw=0.8, ls="--", label="kept")
    axes.grid(alpha=0.3)
    axes.yaxis.set_minor_locator(LogLocator(subs=(2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.tick_params(which="both", labelsize=7)
    axes.legend(fontsize=7)
