"""What a data set of motions holds, in figures: statistics.json, and README.md for readers."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from toolkit.clips.attempt import ATTEMPTS, CLIPS, ROBOT, RUNS, Record
from toolkit.clips.index import INDEX
from toolkit.exchange.formats import FORMATS
from toolkit.learning.dataset import Manifest

SHEET, STATISTICS, PAGE = "sheet.jpg", "statistics.json", "README.md"
_SPREAD = {
    "speed": "m/s",
    "top_speed": "m/s",
    "duration": "s",
    "distance": "m",
    "max_slip": "m",
    "max_torque_ratio": "",
}
"""Figures of clips whose spread is told, with their units."""


def statistics(records: Sequence[Record]) -> dict[str, Any]:
    """Figures of a data set from the records of all its attempts.

    `hours` of motion, `contacts` made and `palm_contacts` among them; `passed`, the share of worlds whose run was kept;
    the `spread` of some figures over clips (least, median, 95th percentile, largest; SI units); the same for each of
    the `kinds`; the commonest reasons of the `failures`; `work`, hours that all attempts took together, by the clock
    and of the processor.
    """
    kept = [record for record in records if record["passed"]]
    kinds = {kind: [r for r in records if r["kind"] == kind] for kind in dict.fromkeys(r["kind"] for r in records)}
    return {
        **_totals(records),
        "spread": {name: _spread([record[name] for record in kept]) for name in _SPREAD},
        "kinds": {kind: _totals(found) for kind, found in kinds.items()},
        "failures": _failures(records),
        "work": {
            "wall_hours": sum(float(record["seconds"]) for record in records) / 3600.0,
            "processor_hours": sum(float(record["processor_seconds"]) for record in records) / 3600.0,
        },
    }


def page(figures: dict[str, Any], manifest: Manifest) -> str:
    """The text of README.md: what the figures are, and what lies where."""
    kinds = [
        (kind, row["attempts"], row["clips"], f"{row['passed']:.0%}", _length(row["hours"]), row["contacts"],
         row["palm_contacts"], "-" if row["max_slip"] is None else f"{1e3 * row['max_slip']:.1f}")
        for kind, row in [*figures["kinds"].items(), ("all", figures)]
    ]  # fmt: skip
    spread = [
        (f"{name} [{unit}]" if unit else name, *(f"{value:.3g}" for value in figures["spread"][name].values()))
        for name, unit in _SPREAD.items()
        if figures["spread"][name]
    ]
    failures = [(row["times"], row["stage"], row["reason"].replace("|", "/")) for row in figures["failures"]]
    work, wanted = figures["work"], manifest.settings["hours"]
    part = "" if figures["hours"] >= wanted else f" This is a part of the {_length(wanted)} that were asked for."
    form, fps = FORMATS[manifest.settings["format"]], manifest.settings["fps"]
    parts = [
        "# Motions of a humanoid through random worlds",
        f"{_length(figures['hours'])} of motion of {manifest.robot} in {figures['clips']} clips, each planned, "
        f"executed in MuJoCo and kept because it passed every check; {figures['passed']:.0%} of "
        f"{figures['attempts']} worlds did. All attempts together took {_length(work['processor_hours'])} of one "
        f"core's time ({_length(work['wall_hours'])} by the clock).{part}",
        f"![Sampled clips]({SHEET})",
        "## Kinds of worlds",
        _table(("kind", "worlds", "clips", "passed", "motion", "contacts", "by palms", "largest slip [mm]"), kinds),
        "## Spread over clips",
        _table(("figure", "least", "median", "95 %", "largest"), spread),
        "## What failed",
        _table(("times", "stage", "reason"), failures) if failures else "Nothing.",
        "## What lies where",
        f"- `{INDEX}`: a row for each clip: its folders, its world, its figures.\n"
        f"- `{CLIPS}/N/`: a clip: {form.about} ({', '.join(form.files) or 'contacts.json'}, {fps:g} frames per "
        f"second), `contacts.json`, `labels.csv` with contacts, torques and targets for each frame, `world.xml`, the "
        f"world that was planned in, `terrain.xml` and `terrain.obj`, what the robot collided with. `README.txt` there "
        f"says frames, units and orders.\n"
        f"- `{RUNS}/N/`: the run itself. `python -m toolkit.replay {RUNS}/N` replays it in plain MuJoCo bit for bit, "
        f"and `python -m toolkit.export {RUNS}/N --to FORMAT` writes another format. A clip needs "
        f"none of it, and it takes most of the room.\n"
        f"- `{ROBOT}/robot.xml`: the robot.\n"
        f"- `{ATTEMPTS}/`: what became of each world; `manifest.json`: settings and versions; `{STATISTICS}`: these "
        f"figures.",
    ]
    return "\n\n".join(parts) + "\n"


def _totals(records: Sequence[Record]) -> dict[str, Any]:
    """Sums over some attempts."""
    kept = [record for record in records if record["passed"]]
    return {
        "attempts": len(records),
        "clips": len(kept),
        "passed": len(kept) / max(len(records), 1),
        "hours": sum(record["duration"] for record in kept) / 3600.0,
        "contacts": sum(record["contacts"] for record in kept),
        "palm_contacts": sum(record["palm_contacts"] for record in kept),
        "max_slip": max((record["max_slip"] for record in kept), default=None),
    }


def _spread(values: Sequence[float]) -> dict[str, float]:
    """Least, median, 95th percentile and largest of some values; nothing of none."""
    if not values:
        return {}
    least, middle, high, largest = np.percentile(values, [0.0, 50.0, 95.0, 100.0]).tolist()
    return {"least": least, "median": middle, "high": high, "largest": largest}


def _failures(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Reasons of failures, the commonest first; those that differ in numbers or sides alone are one."""
    found = Counter(
        (record["stage"], re.sub(r"(left|right)_", "", re.sub(r"-?\d+(\.\d+)?(e[-+]?\d+)?", "#", record["reason"])))
        for record in records
        if not record["passed"]
    )
    return [{"times": times, "stage": stage, "reason": reason} for (stage, reason), times in found.most_common()]


def _length(hours: float) -> str:
    """A length of time for readers."""
    return f"{hours:.2f} h" if hours >= 1.0 else f"{60.0 * hours:.1f} min"


def _table(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table in Markdown, the first column to the left."""
    lines = ["| " + " | ".join(header) + " |", "|---|" + "---:|" * (len(header) - 1)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])
