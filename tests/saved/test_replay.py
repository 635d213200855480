"""`python -m toolkit.replay`."""

import json
import subprocess
import sys

import imageio_ffmpeg
import numpy as np
import pytest

from tests.saved import damage
from tests.saved.conftest import called
from toolkit import replay
from toolkit.errors import InputError
from toolkit.report import offscreen, viewer


def test_a_run_passes_once_more(walk_folder, capsys):
    assert called(replay.main, walk_folder) == (0, "")
    text = capsys.readouterr().out
    assert "\nPASS\n" in text and "the same states, bit for bit" in text
    assert text.count(" PASS") >= 11  # a row for each check


def test_other_controls_are_found(copy, capsys):
    damage.array("ctrl", lambda ctrl: ctrl * (1.0 + 1e-12))(copy)
    assert called(replay.main, copy) == (1, "")
    assert "DIFFERS: the states are others from 0.00" in capsys.readouterr().out


def test_a_verdict_that_was_written_by_hand_is_found(copy, capsys):
    damage.standard(slip_limit=1e-9)(copy)
    assert called(replay.main, copy) == (1, "")
    assert "DIFFERS: slip is" in capsys.readouterr().out


def test_a_report_that_was_improved_is_found(copy, capsys):
    checks = json.loads((copy / "report.json").read_text())["checks"]
    better = [check | {"value": 0.0} if check["name"] == "torque_ratio" else check for check in checks]
    damage.edited("report.json", checks=better)(copy)
    assert called(replay.main, copy) == (1, "")
    assert "DIFFERS: torque_ratio is" in capsys.readouterr().out


def test_another_version_of_the_simulator_is_named(copy, capsys):
    damage.array("ctrl", lambda ctrl: 0.0 * ctrl)(copy)
    damage.edited("report.json", versions={"mujoco": "0.1"})(copy)
    assert called(replay.main, copy)[0] == 1
    assert "it was recorded with MuJoCo 0.1" in capsys.readouterr().out


def test_a_run_that_was_not_executed_is_refused(planned_folder):
    code, line = called(replay.main, planned_folder)
    assert code == 2 and "was never executed" in line


@pytest.mark.parametrize("name", ["no report", "a cut scene", "an older execution", "an older report"])
def test_a_damaged_folder_gets_one_line(copy, name):
    change, words = damage.DAMAGES[name]
    change(copy)
    code, line = called(replay.main, copy)
    assert code == 2 and words in line


def test_the_command_ends_in_one_line(tmp_path):
    command = [sys.executable, "-m", "toolkit.replay", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == f"error: {tmp_path}: holds no report.json, so it is not the folder of a run\n"


def test_a_recording_is_written_whole(walk_folder, tmp_path, capsys):
    out = tmp_path / "deep" / "replay.rrd"
    assert called(replay.main, walk_folder, "--rerun", out) == (0, "")
    assert out.stat().st_size > 100_000 and [path.name for path in out.parent.iterdir()] == ["replay.rrd"]
    assert f"written to {out}" in capsys.readouterr().out


def test_a_video_is_as_long_as_the_run(walk_folder, tmp_path):
    try:
        offscreen.require_rendering()
    except InputError as error:
        pytest.skip(str(error))
    out = tmp_path / "replay.mp4"
    assert called(replay.main, walk_folder, "--video", out) == (0, "")
    with np.load(walk_folder / "execution.npz") as file:
        seconds = file["tick_times"][-1]
    assert imageio_ffmpeg.count_frames_and_secs(str(out))[1] == pytest.approx(seconds, abs=0.1)
    assert [path.name for path in tmp_path.iterdir()] == ["replay.mp4"]


@pytest.mark.parametrize(("option", "name"), [("--video", "replay.avi"), ("--rerun", "replay"), ("--video", ".mp4")])
def test_files_are_known_by_their_endings(walk_folder, tmp_path, option, name):
    code, line = called(replay.main, walk_folder, option, tmp_path / name)
    assert code == 2 and "must end in" in line and not list(tmp_path.iterdir())


def test_a_folder_in_the_place_of_a_file_is_refused(walk_folder, tmp_path):
    (tmp_path / "taken.rrd").mkdir()
    code, line = called(replay.main, walk_folder, "--rerun", tmp_path / "taken.rrd")
    assert code == 2 and "choose another --rerun" in line


def test_a_machine_without_a_display_says_so_before_any_work(walk_folder, monkeypatch, capsys):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    code, line = called(replay.main, walk_folder, "--viewer")
    assert code == 2 and "no display" in line and capsys.readouterr().out == ""


def test_the_viewer_shows_the_replay_after_the_verdict(walk_folder, monkeypatch, capsys):
    shown = []
    monkeypatch.setattr(viewer, "require_display", lambda: None)
    monkeypatch.setattr(viewer, "show", lambda again: shown.append((again.completed, capsys.readouterr().out)))
    assert called(replay.main, walk_folder, "--viewer") == (0, "")
    [(completed, text)] = shown
    assert completed and "PASS" in text
