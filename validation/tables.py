"""Results as Markdown and JSON."""

from __future__ import annotations

import datetime
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from toolkit.errors import InputError
from toolkit.report.files import write_json
from validation.goals import Goal
from validation.jobs import Record
from validation.machine import environment


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table, the first column to the left, the others to the right."""
    lines = ["| " + " | ".join(header) + " |", "|---|" + "---:|" * (len(header) - 1)]
    lines += ["| " + " | ".join(str(cell).replace("|", "/") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def goal_table(goals: Sequence[Goal]) -> str:
    """Goals beside the figures."""
    rows = ((goal.name, goal.wanted, goal.figure, goal.result) for goal in goals)
    return markdown_table(("goal", "wanted", "found", "result"), rows)


def number(value: float | None, format_spec: str = ".3g") -> str:
    """A number, or "-" where there is none."""
    return "-" if value is None or not np.isfinite(value) else format(value, format_spec)


def in_unit(value: float | None, factor: float) -> float | None:
    """A number in another unit, None where there is none."""
    return None if value is None else factor * value


def values(records: Iterable[Record], *path: str) -> list[float]:
    """A figure of every record that has it; `path` leads through nested dictionaries."""
    found = []
    for record in records:
        value: Any = record
        for name in path:
            value = value.get(name) if isinstance(value, dict) else None
        if value is not None:
            found.append(float(value))
    return found


def columns(rows: Sequence[Record], names: Iterable[str]) -> dict[str, list[Any]]:
    """Figures of many rows as one list each, numbers to six digits, None where there is none; takes little room."""
    return {name: [_short(row.get(name)) for row in rows] for name in names}


def _short(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value


def median(numbers: Sequence[float]) -> float | None:
    """Median, None of nothing."""
    return float(np.median(numbers)) if len(numbers) else None


def mean(numbers: Sequence[float], weights: Sequence[float] | None = None) -> float | None:
    """Mean, None of nothing."""
    return float(np.average(numbers, weights=weights)) if len(numbers) else None


def largest(numbers: Sequence[float]) -> float | None:
    """Largest, None of nothing."""
    return max(numbers, default=None)


def failure_counts(records: Iterable[Record]) -> list[tuple[int, str, str, list[str]]]:
    """Reasons why trials failed: (times, stage, reason, names of the trials), the commonest first.

    Reasons that differ in their numbers only are one.
    """
    times: Counter[tuple[str, str]] = Counter()
    names: dict[tuple[str, str], list[str]] = {}
    for record in records:
        if not record.get("passed"):
            reason = re.sub(r"-?\d+(\.\d+)?(e[-+]?\d+)?", "#", str(record.get("reason", "")))
            key = (str(record.get("stage", "")), re.sub(r"(left|right)_", "", reason))
            times[key] += 1
            names.setdefault(key, []).append(record["name"])
    return [(count, stage, reason, names[stage, reason]) for (stage, reason), count in times.most_common()]


def failure_section(records: Sequence[Record]) -> str:
    """Failures counted by reason, then each with its reason and the folder of its run."""
    failures = [record for record in records if not record.get("passed")]
    if not failures:
        return "No trial failed."
    rows = [(str(count), stage, reason, ", ".join(names)) for count, stage, reason, names in failure_counts(failures)]
    parts = [markdown_table(("times", "stage", "reason", "trials"), rows), ""]
    for record in failures:
        folder = f" ({record['folder']})" if record.get("folder") else ""
        parts.append(f"- {record['name']}, {record.get('stage')}: {record.get('reason')}{folder}")
    return "\n".join(parts)


def write_results(
    folder: Path,
    name: str,
    *,
    title: str,
    sections: Sequence[tuple[str, str]],
    content: dict[str, Any],
    goals: Sequence[Goal],
    settings: dict[str, Any],
) -> Path:
    """Write `<name>.json` and `<name>.md`.

    Args:
        folder: to write into; made where it is missing.
        name: of the files.
        title: of the report.
        sections: headings and Markdown text.
        content: tables and trials for the JSON file.
        goals: beside the figures.
        settings: of the experiment.

    Returns:
        The Markdown file.

    Raises:
        InputError: the folder cannot be written.
    """
    taken = environment()
    date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d")
    machine = taken["machine"]
    foot = [
        f"Taken on {date} on {machine['processor']}, {machine['cores']} cores, {machine['system']}, one thread per "
        f"trial; load of the machine at the end {machine['load']}. Code {taken['code']}.",
        "",
        "Versions: " + ", ".join(f"{package} {version}" for package, version in taken["versions"].items()) + ".",
        "",
        "Settings: " + ", ".join(f"{key} {value}" for key, value in settings.items() if value is not None) + ".",
    ]
    parts = [f"# {title}", "", "## Goals", "", goal_table(goals), ""]
    for heading, text in [*sections, ("Versions and machine", "\n".join(foot))]:
        parts += [f"## {heading}", "", text, ""]
    path = folder / f"{name}.md"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(parts), encoding="utf-8")
        everything = {"experiment": name, "date": date, **taken, "settings": settings}
        everything |= {"goals": [goal.as_dict() for goal in goals], **content}
        write_json(folder / f"{name}.json", everything)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another --results") from error
    return path


def show_results(console: Console, path: Path) -> None:
    """Print what `write_results` wrote, and where it lies."""
    console.print(path.read_text(encoding="utf-8"), markup=False, highlight=False, soft_wrap=True)
    console.print(str(path), markup=False, soft_wrap=True)
