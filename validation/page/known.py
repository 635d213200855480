"""What other results hold already: the categories, the networks, and the calibration of their sums."""

from __future__ import annotations

from typing import Any

import numpy as np

from toolkit.contacts.category import Category
from toolkit.prediction.features import feature_size
from validation.fresh_transitions import DEFAULT
from validation.page.plans import Section
from validation.page.spread import HEADER, Compared, worse_first
from validation.prediction import PAPER
from validation.tables import markdown_table

PAPERS_SIZES = (24, 24, 30, 30, 24, 30, 30, 36, 30, 36)
QUERY = 100.0  # us, the paper's
TRANSITION = 100.0  # ms, the paper's "order of"


def category_section() -> Section:
    """The paper's table of categories."""
    rows = [
        (
            f"{int(category)}",
            ", ".join(limb.label.replace("_", " ") for limb in category.before),
            category.words,
            str(feature_size(category)),
            str(PAPERS_SIZES[category]),
        )
        for category in Category
    ]
    header = ("index", "contacts before", "transition", "inputs, ours", "inputs, the paper")
    note = (
        "Ours has three more inputs for shift, swing and friction, so that one network serves all timings and grounds, "
        "and writes an orientation as two axes in place of three angles, which have no place where they jump. A "
        "regressor has two more, which say where the goal lies."
    )
    content = [dict(zip(header, row, strict=True)) for row in rows]
    return Section("Contact transition categories", f"{markdown_table(header, rows)}\n\n{note}", [], content)


def network_section(prediction: dict[str, Any]) -> Section:
    """The paper's table of the networks, from the results of `validation.prediction`."""
    parts, worse, content = [f"From `prediction.json` of {_taken(prediction)}."], [], {}
    scores = prediction["scores"][DEFAULT]
    for category, figures in PAPER.items():
        row = scores[str(int(category))]
        row = row.get("median", row)
        rows = network_rows(row, figures)
        where = f"category {int(category) + 1}, {category.words}"
        parts += [f"### {where[0].upper()}{where[1:]}", markdown_table(HEADER, (item.cells for item in rows))]
        worse += worse_first(where, rows)
        content[category.words] = [item.record for item in rows]
    queries = prediction["query_microseconds"].values()
    alone = float(np.median([pair[0] for pair in queries]))
    why = "Matrix products in NumPy."
    query = Compared("query of a network [us]", "100", f"{alone:.0f}", alone, QUERY, -1, why)
    parts += [markdown_table(HEADER, [query.cells])]
    return Section("Networks", "\n\n".join(parts), worse + worse_first("networks", [query]), content)


def network_rows(row: dict[str, float], figures: tuple[float, ...]) -> list[Compared]:
    """The five columns of a category: our scores beside the paper's figures."""
    accuracy, objective, error, com, velocity = figures[:5]
    whole = "Ours is of a transition in its whole motion, which what follows decides as well; the paper's, of it alone."
    named = (
        ("accuracy [%]", 100 * row["accuracy"], accuracy, 1, "Infeasible ones of ours are made close to the boundary."),
        ("mean objective", row["mean_objective"], objective, 0, "Another robot, other transitions."),
        ("mean error of the objective", row["objective_error"], error, -1, whole),
        ("final CoM [mm]", 1e3 * row["com_error"], com, -1, whole),
        ("final velocity [mm/s]", 1e3 * row["velocity_error"], velocity, -1, whole),
    )  # fmt: skip
    return [
        Compared(name, f"{published:g}", f"{ours:.4g}", ours, published, better, why)
        for name, ours, published, better, why in named
    ]


def transition_row(centroidal: dict[str, Any]) -> Compared:
    """The time of one transition's optimisation, from the results of `validation.centroidal`."""
    rows = centroidal["tables"][DEFAULT]
    slowest = 1e3 * max(row["solver_median"] for row in rows)
    why = "A compiled interior-point method that knows the stages; `centroidal.json` has the comparison with Ipopt."
    return Compared("optimisation of one transition [ms]", "~100", f"{slowest:.2g}", slowest, TRANSITION, -1, why)


def _taken(results: dict[str, Any]) -> str:
    """When and with which code results were taken."""
    return f"{results['date']}, code {results['code']}"
