"""Experiments that outgrow a sitting: they end when their time is up, and go on from the results that are there."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from toolkit import cli
from toolkit.errors import InputError
from toolkit.report.files import plain
from validation.jobs import Record, Store
from validation.options import TrialSettings

_FREE = {"quick", "seeds", "seed_offset", "trials", "execute"}
"""Settings that choose trials, or what is done with their plans, and do not change the plans."""


def add_growing_options(target: argparse.ArgumentParser) -> None:
    """Add `--minutes` and `--grow`."""
    target.add_argument(
        "--minutes",
        type=cli.positive(float),
        metavar="M",
        help="start no trial later than that, and write the results of those that ended (default: all of them)",
    )
    target.add_argument(
        "--grow",
        action="store_true",
        help="take over the trials of the results that are there, with whatever code they were made; "
        "the results say how many were made with which",
    )


def state_of(settings: TrialSettings) -> str:
    """The state of the code and of the robot's files that records are made with."""
    deciding = settings.deciding()
    return f"{deciding['code']} with robot {deciding['robot_files']}"


def stamped(records: Iterable[Record], state: str) -> list[Record]:
    """Records that say what they were made with; those that say so already are left as they are."""
    return [{"state": state, **record} for record in records]


def take_over(store: Store, path: Path, settings: dict[str, Any], names: Iterable[str]) -> None:
    """Count trials of results that are there as run where a store has none; they say what they were made with.

    Args:
        store: Keeps records.
        path: The results' JSON file; there are no trials where there is no file.
        settings: Those of the results to come; apart from what leaves plans as they are they have to be the same.
        names: Of the trials that are wanted.

    Raises:
        InputError: The file cannot be read, or was made with other settings.
    """
    if not path.exists():
        return
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        theirs, trials = content["settings"], content["trials"]
        trials = list(trials.values()) if isinstance(trials, dict) else trials
        code = content["code"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: holds no results to go on from ({error}); leave out --grow") from error
    ours = plain(settings)  # as the file holds them
    differ = sorted(name for name in (set(ours) | set(theirs)) - _FREE if ours.get(name) != theirs.get(name))
    if differ:
        raise InputError(f"{path}: was made with other settings ({', '.join(differ)}); leave out --grow")
    wanted = set(names)
    for trial in stamped(trials, f"{code} with robot files unrecorded"):
        if trial["name"] in wanted:
            store.records.setdefault(trial["name"], trial)


def growth_note(records: Sequence[Record], wanted: int, state: str) -> str:
    """How many of the wanted trials are missing, and what made the others where not all are of the present state."""
    missing, counts = wanted - len(records), Counter(record["state"] for record in records)
    states = ", ".join(f"{count} {state}" for state, count in counts.most_common())
    return " ".join(
        [
            *([f"{missing} of {wanted} trials have not been run yet."] if missing else []),
            *([f"Trials by the code that made them: {states}."] if set(counts) - {state} else []),
        ]
    )
