"""A disk that is full is one line and leaves nothing, however much fits."""

import os
import resource
from contextlib import contextmanager

import pytest

from tests.report.test_run import ALL
from toolkit.errors import InputError
from toolkit.report import offscreen
from toolkit.report.files import RunFolder
from toolkit.report.run import RunOptions, write_run


@contextmanager
def largest_file(size):
    """No file of this process can grow beyond so many bytes."""
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, usual[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)


def sizes_of(run, folder, options):
    with RunFolder(folder, "w", "r") as draft:
        write_run(draft.path, run.result, options)
    return {path.name: path.stat().st_size for path in folder.iterdir()}


def refuse_each(run, tmp_path, options):
    sizes = sizes_of(run, tmp_path / "whole", options)
    for name, size in sizes.items():
        with largest_file(int(0.97 * size)), pytest.raises(InputError, match="run: cannot be written"):
            sizes_of(run, tmp_path / "run", options)
        assert os.listdir(tmp_path) == ["whole"], name
    return set(sizes)


def test_a_file_that_does_not_fit(run, tmp_path):
    assert refuse_each(run, tmp_path, RunOptions()) == ALL


@pytest.mark.slow
def test_a_picture_or_a_video_that_does_not_fit(run, tmp_path):
    try:
        offscreen.require_rendering()
    except InputError as error:
        pytest.skip(str(error))
    options = RunOptions(recording=False, pictures=True, video=True)
    assert {"plan.png", "execution.png", "strip.png", "video.mp4"} < refuse_each(run, tmp_path, options)
