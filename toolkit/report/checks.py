"""Checks as JSON holds them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toolkit.execution.check import Check, Result


def check_entries(checks: Sequence[Check]) -> list[dict[str, Any]]:
    """Checks as JSON holds them, with their result."""
    return [
        {"name": c.name, "value": c.value, "limit": c.limit, "unit": c.unit, "result": c.result.value} for c in checks
    ]


def read_checks(entries: Sequence[dict[str, Any]]) -> tuple[Check, ...]:
    """Checks of `check_entries` after JSON, where null stands for what was not finite; their results stay the same.

    Raises:
        KeyError: a key is missing.
        TypeError: an entry is no dictionary.
    """
    checks = []
    for entry in entries:
        unmeasured = entry["result"] == Result.NOT_CHECKED
        value = float("inf") if entry["value"] is None and not unmeasured else entry["value"]
        limit = float("inf") if entry["limit"] is None else entry["limit"]
        checks.append(Check(entry["name"], limit, entry["unit"], value))
    return tuple(checks)
