"""A disk that is full is one line and leaves nothing, however much fits."""

import os
import resource
from argparse import Namespace
from contextlib import contextmanager

import pytest

from tests.report.test_run import ALL, PLAIN, result_of
from toolkit.errors import InputError
from toolkit.report import offscreen
from toolkit.report.files import RunFolder
from toolkit.report.run import write_run


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
        write_run(draft.path, result_of(run), options, 0.1)
    return {path.name: path.stat().st_size for path in folder.iterdir()}


def refuse_each(run, tmp_path, options):
    sizes = sizes_of(run, tmp_path / "whole", options)
    for name, size in sizes.items():
        with largest_file(int(0.97 * size)), pytest.raises(InputError, match="run: cannot be written"):
            sizes_of(run, tmp_path / "run", options)
        assert os.listdir(tmp_path) == ["whole"], name
    return set(sizes)


def test_a_file_that_does_not_fit(run, tmp_path):
    assert refuse_each(run, tmp_path, Namespace(**PLAIN)) == ALL


@pytest.mark.slow
def test_a_picture_or_a_video_that_does_not_fit(run, tmp_path):
    try:
        offscreen.require_rendering()
    except InputError as error:
        pytest.skip(str(error))
    options = Namespace(**(PLAIN | dict(pictures=True, video=True, no_recording=True)))
    assert {"plan.png", "execution.png", "strip.png", "video.mp4"} < refuse_each(run, tmp_path, options)
