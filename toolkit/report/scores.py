"""The table of how well the networks predict the optimiser."""

from __future__ import annotations

from collections.abc import Mapping

from rich import box
from rich.table import Table

from toolkit.contacts.category import Category
from toolkit.learning.evaluate import Score


def score_table(scores: Mapping[Category, Score]) -> Table:
    """A row per category: feasibility accuracy, errors of the objective, the final CoM and its velocity."""
    table = Table(box=box.SIMPLE, pad_edge=False)
    table.add_column("category")
    names = ("tested", "feasible", "accuracy", "objective", "its error", "relative", "CoM [mm]", "velocity [mm/s]")
    for name in names:
        table.add_column(name, justify="right")
    for category, score in scores.items():
        table.add_row(
            f"{int(category)} {category.words}",
            str(score.samples),
            f"{100 * score.feasible_share:.1f} %",
            f"{100 * score.accuracy:.1f} %",
            f"{score.mean_objective:.4g}",
            f"{score.objective_error:.3g}",
            f"{100 * score.relative_objective_error:.1f} %",
            f"{1e3 * score.com_error:.1f}",
            f"{1e3 * score.velocity_error:.1f}",
        )
    return table
