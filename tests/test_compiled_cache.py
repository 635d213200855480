"""Compiled functions work where nothing can be kept on disk."""

import errno

import numpy as np
from numba.core import caching

from toolkit.compiled import compiled


def _doubled(values: np.ndarray) -> np.ndarray:
    return 2.0 * values


def test_a_package_and_a_home_that_cannot_be_written(monkeypatch):
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    np.testing.assert_array_equal(compiled(_doubled, kept=True, allocates=True)(np.ones(2)), [2.0, 2.0])


def test_a_disk_that_is_full(monkeypatch):
    def full(*args):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    monkeypatch.setattr(caching.IndexDataCacheFile, "load", lambda *args: None)
    np.testing.assert_array_equal(compiled(_doubled, kept=True, allocates=True)(np.ones(2)), [2.0, 2.0])


def test_an_index_that_names_a_type_which_is_no_longer_there(monkeypatch):
    def lost(*args):
        raise AttributeError("Can't get attribute 'Gone'")

    monkeypatch.setattr(caching.IndexDataCacheFile, "_load_index", lost)
    np.testing.assert_array_equal(compiled(_doubled, kept=True, allocates=True)(np.ones(2)), [2.0, 2.0])
