"""`python -m toolkit.robots`."""

from __future__ import annotations

import os
from pathlib import Path

import imageio.v3 as imageio
import pytest

from tests.robot.samples import TOML, write_robot
from tests.shipped_robots import OWN
from toolkit import robots
from toolkit.errors import InputError, PackageError, RobotError, ToolkitError
from toolkit.robot.loader import find_robots, load_robot
from toolkit.search.moves.occupancy import BodyBox


@pytest.mark.slow
def test_lists_every_robot(capsys: pytest.CaptureFixture) -> None:
    assert robots.main([]) == 0
    text = capsys.readouterr().out
    for name in find_robots():
        assert name in text


def test_a_missing_package_hinders_no_other_robot(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write_robot(tmp_path / "good")
    toml = TOML.replace("[model]", '[model]\npackage = "no-such-package"')
    write_robot(tmp_path / "far", toml=toml)
    assert robots.main(["--robots", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "41.2" in text and "package missing" in text and "`pip install no-such-package`" in text
    assert load_robot("good", tmp_path).name == "good"
    with pytest.raises(PackageError, match="package 'no-such-package' is not installed; `pip install") as error:
        robots.main(["far", "--robots", str(tmp_path)])
    assert error.value.exit_code == 2


def test_names_the_broken_one(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write_robot(tmp_path / "good")
    write_robot(tmp_path / "bad", toml="[model]\n")
    assert robots.main(["--robots", str(tmp_path)]) == 2
    text = capsys.readouterr().out
    assert "good" in text and "41.2" in text
    assert "cannot be loaded" in text and "'licence' is missing" in text


def test_describes_one(capsys: pytest.CaptureFixture) -> None:
    assert robots.main([OWN[0]]) == 0
    text = capsys.readouterr().out
    assert "left_foot" in text and "right_foot" in text and "licence" in text
    body = BodyBox.of(load_robot(OWN[0]))
    assert f"{2 * body.half_width:.2f} m wide" in text


def test_bad_arguments(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="no robot in .*: a robot is a folder with a robot.toml"):
        robots.main(["--robots", str(tmp_path)])
    with pytest.raises(InputError, match="--picture needs the name of a robot"):
        robots.main(["--picture", "a.png"])
    with pytest.raises(InputError, match=r"--picture a.gif: a picture ends in .png or .jpg"):
        robots.main([OWN[0], "--picture", "a.gif"])


def test_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not os.environ.get("MUJOCO_GL"):
        monkeypatch.setenv("MUJOCO_GL", "egl")
    path = tmp_path / "pictures" / "robot.png"
    try:
        assert robots.main([OWN[0], "--picture", str(path)]) == 0
    except ToolkitError as error:
        pytest.skip(str(error))  # no OpenGL on this machine: the message says what to install
    pixels = imageio.imread(path)
    assert pixels.shape == (1200, 900, 3)
    middle = pixels[100:1100, 300:600].reshape(-1, 3)
    assert middle.std(0).min() > 20, "an empty picture"
