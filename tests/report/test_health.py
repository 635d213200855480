"""The doctor finds what is wrong, says what to do, and fails for what everybody needs."""

import importlib.metadata
import shutil
from pathlib import Path

import pytest

from toolkit import doctor
from toolkit.pipeline import Observer
from toolkit.report import health
from toolkit.report.health import (
    State,
    check_cache,
    check_kernels,
    check_packages,
    check_renderers,
    check_robots,
    check_walk,
)
from toolkit.robot.loader import default_robot, load_robot


def test_this_environment_has_what_is_needed():
    findings = list(check_packages())
    assert {finding.state for finding in findings} <= {State.GOOD, State.NOTE}
    assert {"python", "mujoco", "torch"} <= {finding.name for finding in findings}


def test_packages_that_are_missing_or_old(monkeypatch):
    wanted = ["numpy>=999", "no-such-package>=1", 'no-such-extra; extra == "train"', 'numpy<1; extra == "dev"']
    monkeypatch.setattr(importlib.metadata, "requires", lambda name: wanted)
    found = {(finding.name, finding.state, finding.detail.split(";")[-1]) for finding in list(check_packages())[2:]}
    assert found == {
        ("numpy", State.BAD, " pip install 'numpy>=999'"),
        ("no-such-package", State.BAD, " pip install 'no-such-package>=1'"),
        ("no-such-extra", State.NOTE, " pip install 'no-such-extra'"),
        ("numpy", State.NOTE, " pip install 'numpy<1'"),
    }


def test_a_toolkit_that_is_not_installed(monkeypatch):
    monkeypatch.setattr(health, "PACKAGE", "no-such-package")
    assert [finding.state for finding in check_packages()] == [State.GOOD, State.BAD]


def test_robots_networks_and_what_is_wrong_with_them(tmp_path):
    shipped = load_robot(default_robot()).folder
    for name in ("good", "bare", "alien", "broken"):
        shutil.copytree(shipped, tmp_path / name, ignore=shutil.ignore_patterns("networks"))
    shutil.copytree(shipped / "networks", tmp_path / "good" / "networks")
    (tmp_path / "alien" / "networks").mkdir()
    (tmp_path / "broken" / "robot.toml").write_text("model = 3\n")
    found = {finding.name: finding for finding in check_robots(tmp_path)}
    assert found["good, networks"].state is State.GOOD and found["bare, networks"].state is State.NOTE
    assert found["alien, networks"].state is State.BAD and "networks" in found["alien, networks"].detail
    assert found["broken"].state is State.BAD and "robot.toml" in found["broken"].detail
    assert found["robots"].state is State.NOTE  # which one is meant is not said
    empty = tmp_path / "empty"
    empty.mkdir()
    assert [finding.state for finding in check_robots(empty)] == [State.BAD]


def test_the_folder_of_kernels(monkeypatch):
    assert check_cache().state is State.GOOD and Path(check_cache().detail).is_dir()
    monkeypatch.setattr(health, "kept_folder", lambda: None)
    assert check_cache().state is State.NOTE and "NUMBA_CACHE_DIR" in check_cache().detail


def test_kernels_that_are_not_compiled_yet_are_a_note(monkeypatch):
    known = health.listed()
    monkeypatch.setattr(health, "lacking", lambda: [])
    assert [finding.state for finding in check_kernels()] == [State.GOOD]
    monkeypatch.setattr(health, "lacking", lambda: known[:2])
    (finding,) = check_kernels()
    assert finding.state is State.NOTE and finding.detail.startswith(f"{len(known) - 2} of {len(known)} are compiled;")
    monkeypatch.setattr(health, "kept_folder", lambda: None)
    assert list(check_kernels()) == []


def test_renderers_that_do_not_work_are_notes(monkeypatch):
    monkeypatch.setattr(health, "why_not", lambda name, known: "no display")
    found = list(check_renderers())
    assert [finding.state for finding in found] == [State.NOTE] * 4 and "apt-get" in found[-1].detail
    monkeypatch.setattr(health, "why_not", lambda name, known: "" if name == "osmesa" else "no display")
    assert [finding.name for finding in check_renderers() if finding.state is State.GOOD] == ["renderer osmesa"]


def test_a_walk_of_about_ten_seconds():
    finding = check_walk(None, None, Observer())
    assert finding.state is State.GOOD, finding.detail
    seconds = float(finding.detail.split(" walked for ")[1].split(" s")[0])
    assert 5.0 < seconds < 20.0  # simulated


def test_a_robot_that_is_not_there_does_not_walk():
    finding = check_walk("nobody", None, Observer())
    assert finding.state is State.BAD and "nobody" in finding.detail


def test_the_command_fails_where_something_is_wrong(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(health, "why_not", lambda name, known: "")
    assert doctor.main(["--quick"]) == 0
    assert "everything that is needed works" in capsys.readouterr().out
    assert doctor.main(["--quick", "--robots", str(tmp_path)]) == 1
    assert "FAIL: robots" in capsys.readouterr().out


@pytest.mark.slow
def test_the_command_walks():
    assert doctor.main([]) == 0
