"""The main command: a verdict on good worlds, one clear line on bad ones, and nothing half-written."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
WORLDS = sorted((ROOT / "worlds").glob("*.xml"))

GOOD = """
<mujoco>
  <option><flag warmstart="enable"/></option>
  <custom><numeric name="transition_timing" data="0.3 0.5"/></custom>
  <worldbody>
    <geom name="floor" type="box" size="2 1 0.1" pos="0.5 0 -0.1" friction="0.6"/>
    {extra}
    <site name="start" pos="0 0 0"/>
    <site name="goal" type="cylinder" pos="0.5 0 0" size="0.2 0.02"/>
  </worldbody>
</mujoco>
"""


def world_text(extra: str = "", **changes: str) -> str:
    text = GOOD.format(extra=extra)
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    return text


def validate(
    world: Path, out: Path, *options: str, threads: int = 1, patience: float = 120
) -> subprocess.CompletedProcess:
    environment = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), str(threads))
    command = [sys.executable, "-m", "toolkit.validate", str(world), "--out", str(out), "--no-recording", *options]
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=patience, check=False
    )


BAD_WORLDS = {
    "broken XML": (world_text(end=("</mujoco>", "")), 2, "XML"),
    "no start": (world_text(start=('<site name="start" pos="0 0 0"/>', "")), 2, "start"),
    "no goal": (world_text(goal=('name="goal"', 'name="gaol"')), 2, "goal"),
    "start in the air": (world_text(start=('name="start" pos="0 0 0"', 'name="start" pos="0 0 2"')), 2, "start"),
    "no usable surface": (world_text(floor=('type="box" size="2 1 0.1"', 'type="sphere" size="0.1"')), 2, "surface"),
    "zero friction": (world_text(mu=('friction="0.6"', 'friction="0"')), 2, "friction"),
    "a moving body": (world_text('<body pos="0 2 1"><freejoint/><geom size="0.1"/></body>'), 2, "static"),
    "NaN": (world_text(goal=('pos="0.5 0 0"', 'pos="nan 0 0"')), 2, ""),
    "a goal nothing leads to": (world_text(goal=('pos="0.5 0 0" size', 'pos="9 0 0" size')), 1, "goal"),
    "a ceiling too low": (world_text('<geom type="box" size="3 3 0.1" pos="0 0 1.2" friction="0.6"/>'), 1, ""),
    "palms without a wall": (
        world_text(
            '<site name="start_left_palm" pos="0.2 0.6 1.2"/>', floor=('type="box" size="2', 'type="plane" size="2')
        ),
        2,
        "add a wall beside",
    ),
    "palms with nothing but the floor's edges": (
        world_text('<site name="start_left_palm" pos="0.2 0.6 1.2"/>'),
        2,
        "add a wall there",
    ),
    "a wall out of reach": (
        world_text('<geom type="box" size="1 0.1 1" pos="0 2 1"/><site name="start_left_palm" pos="0.2 1.9 1.2"/>'),
        2,
        "out of reach",
    ),
    "timing of zero": (world_text(timing=('data="0.3 0.5"', 'data="0 0.5"')), 2, "transition_timing"),
}


@pytest.mark.parametrize(("text", "code", "word"), BAD_WORLDS.values(), ids=BAD_WORLDS.keys())
def test_a_bad_world_gets_one_clear_line(tmp_path, text, code, word):
    world = tmp_path / "bad.xml"
    world.write_text(text)
    out = tmp_path / "run"
    result = validate(world, out)
    assert result.returncode == code, result.stdout + result.stderr
    assert "Traceback" not in result.stdout + result.stderr
    lines = [line for line in (result.stderr if code == 2 else result.stderr + result.stdout).splitlines() if line]
    message = next(line for line in lines if line.startswith(("error: ", "FAIL: ")))
    assert word in message
    if code == 2:
        assert len(lines) == 1
        assert "bad.xml" in message
        assert not out.exists()
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".tmp")]


def test_a_missing_world_and_an_unknown_robot_get_one_clear_line(tmp_path):
    result = validate(tmp_path / "nowhere.xml", tmp_path / "run")
    assert result.returncode == 2
    assert "nowhere.xml" in result.stderr
    world = tmp_path / "good.xml"
    world.write_text(world_text())
    result = validate(world, tmp_path / "run", "--robot", "nobody")
    assert result.returncode == 2
    assert "nobody" in result.stderr
    robots = tmp_path / "robots"
    shutil.copytree(next(ROOT.glob("robots/*/robot.toml")).parent, robots / "copy")
    toml = robots / "copy" / "robot.toml"
    toml.write_text(toml.read_text().replace("[limbs.left_foot]", "[limbs.left_fot]"))
    result = validate(world, tmp_path / "run", "--robot", "copy", "--robots", str(robots))
    assert result.returncode == 2
    assert "left_fot" in result.stderr
    assert "left_foot" in result.stderr
    assert not (tmp_path / "run").exists()


def test_palms_at_the_start_and_no_palms_contradict_each_other(tmp_path):
    world, out = tmp_path / "wall.xml", tmp_path / "run"
    wall = '<geom type="box" size="1 0.1 1" pos="0 0.7 1"/><site name="start_left_palm" pos="0.2 0.6 1.2"/>'
    world.write_text(world_text(wall))
    result = validate(world, out, "--no-palms")
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert "leave out --no-palms" in result.stderr and "start_left_palm" in result.stderr
    assert not out.exists()


def replayed(folder: Path) -> tuple[np.ndarray, np.ndarray, mujoco.MjModel]:
    """Final qpos of a replay in plain MuJoCo, the recorded one, and the model."""
    model = mujoco.MjModel.from_binary_path(str(folder / "scene.mjb"))
    data = mujoco.MjData(model)
    with np.load(folder / "execution.npz") as file:
        run = dict(file)
    data.qpos[:], data.qvel[:] = run["qpos0"], run["qvel0"]
    for ctrl in run["ctrl"]:
        data.ctrl[:] = ctrl
        mujoco.mj_step(model, data)
    return data.qpos.copy(), run["qpos"][-1], model


def test_a_good_world_passes_and_replays_exactly(tmp_path):
    world = tmp_path / "good.xml"
    world.write_text(world_text())
    out = tmp_path / "run"
    result = validate(world, out, "--seed", "3")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "PASS" in result.stdout.splitlines()
    report = json.loads((out / "report.json").read_text())
    assert report["verdict"] == "PASS"
    assert report["seed"] == 3
    assert {check["result"] for check in report["checks"]} == {"PASS"}
    replay, recorded, model = replayed(out)
    np.testing.assert_array_equal(replay, recorded)
    assert model.neq == 0
    assert model.nmocap == 0
    assert np.abs(model.body_gravcomp).max() == 0
    # The same seed gives the same files, whatever the threads.
    again = tmp_path / "again"
    assert validate(world, again, "--seed", "3", threads=2).returncode == 0
    for name in ("plan.json", "motion.npz", "execution.npz", "scene.mjb"):
        assert (again / name).read_bytes() == (out / name).read_bytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS, ids=lambda path: path.stem)
def test_the_same_seed_gives_the_same_files_whatever_the_threads(tmp_path, world):
    for threads in (1, 1, 2):  # the first run compiles what is not on the disk yet, which may change a last digit
        result = validate(world, tmp_path / str(threads), "--time-limit", "900", threads=threads, patience=1800)
        assert result.returncode == 0, result.stdout + result.stderr
    for name in ("plan.json", "motion.npz", "execution.npz", "scene.mjb"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("world", WORLDS, ids=lambda path: path.stem)
def test_every_shipped_world_passes(tmp_path, world, seed):
    result = validate(world, tmp_path / "run", "--seed", str(seed))
    assert result.returncode == 0, result.stdout + result.stderr
