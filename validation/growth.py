"""How time and memory of the search grow with the length of the world."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from validation import goals
from validation.cases import Case
from validation.goals import Goal
from validation.jobs import Job, Record
from validation.options import TrialSettings
from validation.plan_trial import growth_trial
from validation.tables import in_unit, largest, markdown_table, median, number, values

KIND = "rubble_field"
TILE = 0.4  # m; edge of the generator's tiles
WHOLE = 2  # worlds of each length whose search goes on for the whole time limit; the others stop at a first sequence


def growth_jobs(settings: TrialSettings, args: argparse.Namespace) -> list[Job]:
    """Searches through rubble of several lengths; their expansions are not limited, their time is."""
    settings = replace(settings, planning=replace(settings.planning, expansions=None))
    jobs = []
    for length in args.lengths:
        rows = max(round(length / TILE), 1)
        for index in range(args.growth_trials):
            case = Case(KIND, args.seed_offset + index, (("rows", rows),))
            jobs.append(Job(f"growth-{case.name}", growth_trial, (settings, case, rows * TILE, index < WHOLE)))
    return jobs


def exponent(lengths: Sequence[float], figures: Sequence[float]) -> float | None:
    """Exponent b of the power law a x^b that fits best in the logarithm; None with fewer than two lengths."""
    pairs = [(x, y) for x, y in zip(lengths, figures, strict=True) if y > 0]
    if len({x for x, _ in pairs}) < 2:
        return None
    x, y = np.log(np.array(pairs)).T
    return float(np.polyfit(x, y, 1)[0])


def summarise(records: Sequence[Record]) -> dict[str, Any]:
    """One row per length of the rubble, and the exponents fitted to it: the flat ground before and behind is free."""
    rows = []
    for length in sorted({record["length"] for record in records if "length" in record}):
        same = [record for record in records if record.get("length") == length]
        rows.append(
            {
                "length": length,
                "way": median(values(same, "way")),
                "trials": len(same),
                "found": sum(record["found"] for record in same),
                "first_seconds": median(values(same, "first_seconds")),
                "first_processor_seconds": median(values(same, "first_processor_seconds")),
                "first_expansions": median(values(same, "first_expansions")),
                "heuristic_seconds": median(values(same, "heuristic_seconds")),
                "expansions_per_second": median(values(same, "expansions_per_second")),
                "memory_before": median(values(same, "memory_before")),
                "first_memory": median(values(same, "first_memory")),
                "first_memory_gain": median(values(same, "first_memory_gain")),
                "peak_memory": largest(values(same, "peak_memory")),
                "overtime": largest(values(same, "overtime")),
            }
        )
    fits = {}
    for name in ("first_processor_seconds", "first_expansions", "first_memory_gain"):
        known = [row for row in rows if row[name] is not None]
        fits[name] = exponent([row["length"] for row in known], [row[name] for row in known])
    return {"rows": rows, "exponents": fits}


def table(summary: dict[str, Any], time_limit: float) -> str:
    """The rows in Markdown and the exponents below."""
    header = (
        "rubble [m]",
        "way [m]",
        "trials",
        "found",
        "first sequence [ms]",
        "the same, processor time [ms]",
        "expansions until then",
        "heuristic [ms]",
        "expansions per s",
        "memory before [MB]",
        "at the first sequence [MB]",
        f"peak in {time_limit:g} s [MB]",
    )
    rows = [
        (
            f"{row['length']:.1f}",
            number(row["way"], ".1f"),
            str(row["trials"]),
            str(row["found"]),
            *(number(in_unit(row[name], 1e3), ".0f") for name in ("first_seconds", "first_processor_seconds")),
            number(row["first_expansions"], ".0f"),
            number(in_unit(row["heuristic_seconds"], 1e3), ".0f"),
            *(
                number(row[name], ".0f")
                for name in ("expansions_per_second", "memory_before", "first_memory", "peak_memory")
            ),
        )
        for row in summary["rows"]
    ]
    fits = summary["exponents"]
    text = ", ".join(f"{name.replace('_', ' ')} {number(value, '.2f')}" for name, value in fits.items())
    return f"{markdown_table(header, rows)}\n\nFitted exponents over the length of the rubble: {text}."


def goals_of(summary: dict[str, Any], time_limit: float) -> list[Goal]:
    """At most linear, on time, and within memory."""
    rows, fits = summary["rows"], summary["exponents"]
    return [
        goals.every("growth: first sequence found", _sum(rows, "found"), _sum(rows, "trials")),
        goals.at_most("growth: exponent of time to first sequence", fits["first_processor_seconds"], 1.0),
        goals.at_most("growth: exponent of memory gained by first sequence", fits["first_memory_gain"], 1.0),
        goals.at_most("time limit exceeded by", largest(values(rows, "overtime")), 0.05),
        goals.at_most(f"peak memory of a {time_limit:g} s search", largest(values(rows, "peak_memory")), 1000.0, "MB"),
    ]


def _sum(rows: Sequence[dict[str, Any]], name: str) -> int:
    return int(sum(row[name] for row in rows))
