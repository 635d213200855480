"""The folder of a short walk, and a copy that may be damaged, as the tests of saved runs have them."""

from tests.saved.conftest import copy, walk_folder, walk_world  # noqa: F401
