"""The gallery draws runs that are there, tells their figures, and says so where one failed."""

import re

import pytest
from PIL import Image

from tests.exchange.conftest import write_walk
from toolkit.errors import InputError
from toolkit.report.files import read_json, write_json
from validation.gallery import PAGE, main


@pytest.fixture
def words(walking, walked, tmp_path):
    (tmp_path / "runs" / "flat").mkdir(parents=True)
    write_walk(tmp_path / "runs" / "flat", walking, walked)
    return ["--worlds", "flat", "--out", str(tmp_path / "runs"), "--results", str(tmp_path / "page")]


def test_a_run_that_is_there_is_drawn(words, tmp_path, walked):
    code = main(words)
    text = (tmp_path / "page" / PAGE).read_text()
    assert code == (0 if walked.failure is None else 1)
    for name in re.findall(r"!\[.*?\]\((.*?)\)", text):
        assert (tmp_path / "page" / name).is_file()
    with Image.open(tmp_path / "page" / "flat.jpg") as picture:
        assert picture.size == (960, 540)
    with Image.open(tmp_path / "page" / "flat.gif") as picture:
        assert picture.n_frames > 10
    assert (tmp_path / "page" / "flat.gif").stat().st_size < 2_000_000
    row = next(line for line in text.splitlines() if line.startswith("| flat |"))
    assert f"{1e3 * walked.max_slip:.1f}" in row and f"{walked.simulated_seconds:.1f}" in row


def test_a_failure_is_told(words, tmp_path):
    path = tmp_path / "runs" / "flat" / "report.json"
    write_json(path, read_json(path) | {"verdict": "FAIL", "reason": "the robot fell: tilted"})
    assert main(words) == 1
    assert "failed: the robot fell: tilted." in (tmp_path / "page" / PAGE).read_text()


def test_what_moves_is_one_of_the_worlds(words, tmp_path):
    with pytest.raises(InputError, match="--moving stairs: is none of --worlds; name one of flat"):
        main([*words, "--moving", "stairs"])
    assert not (tmp_path / "page").exists()
