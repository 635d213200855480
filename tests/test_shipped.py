"""Robots and worlds that come with the toolkit are found from any folder, in a checkout and in a wheel."""

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from toolkit.errors import WorldError
from toolkit.robot.loader import find_robots, robots_folder
from toolkit.shipped import INSIDE, shipped
from toolkit.world.loader import find_world, load_world

ROOT = Path(__file__).resolve().parent.parent
WORLDS = sorted(path.stem for path in (ROOT / "worlds").glob("*.xml"))


@pytest.mark.parametrize("name", WORLDS)
def test_worlds_have_names_everywhere(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert find_world(Path(name)) == ROOT / "worlds" / f"{name}.xml"


def test_robots_are_found_everywhere(monkeypatch, tmp_path):
    here = find_robots()
    monkeypatch.chdir(tmp_path)
    assert robots_folder() == shipped("robots") and find_robots() == here != ()


def test_files_come_before_names_and_worlds_here_before_those_shipped(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    name = WORLDS[0]
    (tmp_path / name).mkdir()
    assert find_world(Path(name)) == shipped("worlds") / f"{name}.xml"  # a folder is no world
    (tmp_path / "worlds").mkdir()
    (tmp_path / "worlds" / f"{name}.xml").write_text("<mujoco/>")
    assert find_world(Path(name)) == Path("worlds") / f"{name}.xml"
    (tmp_path / name).rmdir()
    (tmp_path / name).write_text("<mujoco/>")
    assert find_world(Path(name)) == Path(name)


def test_a_name_that_is_none_gets_a_list(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(WorldError, match=f"nowhere: no such world file; .* one of .*{WORLDS[0]}"):
        load_world("nowhere")
    with pytest.raises(WorldError, match="nowhere.xml: no such world file; give the path of an MJCF file$"):
        load_world("nowhere.xml")


@pytest.mark.slow
def test_a_wheel_holds_all_and_works_in_an_empty_folder(tmp_path):
    known = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(*words, cwd=tmp_path):
        done = subprocess.run(
            [str(word) for word in words], cwd=cwd, env=known, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    build = ("-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path)  # nothing is fetched
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for name in ("toolkit", "robots", "worlds"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    run(sys.executable, *build, source)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as content:
        inside = set(content.namelist())
    for kind in ("robots", "worlds"):
        for path in (source / kind).rglob("*"):
            assert path.is_dir() or f"toolkit/{INSIDE}/{path.relative_to(source).as_posix()}" in inside
    venv.create(tmp_path / "venv", with_pip=False)
    paths = sysconfig.get_paths(vars={"base": str(tmp_path / "venv"), "platbase": str(tmp_path / "venv")})
    with zipfile.ZipFile(wheel) as content:
        content.extractall(paths["purelib"])
    packages = [path for path in sys.path if "site-packages" in path]  # everything but the toolkit
    Path(paths["purelib"], "packages.pth").write_text("\n".join(packages) + "\n")
    empty = tmp_path / "empty"
    empty.mkdir()
    python = tmp_path / "venv" / "bin" / "python"
    place = run(python, "-c", "import toolkit; print(toolkit.__file__)", cwd=empty)
    assert place.startswith(str(tmp_path))
    run(python, "-m", "toolkit.validate", "flat", "--no-recording", "--out", "walk", cwd=empty)
    run(python, "-m", "toolkit.export", "walk", "--to", "mjlab", cwd=empty)
    assert (empty / "walk-mjlab" / "motion.npz").is_file()
