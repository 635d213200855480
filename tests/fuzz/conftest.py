"""The folder of a short walk, as the tests of saved runs have it."""

from tests.saved.conftest import walk_folder, walk_world  # noqa: F401
