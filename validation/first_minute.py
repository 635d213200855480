"""The first minute: how long the first verdict takes after installation, later ones, and the import.

Every figure is the wall-clock and the processor time of a command in a process of its own, and its processor time
beside that of a fixed calculation, which takes other machines into account. With --record, the list of kernels that
the toolkit compiles ahead of their use is made anew from runs. That is needed after a change of the arguments of a
kernel that Python calls; a test says so.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from toolkit.pipeline.warmup import KERNELS
from validation.machine import environment

ROOT = Path(__file__).resolve().parent.parent
REPEATED = 3  # runs whose least time counts, but for the first verdict
VERDICT = ("-m", "toolkit.validate", "flat")
FIXED = "s = 0\nfor i in range(20_000_000):\n    s += i * i\n"
USED = """
import json, sys
from toolkit import validate
from toolkit.compiled import used_kernels
validate.main(sys.argv[2:])
with open(sys.argv[1], "w") as file:
    json.dump(used_kernels(), file)
"""
TIMES = """
import json, sys, time
from toolkit.compiled import keep
found = []
for name, arguments in json.load(open(sys.argv[1])):
    began = time.process_time()
    keep(name, arguments)
    found.append(time.process_time() - began)
json.dump(found, open(sys.argv[1], "w"))
"""
RECORDED = (("flat",), ("rubble_corridor",), ("flat", "--push", "60"))
"""Runs that call all kernels of the list."""


class Figure(NamedTuple):
    """Seconds of a command by the clock and by processor time, of all its processes."""

    wall: float
    processor: float


def main(argv: list[str] | None = None) -> int:
    """Measure, or record; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.first_minute",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--record", action="store_true", help="record the list of kernels instead of measuring")
    args = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as scratch:
        return _record(Path(scratch)) if args.record else _measure(Path(scratch))


def _measure(scratch: Path) -> int:
    """Print the table."""
    fixed = _least(scratch, "-c", FIXED)
    rows = [
        ("first verdict", 40.0, _timed(scratch, *VERDICT, "--out", str(scratch / "first"))),
        ("later verdict", 8.0, _least(scratch, *VERDICT, "--out", str(scratch / "later"))),
        ("import toolkit.pipeline", 0.7, _least(scratch, "-c", "import toolkit.pipeline")),
        ("validate --help", None, _least(scratch, "-m", "toolkit.validate", "--help")),
        ("fixed calculation", None, fixed),
    ]
    lines = [f"{'':<26}{'goal':>8}{'wall s':>10}{'processor s':>13}{'of the fixed':>14}"]
    for name, goal, figure in rows:
        wanted = "" if goal is None else f"{goal:g} s"
        ratio = figure.processor / fixed.processor
        lines.append(f"{name:<26}{wanted:>8}{figure.wall:>10.2f}{figure.processor:>13.2f}{ratio:>14.2f}")
    lines += ["", *(f"{name}: {value}" for name, value in environment().items())]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def _least(scratch: Path, *words: str) -> Figure:
    """The least times of a few runs."""
    runs = [_timed(scratch, *words) for _ in range(REPEATED)]
    return Figure(min(run.wall for run in runs), min(run.processor for run in runs))


def _timed(scratch: Path, *words: str) -> Figure:
    """Times of Python with these arguments, where compiled code is kept in a folder of `scratch`."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(scratch / "kernels"), "PYTHONPATH": str(ROOT)}
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, *words], env=environment, cwd=scratch, stdout=subprocess.DEVNULL, check=True)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return Figure(wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def _record(scratch: Path) -> int:
    """Write the list of kernels."""
    found: set[str] = set()
    answer = scratch / "answer.json"
    for words in RECORDED:
        for _ in range(2):  # of what the first of them compiles, some is only a part of something else
            _timed(scratch, "-c", USED, str(answer), *words, "--out", str(scratch / "run"))
        for name, arguments, _ in json.loads(answer.read_text()):
            found.add(json.dumps([name, arguments]))
    answer.write_text(json.dumps([json.loads(key) for key in sorted(found)]))
    (scratch / "kernels").rename(scratch / "compiled before")
    _timed(scratch, "-c", TIMES, str(answer))
    lines = []
    for key, seconds in zip(sorted(found), json.loads(answer.read_text()), strict=True):
        name, arguments = json.loads(key)
        lines.append(json.dumps({"name": name, "seconds": round(seconds, 2), "arguments": arguments}))
    KERNELS.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")
    sys.stdout.write(f"{len(lines)} kernels written to {KERNELS}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
