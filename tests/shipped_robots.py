"""The robots that come with the toolkit, as parameters of tests.

What holds for any robot's model is tested with all of them; those whose package is not installed are skipped. Plans and
motions, which take long, are tested with the robots whose model lies in their folder.
"""

import pytest

from toolkit.errors import PackageError
from toolkit.robot.description import FILE_NAME, read_description
from toolkit.robot.loader import find_robots, robots_folder
from toolkit.robot.source import find_model_file

_DESCRIPTIONS = {name: read_description(robots_folder() / name / FILE_NAME) for name in find_robots()}


def _missing(name: str) -> str:
    """What hinders a robot from being loaded here; empty where its model is installed."""
    try:
        find_model_file(_DESCRIPTIONS[name])
    except PackageError as error:
        return str(error)
    return ""


OWN = [name for name, description in _DESCRIPTIONS.items() if description.package is None]
"""Names of the robots whose model lies in their folder."""

EVERY = [
    pytest.param(name, marks=pytest.mark.skipif(bool(reason), reason=reason or "its package is installed"))
    for name, reason in ((name, _missing(name)) for name in _DESCRIPTIONS)
]
"""Parameters for all robots; those whose package is missing are skipped."""
