"""The map as a table: rates with their intervals, and holes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scipy.stats import binomtest

from validation.jobs import ERROR, Record
from validation.map_families import FAMILIES, Family
from validation.map_trial import FAILURES, IMPOSSIBLE, NO_SEQUENCE
from validation.tables import markdown_table

_COMMONEST = 3  # reasons that a row of the table tells
COLUMNS = (
    "family",
    "parameters",
    "cells",
    "PASS",
    "rate",
    "95 % interval",
    "impossible",
    "no sequence",
    *FAILURES.values(),
    "error",
    "holes",
    "commonest reasons",
)


@dataclass(frozen=True)
class Hole:
    """A cell that fails, or is called impossible, although harder worlds of its family pass in all seeds.

    Attributes:
        record: Of the cell.
        harder: Values of the least hard ones of those worlds.
    """

    record: Record
    harder: tuple[float, ...]


def wilson(successes: int, trials: int) -> tuple[float, float] | None:
    """Wilson's interval of a rate at 95 %; None without trials."""
    if not trials:
        return None
    interval = binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def holes_of(family: Family, records: Sequence[Record]) -> list[Hole]:
    """Holes in a family, in the order of the records."""
    worlds: dict[tuple[float, ...], list[bool]] = {}
    for record in records:
        worlds.setdefault(tuple(record["values"]), []).append(record["passed"])
    passing = sorted((family.hard(values), values) for values, passed in worlds.items() if all(passed))
    found = []
    for record in records:
        here = family.hard(record["values"])
        harder = (values for hard, values in passing if _is_harder(hard, here))
        least = None if record["passed"] else next(harder, None)
        if least is not None:
            found.append(Hole(record, least))
    return found


def _is_harder(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Whether a world is harder than another one: in one way, and in none easier."""
    return one != other and all(mine >= its for mine, its in zip(one, other, strict=True))


def summarise(name: str, records: Sequence[Record]) -> dict[str, Any]:
    """A row of the table; proven impossible cells do not count in the rate."""
    outcomes = Counter(record["outcome"] for record in records)
    passed, impossible = sum(record["passed"] for record in records), outcomes[IMPOSSIBLE]
    counted = len(records) - impossible
    return {
        "family": name,
        "cells": len(records),
        "passed": passed,
        "rate": passed / counted if counted else None,
        "interval": wilson(passed, counted),
        "impossible": impossible,
        "no_sequence": outcomes[NO_SEQUENCE],
        "failed": {words: outcomes[words] for words in FAILURES.values()},
        "errors": sum(record["stage"] == ERROR for record in records),
        "holes": [
            {"name": hole.record["name"], "reason": hole.record["short"], "harder": list(hole.harder)}
            for hole in holes_of(FAMILIES[name], records)
        ],
        "reasons": Counter(record["short"] for record in records if not record["passed"]).most_common(),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The table in Markdown, with a last row for all families."""
    return markdown_table(COLUMNS, [*map(_line, rows), _line(_all(rows))] if rows else [])


def hole_table(rows: Sequence[dict[str, Any]]) -> str:
    """Each hole with its reason and the harder values that pass."""
    lines = [
        (hole["name"], ", ".join(f"{value:g}" for value in hole["harder"]), hole["reason"])
        for row in rows
        for hole in row["holes"]
    ]
    header = ("cell", "passes in all seeds at", "reason of the failure")
    return markdown_table(header, lines) if lines else "There is none."


def _all(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The rows of all families in one."""
    passed, counted = (sum(row[name] for row in rows) for name in ("passed", "cells"))
    impossible = sum(row["impossible"] for row in rows)
    reasons: Counter[str] = Counter()
    for row in rows:
        reasons.update(dict(row["reasons"]))
    return {
        "family": "all",
        "cells": counted,
        "passed": passed,
        "rate": passed / (counted - impossible) if counted > impossible else None,
        "interval": wilson(passed, counted - impossible),
        "impossible": impossible,
        "no_sequence": sum(row["no_sequence"] for row in rows),
        "failed": {words: sum(row["failed"][words] for row in rows) for words in FAILURES.values()},
        "errors": sum(row["errors"] for row in rows),
        "holes": [hole for row in rows for hole in row["holes"]],
        "reasons": reasons.most_common(),
    }


def _line(row: dict[str, Any]) -> tuple[str, ...]:
    """The cells of a row."""
    axes = FAMILIES[row["family"]].axes if row["family"] in FAMILIES else ()
    interval = row["interval"]
    return (
        row["family"],
        ", ".join(f"{axis.label} {axis.easy:.3g} to {axis.hard:.3g}" for axis in axes) or "-",
        str(row["cells"]),
        str(row["passed"]),
        "-" if row["rate"] is None else f"{row['rate']:.0%}",
        "-" if interval is None else f"{interval[0]:.0%} to {interval[1]:.0%}",
        str(row["impossible"]),
        str(row["no_sequence"]),
        *(str(row["failed"][words]) for words in FAILURES.values()),
        str(row["errors"]),
        str(len(row["holes"])),
        "; ".join(f"{count} x {reason}" for reason, count in row["reasons"][:_COMMONEST]) or "-",
    )
