"""index.parquet: a row for each clip of a data set."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from toolkit.clips.attempt import CLIPS, MEASURED, RUNS, Record, name_of
from toolkit.drafts import write_whole
from toolkit.errors import InputError

INDEX = "index.parquet"
_COUNTS = ("frames", "transitions", "contacts", "palm_contacts")
_NUMBERS = ("duration", "fps", "distance", "speed", "top_speed", *MEASURED)


def pyarrow() -> ModuleType:
    """The library that writes Parquet.

    Raises:
        InputError: It is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError:
        raise InputError("a data set needs pyarrow: pip install -e '.[dataset]'") from None
    return pyarrow


def write_index(folder: Path, robot: str, records: Sequence[Record]) -> None:
    """Write the index of a data set.

    Columns: `clip` and `run`, folders in the data set; `attempt`, `robot`, `kind`, `seed`, `options` of the world as
    JSON text; and the figures of `toolkit.clips.attempt.kept_figures`, in SI units. Rows are in the order of attempts.

    Args:
        folder: The data set.
        robot: Name of the robot.
        records: Records of all attempts.
    """
    arrow = pyarrow()
    kept = [record for record in records if record["passed"]]
    names = [name_of(record["attempt"]) for record in kept]
    columns = {
        "clip": arrow.array([f"{CLIPS}/{name}" for name in names], arrow.string()),
        "run": arrow.array([f"{RUNS}/{name}" for name in names], arrow.string()),
        "attempt": arrow.array([record["attempt"] for record in kept], arrow.int32()),
        "robot": arrow.array([robot] * len(kept), arrow.string()),
        "kind": arrow.array([record["kind"] for record in kept], arrow.string()),
        "seed": arrow.array([record["seed"] for record in kept], arrow.int64()),
        "options": arrow.array([json.dumps(record["options"], sort_keys=True) for record in kept], arrow.string()),
    }
    columns |= {name: arrow.array([record[name] for record in kept], arrow.int32()) for name in _COUNTS}
    columns |= {name: arrow.array([record[name] for record in kept], arrow.float64()) for name in _NUMBERS}
    content = io.BytesIO()
    arrow.parquet.write_table(arrow.table(columns), content)
    write_whole(folder / INDEX, content.getvalue())
