"""Odd command lines and damaged plan files end in one line and a code of 0, 1 or 2, and leave nothing behind.

A few cases run by default. For a long run see `tests/fuzz/budget.py`.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz.budget import SEED, seconds
from tests.fuzz.run_commands import hurt, make_inputs, run_command
from tests.report.conftest import make_run
from tests.shipped_robots import OWN
from toolkit.errors import InputError
from toolkit.exchange.formats import FORMATS
from toolkit.report.plan_file import read_plan, write_plan
from toolkit.world.generators import KINDS

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 60  # s; a case that takes longer hangs

WORLD = """
<mujoco>
  <custom><numeric name="transition_timing" data="0.3 0.4"/></custom>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" friction="0.7"/>
    <site name="start" pos="0 0 0"/>
    <site name="goal" type="cylinder" pos="0.3 0 0" size="0.15 0.02"/>
  </worldbody>
</mujoco>
"""
ODD = [
    "", " ", "0", "1", "-1", "2", "-0.0", "0.5", "1e-300", "1e300", "-1e300", "nan", "inf", "-inf", "1e400", "9" * 23,
    "9" * 5000, "0x10", "1_0", "\u0663", "\udcff", "a,b", "1,1", "0.05,0.05", "100,100", "1e9,1e9", "1,nan",
    "auto", "x" * 300, "/", ".", "..", "/dev/null", "/dev/full", "/proc/none/x", "-", "--", "--help", "\n",
    "two\nlines", "%s", "%(default)s", "[red]x", "{}", "\x1b[2J", "~", "$HOME", "out", "out/deep/er", "taken.xml",
    "taken.xml/in", "world.xml", "folder", "earlier", "foreign", "empty.xml", "binary.xml", "link",
    "pipe", "na\udcefme", "\u00f6\u4e16",
]  # fmt: skip
PLANNING = ["--seed", "--planner", "--timing", "--no-palms", "--steps", "--heuristic", "--robot", "--robots"]
DISTURBANCES = ["--push", "--mass-error", "--friction-error", "--terrain-error", "--state-noise", "--delay"]
VALIDATE = ["--candidates", "--no-replanning", *DISTURBANCES]
FLAGS = {"--no-palms", "--no-replanning", "--no-recording", "--planned", "--viewer"}


def make_surroundings(folder: Path) -> None:
    """What a case finds in its working directory."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "world.xml").write_text(WORLD)
    (folder / "empty.xml").write_text("")
    (folder / "binary.xml").write_bytes(bytes(range(256)))
    (folder / "taken.xml").write_text("precious")
    (folder / "link").symlink_to("nowhere/at/all")
    os.mkfifo(folder / "pipe")
    for name, content in (("earlier", {"schema": 2, "verdict": "PASS", "stages": {}}), ("foreign", {"schema": 2})):
        (folder / name).mkdir()
        (folder / name / "report.json").write_text(json.dumps(content))
    (folder / "folder").mkdir()


def odd(rng: np.random.Generator) -> str:
    """One of the odd values, or two of them as one."""
    first = ODD[int(rng.integers(len(ODD)))]
    return first + ODD[int(rng.integers(len(ODD)))] if rng.random() < 0.1 else first


def odd_options(rng: np.random.Generator, names: list[str], most: int) -> list[str]:
    """Some options, most of them with values."""
    words: list[str] = []
    for name in rng.choice(names, int(rng.integers(0, most + 1))):
        words += [str(name)] if name in FLAGS and rng.random() < 0.9 else [f"{name}={odd(rng)}"]
    return words


def command_line(rng: np.random.Generator) -> tuple[str, list[str]]:
    """A module and its arguments; the budgets of planning stay small."""
    module = str(rng.choice(["validate", "plan", "terrain", "terrain", "terrain", "surfaces", "surfaces", "robots"]))
    world = "world.xml" if rng.random() < 0.7 else odd(rng)
    out = [] if rng.random() < 0.3 else ["--out", odd(rng)]
    if module == "terrain":
        kind = str(rng.choice([*KINDS, odd(rng)]))
        defaults = getattr(KINDS.get(kind), "__kwdefaults__", None) or {"rows": 1}
        words = [kind, *odd_options(rng, ["--seed", *(f"--{name.replace('_', '-')}" for name in defaults)], 3), *out]
    elif module == "surfaces":
        words = [world, *out]
    elif module == "robots":
        name = [] if rng.random() < 0.2 else [OWN[0] if rng.random() < 0.7 else odd(rng)]
        words = [*name, *odd_options(rng, ["--robots", "--picture"], 2)]
    else:
        names = PLANNING + (VALIDATE if module == "validate" else [])
        budget = ["--time-limit=0.3", "--expansions=20", *(["--candidates=1"] if module == "validate" else [])]
        tried = odd_options(rng, ["--time-limit", "--expansions"], 1)
        words = [world, "--no-recording", *odd_options(rng, names, 2), *budget, *tried, *out]
        if tried:  # the other one still ends the search
            words += ["--expansions=20"] if "time" in tried[0] else ["--time-limit=0.3"]
    return f"toolkit.{module}", [word for word in words if "\0" not in word]


class Commands:
    """Runs command lines one after another, and looks at what they say and leave."""

    def __init__(self, folder: Path, whole: Path | None = None):
        """Run them in a folder, where runs and scans lie if there is a `whole` run."""
        self.folder, self._whole = folder / "here", whole
        environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        server = [sys.executable, str(Path(__file__).with_name("fork_server.py"))]
        self._server = subprocess.Popen(server, stdin=-1, stdout=-1, text=True, env=environment)

    def close(self) -> None:
        """End the server."""
        self._server.communicate()

    def check(
        self, module: str, arguments: list[str], limit: float = LIMIT, hurting: np.random.Generator | None = None
    ) -> int:
        """Run one, assert that it ended as it should within `limit` seconds, and return its exit code.

        With a generator in `hurting`, a run and scans are there, some of them damaged.
        """
        make_surroundings(self.folder)
        if hurting is not None and self._whole is not None:
            make_inputs(self.folder, self._whole)
            hurt(self.folder, hurting, damaged)
        before, content = self._listing(), self._content()
        request = dict(module=module, arguments=arguments, folder=str(self.folder), limit=limit)
        assert self._server.stdin is not None and self._server.stdout is not None
        self._server.stdin.write(json.dumps(request) + "\n")
        self._server.stdin.flush()
        code = json.loads(self._server.stdout.readline())
        out, err = ((self.folder.parent / name).read_text("utf-8", "replace") for name in ("out", "err"))
        what = f"{module} {arguments}\ncode {code}\n{err[-3000:]}\n{out[-500:]}"
        assert code is not None, f"it hung: {what}"
        assert code in (0, 1, 2) and "Traceback" not in err + out, what
        lines = err.splitlines()
        if code == 2 and module != "toolkit.robots":
            assert len(lines) == 1 and lines[0].startswith("error: "), what
        elif code == 1:
            assert any(line.startswith(("error: ", "FAIL: ", "DIFFERS: ")) for line in [*lines, *out.splitlines()]), (
                what
            )
        new = self._listing() - before
        assert not [name for name in new if name.endswith(".tmp")], f"{new} {what}"
        assert not (code == 2 and (new or self._content() != content)), f"{new} {what}"
        if "." not in arguments:  # which may name the working directory itself
            allowed = {"runs", "scans", "surfaces.rrd"} | self._allowed(arguments)
            assert {name.split("/")[0] for name in new} <= allowed, f"{new} {what}"
        assert not {"MUJOCO_LOG.TXT"} & new, what
        assert (self.folder / "taken.xml").is_file() and (self.folder / "pipe").is_fifo(), what
        assert (self.folder / "foreign" / "report.json").exists() and Path("/dev/null").is_char_device(), what
        return code

    def _listing(self) -> set[str]:
        """Every path below the working directory."""
        return {str(path.relative_to(self.folder)) for path in self.folder.rglob("*")}

    def _content(self) -> dict[str, tuple[int, int]]:
        """Size and time of change of every plain file below the working directory."""
        files = [path for path in self.folder.rglob("*") if path.is_file() and not path.is_symlink()]
        return {str(path): (path.stat().st_size, path.stat().st_mtime_ns) for path in files}

    def _allowed(self, arguments: list[str]) -> set[str]:
        """First parts of the paths that the arguments name as outputs."""
        named = {word.partition("=")[2] if word.startswith("--picture=") else word for word in arguments}
        if "--to" in arguments:  # where nothing else is named, an export lies beside its run
            named |= {f"{word}-{form}" for word in arguments for form in FORMATS}
        places = [Path(os.path.realpath(self.folder / name)) for name in named]
        below = [place.relative_to(self.folder) for place in places if self.folder in place.parents]
        return {place.parts[0] for place in below}


@pytest.fixture
def commands(tmp_path, walk_folder):
    made = Commands(tmp_path, walk_folder)
    yield made
    made.close()


def some_plan(folder: Path) -> dict:
    run = make_run()
    write_plan(folder / "plan.json", run.plan, run.solution)
    return json.loads((folder / "plan.json").read_text())


ODD_JSON = [
    None, True, 0, -1, 1.5, 10**400, -(10**400), 1e308, float("nan"), float("inf"), "", "x", "left_foot", "make", [],
    {}, [[]], [1, 2, 3], [1, 2, 3, 4], [0, 0, 0, 0], [None] * 3, [10**400] * 4, {"a": 1}, 2**31, 2**63, 2**64,
]  # fmt: skip


def damaged(value, rng: np.random.Generator):
    """A copy of a JSON value, in which one thing somewhere is another one, is missing, or is there twice."""
    if isinstance(value, (dict, list)) and value and rng.random() < 0.85:
        copy = dict(value) if isinstance(value, dict) else list(value)
        key = list(copy)[int(rng.integers(len(copy)))] if isinstance(copy, dict) else int(rng.integers(len(copy)))
        if rng.random() < 0.15:
            del copy[key]
        elif isinstance(copy, list) and rng.random() < 0.1:
            copy.insert(key, copy[key])
        else:
            copy[key] = damaged(copy[key], rng)
        return copy
    return ODD_JSON[int(rng.integers(len(ODD_JSON)))]


def check_plan(plan: dict, path: Path, rng: np.random.Generator) -> bool:
    """Read a damaged plan; whether it was accepted."""
    for _ in range(int(rng.integers(1, 4))):
        plan = damaged(plan, rng)
    text = json.dumps(plan).encode()
    if rng.random() < 0.1:
        place = int(rng.integers(len(text)))
        text = text[:place] + bytes(rng.integers(0, 256, 3).tolist()) * int(rng.choice([0, 1, 50_000])) + text[place:]
    path.write_bytes(text)
    try:
        sequence = read_plan(path)
    except InputError as error:
        assert str(path) in str(error) and "\n" not in str(error), str(error)
        return False
    for stance in sequence.stances:
        for contact in stance.contacts:
            assert np.isfinite(contact.pose.matrix).all() and 0 < contact.friction < np.inf
    assert np.isfinite(sequence.duration)
    return True


def test_some_odd_command_lines(commands):
    rng = np.random.default_rng(20)
    lines = [command_line(rng) for _ in range(80)]
    for module, arguments in [line for line in lines if line[0] in ("toolkit.terrain", "toolkit.surfaces")][:25]:
        commands.check(module, arguments)


def test_some_odd_command_lines_on_runs_and_scans(commands):
    for number in range(16):
        rng = np.random.default_rng([20, number])
        commands.check(*run_command(rng, odd, odd_options), hurting=rng)


def test_some_damaged_plans(tmp_path):
    rng, plan = np.random.default_rng(SEED), some_plan(tmp_path)
    taken = sum(check_plan(plan, tmp_path / "plan.json", rng) for _ in range(300))
    assert 0 < taken < 300


@pytest.mark.slow
def test_odd_command_lines_for_long(commands):
    counts: Counter = Counter()
    failures: list[str] = []
    for planner in ("auto", "optimiser", "kinematic", "quasi-static"):  # compiles what is not on the disk yet
        words = ["world.xml", "--no-recording", "--candidates=1", "--expansions=20", f"--planner={planner}"]
        commands.check("toolkit.validate", words, limit=1800)
    end, number = time.monotonic() + seconds("commands"), 0
    while time.monotonic() < end:
        rng = np.random.default_rng([SEED, number])
        on_runs = number % 2 == 1
        line = run_command(rng, odd, odd_options) if on_runs else command_line(rng)
        try:
            counts[line[0], commands.check(*line, hurting=rng if on_runs else None)] += 1
        except AssertionError as error:
            failures.append(f"case {number} of seed {SEED}: {error}")
        number += 1
    sys.stdout.write(f"\n{number} command lines: {dict(counts)}, {len(failures)} failures\n")
    assert not failures, "\n\n".join(failures[:20])


@pytest.mark.slow
def test_damaged_plans_for_long(tmp_path):
    plan = some_plan(tmp_path)
    end, number, taken = time.monotonic() + seconds("plans"), 0, 0
    while time.monotonic() < end:
        taken += check_plan(plan, tmp_path / "plan.json", np.random.default_rng([SEED, number]))
        number += 1
    sys.stdout.write(f"\n{number} plans, {taken} of them accepted\n")
