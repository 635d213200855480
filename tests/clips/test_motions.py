"""A tiny data set: every file of it can be used without the toolkit, and it is the same whoever makes it."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pyarrow.parquet
import pytest

from toolkit import export, replay
from toolkit.clips.attempt import ATTEMPTS, CLIPS, RUNS
from toolkit.clips.index import INDEX
from toolkit.clips.sheet import write_sheet
from toolkit.clips.statistics import SHEET, STATISTICS
from toolkit.dataset import main

CLOSE = 2e-6  # robot.xml has six digits
WORDS = ["--kinds", "flat,stairs", "--hours", "0.006", "--expansions", "100", "--planner", "kinematic", "--seed", "1"]
CLOCK = ("report.json", "metadata.json")  # these have times of a clock, or versions
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data") / "motions"
    assert main([*WORDS, "--workers", "1", "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def rows(data):
    found = pyarrow.parquet.read_table(data / INDEX).to_pylist()
    assert {row["kind"] for row in found} <= {"flat", "stairs"} and len(found) >= 2
    return found


def contents(folder):
    """What is the same in every data set of these settings."""
    paths = [p for p in sorted(folder.rglob("*")) if p.is_file() and p.parent.name != ATTEMPTS and p.name not in CLOCK]
    return {str(p.relative_to(folder)): p.read_bytes() for p in paths if p.parent != folder or p.name == INDEX}


def test_plain_mujoco_replays_every_clip_from_its_files_alone(data, rows):
    for row in rows:
        scene = mujoco.MjModel.from_binary_path(str(data / row["run"] / "scene.mjb"))
        state = mujoco.MjData(scene)
        with np.load(data / row["run"] / "execution.npz") as run:
            state.qpos[:], state.qvel[:] = run["qpos0"], run["qvel0"]
            for control in run["ctrl"]:
                state.ctrl[:] = control
                mujoco.mj_step(scene, state)
            assert np.array_equal(state.qpos, run["qpos"][-1])
        assert replay.main([str(data / row["run"])]) == 0


def test_the_states_of_every_clip_put_its_robot_where_it_says_on_its_terrain(data, rows):
    for row in rows:
        clip = data / row["clip"]
        spec = mujoco.MjSpec.from_file(str(clip / "terrain.xml"))
        robot = mujoco.MjSpec.from_file(str(data / "robot" / "robot.xml"))
        spec.attach(robot, prefix="robot/", frame=spec.worldbody.add_frame())
        model = spec.compile()
        state, names = mujoco.MjData(model), json.loads((clip / "metadata.json").read_text())
        with np.load(clip / "trajectory.npz") as columns:
            assert len(columns["time"]) == row["frames"]
            for frame in range(0, row["frames"], 25):
                values = [columns[f"root_pos_{axis}"][frame] for axis in "xyz"]
                values += [columns[f"root_quat_{axis}"][frame] for axis in "wxyz"]
                state.qpos[:] = values + [columns[f"pos_{joint}"][frame] for joint in names["joint_names"]]
                mujoco.mj_forward(model, state)
                assert all(contact.dist > -5e-3 for contact in state.contact)
                for limb in names["limbs"]:
                    where = [columns[f"{limb}_pos_{axis}"][frame] for axis in "xyz"]
                    assert np.allclose(state.site(f"robot/{limb}").xpos, where, rtol=0, atol=CLOSE)
            for limb in ("left_foot", "right_foot"):
                assert columns[f"{limb}_contact"].any() and columns[f"{limb}_planned_contact"].any()
        assert mujoco.MjModel.from_xml_path(str(clip / "world.xml")).ngeom
        assert [phase for phase in json.loads((clip / "contacts.json").read_text())["contactPhases"]]


def test_every_file_that_a_clip_names_is_there(data, rows):
    for row in rows:
        clip = data / row["clip"]
        assert all((clip / name).is_file() for name in json.loads((clip / "metadata.json").read_text())["files"])


def test_a_run_can_be_exported_again(data, rows, tmp_path):
    assert export.main([str(data / rows[0]["run"]), "--to", "mjlab", "--out", str(tmp_path / "out")]) == 0
    with np.load(tmp_path / "out" / "motion.npz") as motion:
        assert len(motion["joint_pos"]) == rows[0]["frames"]


def test_two_workers_that_begin_with_a_part_make_the_same_data_set(data, rows, tmp_path):
    other = tmp_path / "other"
    assert main([*WORDS, "--workers", "2", "--no-sheet", "--out", str(other)]) == 0
    assert contents(other) == contents(data)
    last = rows[-1]
    (other / ATTEMPTS / f"{Path(last['clip']).name}.json").unlink()
    assert main([*WORDS, "--workers", "1", "--no-sheet", "--out", str(other)]) == 0
    assert contents(other) == contents(data)
    assert {path.name for path in (other / RUNS).iterdir()} == {path.name for path in (other / CLIPS).iterdir()}


def test_there_are_statistics_and_a_page_of_pictures(data, rows, tmp_path):
    figures = json.loads((data / STATISTICS).read_text())
    assert figures["clips"] == len(rows) and figures["hours"] >= 0.006
    assert f"in {len(rows)} clips" in (data / "README.md").read_text()
    assert (data / SHEET).read_bytes().startswith(b"\xff\xd8")
    records = [json.loads(path.read_text()) for path in sorted((data / ATTEMPTS).iterdir())]
    assert write_sheet(data, records) == len(rows)
    assert write_sheet(tmp_path, records) == 0 and not list(tmp_path.iterdir())
