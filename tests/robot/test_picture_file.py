"""A robot's picture is whole or not there."""

import os

import numpy as np
import pytest

from tests.shipped_robots import OWN
from toolkit import robots
from toolkit.errors import InputError
from toolkit.robot import picture


def test_a_picture_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    monkeypatch.setattr(picture, "render_home", lambda robot: np.zeros((8, 8, 3), np.uint8))
    name = OWN[0]
    for ending in (".png", ".JPG"):
        assert robots.main([name, "--picture", str(tmp_path / f"a{ending}")]) == 0
    assert sorted(os.listdir(tmp_path)) == ["a.JPG", "a.png"]
    (tmp_path / "full.png").symlink_to("/dev/full")
    with pytest.raises(InputError, match="No space left.*choose another --picture"):
        robots.main([name, "--picture", str(tmp_path / "full.png")])
    with pytest.raises(InputError, match="cannot be written"):
        robots.main([name, "--picture", str(tmp_path / "a.png" / "b.png")])
    assert sorted(os.listdir(tmp_path)) == ["a.JPG", "a.png", "full.png"]
