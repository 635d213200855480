"""Rows that other programs have made: simulated runs, times of the first sequence, and what the networks buy."""

from __future__ import annotations

from typing import Any

from validation.page.plans import Section
from validation.page.spread import rate, spread
from validation.tables import markdown_table, number, values


def other_section(known: dict[str, dict[str, Any]]) -> Section:
    """Tables from the results of `validation.execution`, `budgets` and, where they are committed, `ablation`."""
    parts = [_execution(known["execution"]), _budgets(known["budgets"])]
    if "ablation" in known:
        parts.append(_ablation(known["ablation"]))
    return Section("Rows of other results", "\n\n".join(parts), [], {})


def _execution(results: dict[str, Any]) -> str:
    rows = [
        (row["kind"], rate(row["planned"], row["trials"]), rate(row["held"], row["trials"])) for row in results["table"]
    ]
    words = f"Plans carried out in simulation, {_taken('execution', results)}. The paper shows them in a visualiser."
    return f"{words}\n\n{markdown_table(('world', 'planned', 'arrived within all bounds'), rows)}"


def _budgets(results: dict[str, Any]) -> str:
    rows = []
    for kind in dict.fromkeys(record["kind"] for record in results["trials"]):
        same = [record for record in results["trials"] if record["kind"] == kind]
        feasible = sum(record["feasible"] for record in same)
        rows.append((kind, rate(feasible, len(same)), spread(values(same, "first_feasible_seconds"), ".0f", 1e3)))
    words = f"First feasible sequence in search and optimisation, {_taken('budgets', results)}."
    return f"{words}\n\n{markdown_table(('world', 'feasible', 'first feasible sequence [ms]'), rows)}"


def _ablation(results: dict[str, Any]) -> str:
    rows = (
        (
            row["kind"],
            row["planner"],
            row["variant"],
            rate(row["feasible"], row["trials"]),
            number(row["true cost"], ".0f"),
            number(row["J, paper's weights"], ".0f"),
        )
        for row in results["table"]
    )
    header = ("world", "planner", "variant", "feasible", "true cost, median", "J with the paper's weights, median")
    return f"What the networks buy, {_taken('ablation', results)}.\n\n{markdown_table(header, rows)}"


def _taken(name: str, results: dict[str, Any]) -> str:
    """Where results stand and when they were taken."""
    return f"`{name}.json` of {results['date']}, code {results['code']}"
