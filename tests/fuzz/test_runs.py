"""Damaged reports, plans and standards of runs end in one line and exit code 2, or are taken; nothing else happens.

A few cases run by default. For a long run see `tests/fuzz/budget.py`.
"""

import json
import shutil
import sys
import time

import numpy as np
import pytest

from tests.fuzz.budget import SEED, seconds
from tests.fuzz.test_commands import damaged
from tests.saved import damage
from tests.saved.conftest import called
from toolkit import compare, execute, replay


def check(folder, whole, rng) -> tuple[str, int]:
    """Damage one part of a run and call a command that reads it; the part, and the command's exit code."""
    part = str(rng.choice(["report.json", "plan.json", "standard", "touchdowns", "scuffs", "checks"]))
    if part.endswith(".json"):
        content = damaged(json.loads((whole / part).read_text()), rng)
        (folder / part).write_text(json.dumps(content))
    else:
        change = lambda text: np.asarray(json.dumps(damaged(json.loads(str(text)), rng)))  # noqa: E731
        damage.array(part, change)(folder)
    command = {"report.json": compare, "plan.json": execute}.get(part, replay)
    if command is compare:
        code, line = called(compare.main, whole, folder)
    elif command is execute:
        code, line = called(execute.main, folder, "--robot", "nobody")  # ends before the plan is carried out
    else:
        code, line = called(replay.main, folder)
    assert code in (0, 1, 2) and "\n" not in line, (part, line)
    assert code != 1 or command is replay, (part, line)
    assert code != 2 or line, part
    assert code != 2 or str(folder) in line or "nobody" in line or "world" in line, (part, line)
    for name in (part, "execution.npz") if part.endswith(".json") else ("execution.npz",):
        shutil.copy(whole / name, folder / name)
    return part, code


def test_some_damaged_runs(copy, walk_folder, capsys):
    rng = np.random.default_rng(SEED)
    found = {check(copy, walk_folder, rng) for _ in range(60)}
    assert {code for part, code in found if part == "report.json"} == {0, 2}
    assert {code for part, code in found if part == "standard"} >= {2}


@pytest.mark.slow
def test_damaged_runs_for_long(copy, walk_folder, capsys):
    end, number = time.monotonic() + seconds("runs"), 0
    counts: dict[tuple[str, int], int] = {}
    while time.monotonic() < end:
        try:
            key = check(copy, walk_folder, np.random.default_rng([SEED, number]))
        except Exception as error:
            raise AssertionError(f"case {number} of seed {SEED}: {error}") from error
        capsys.readouterr()
        counts[key] = counts.get(key, 0) + 1
        number += 1
    with capsys.disabled():
        sys.stdout.write(f"\n{number} damaged runs: {counts}\n")
