"""Typed access to the tables of a robot.toml."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np

from toolkit.robot.problems import Problems

_MOST = 1e9  # largest number that is accepted


def suggestion(name: str, allowed: Iterable[str]) -> str:
    """End of an error message: the allowed name that is close to the given one, or all allowed names."""
    allowed = sorted(allowed)
    close = get_close_matches(name, allowed, n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else f"allowed: {', '.join(allowed) or 'none'}"


@dataclass(frozen=True)
class Reader:
    """Typed access to tables: what does not fit is noted, and a value of the right kind is returned in its place.

    Attributes:
        problems: Where problems are noted; nothing that was read counts before its `check`.
    """

    problems: Problems

    def keys(self, table: dict, allowed: Iterable[str], where: str) -> None:
        """Note keys that are not allowed; `where` is the path of the table, with a dot at its end."""
        for key in table:
            if key not in allowed:
                self.problems.add(f"unknown key '{where}{key}'; {suggestion(key, allowed)}")

    def numbers_within(self, item: Any, where: str = "") -> None:
        """Note a number at any depth that is not finite or too large."""
        if isinstance(item, dict | list):
            for key, value in item.items() if isinstance(item, dict) else enumerate(item):
                self.numbers_within(value, f"{where}.{key}".lstrip("."))
        elif isinstance(item, int | float) and not abs(item) <= _MOST:
            self.problems.add(f"'{where}' = {str(item)[:20]} must be a finite number up to {_MOST:g}")

    def table(self, data: dict, key: str, allowed: Iterable[str] | None, where: str = "") -> dict:
        """A table, empty where it is missing; any keys where `allowed` is None."""
        table = data.get(key, {})
        if not isinstance(table, dict):
            self.problems.add(f"'{where}{key}' must be a table")
            return {}
        if allowed is not None:
            self.keys(table, allowed, f"{where}{key}.")
        return table

    def text(self, table: dict, key: str, where: str, default: str | None = "") -> str:
        """A text; it must be there and not empty where the default is None."""
        value = table.get(key, default)
        if value is None:
            self.problems.add(f"'{where}{key}' is missing")
            return ""
        if not isinstance(value, str) or (default is None and not value):
            self.problems.add(f"'{where}{key}' = {value!r} must be text")
            return ""
        return value

    def flag(self, table: dict, key: str, where: str) -> bool:
        """A true or false; false where it is missing."""
        value = table.get(key, False)
        if not isinstance(value, bool):
            self.problems.add(f"'{where}{key}' = {value!r} must be true or false")
            return False
        return value

    def texts(self, table: dict, key: str, where: str) -> tuple[str, ...]:
        """A list of texts, empty where it is missing."""
        value = table.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, str) and item for item in value):
            self.problems.add(f"'{where}{key}' = {value!r} must be a list of texts")
            return ()
        return tuple(value)

    def numbers(
        self, table: dict, key: str, where: str, count: int, default: tuple | None = None, lowest: float = -np.inf
    ) -> tuple[float, ...]:
        """A number or a list of `count` numbers; it must be there where there is no default."""
        if key not in table and default is not None:
            return default
        return self.values(table.get(key), f"{where}{key}", count, lowest)

    def patterns(
        self, data: dict, key: str, where: str, count: int = 1, lowest: float = -np.inf, but: Iterable[str] = ()
    ) -> dict[str, Any]:
        """A table of numbers, or of lists of `count` numbers, by pattern; the keys of `but` are left out."""
        table = {name: value for name, value in self.table(data, key, None, where).items() if name not in but}
        values = {name: self.values(v, f"{where}{key}.{name}", count, lowest) for name, v in table.items()}
        return {name: v[0] for name, v in values.items()} if count == 1 else values

    def values(self, value: Any, where: str, count: int, lowest: float = -np.inf) -> tuple[float, ...]:
        """The numbers of a value: one, or a list of `count`."""
        values = value if count > 1 else [value]
        kind = "a number" if count == 1 else f"{count} numbers"
        if value is None:
            self.problems.add(f"'{where}' is missing; it is {kind}")
            return (1.0,) * count
        good = isinstance(values, list) and len(values) == count
        good = good and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
        if not good or min(values) < lowest:
            bound = f" of at least {lowest:g}" if np.isfinite(lowest) else ""
            self.problems.add(f"'{where}' = {value!r} must be {kind}{bound}")
            return (1.0,) * count
        return tuple(float(v) if abs(v) <= _MOST else 0.0 for v in values)  # numbers_within says what is too large
