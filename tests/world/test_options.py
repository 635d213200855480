"""Every option of MuJoCo that a world can set is replaced or refused, and the README says which."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.world.conftest import mjcf_of
from toolkit.errors import WorldError
from toolkit.mjcf import fields_of
from toolkit.world.loader import load_world
from toolkit.world.options import REPLACED, REPLACED_FLAGS, check_options, flag_name, flags_of

README = (Path(__file__).resolve().parents[2] / "worlds" / "README.md").read_text()
FLOOR = '<geom name="floor" type="plane" size="0 0 1"/>'
FIELDS = [name for name, _ in fields_of(mujoco.MjSpec().option)]
FLAGS = [(field, flag) for field in ("disableflags", "enableflags") for flag in flags_of(field)]


def decided(kind, verdict):
    """Names in the README's row of options, or of flags, with a verdict."""
    row = next(line for line in README.splitlines() if line.startswith(f"| {kind}") and f"| {verdict} |" in line)
    return set(re.findall(r"`(\w+)`", row.split("|")[2]))


def test_the_readme_decides_every_option():
    assert decided("option", "replaced") == REPLACED
    assert decided("option", "refused") == set(FIELDS) - REPLACED - {"disableflags", "enableflags"}
    assert decided("flag", "replaced") == REPLACED_FLAGS
    assert decided("flag", "refused") == {flag_name(flag) for _, flag in FLAGS} - REPLACED_FLAGS


@pytest.mark.parametrize("name", FIELDS)
def test_every_field_is_refused_or_replaced(name):
    option = mujoco.MjSpec().option
    check_options(Path("world.xml"), option)
    if name not in ("disableflags", "enableflags"):
        value = getattr(option, name)
        setattr(option, name, value + 1 if np.isscalar(value) else np.asarray(value) + 1.0)
        if name in REPLACED:
            check_options(Path("world.xml"), option)
        else:
            with pytest.raises(WorldError, match=f"world.xml: option {name} is .* know only .*; remove it from <opt"):
                check_options(Path("world.xml"), option)


@pytest.mark.parametrize(("field", "flag"), FLAGS, ids=lambda item: getattr(item, "name", ""))
def test_every_flag_is_refused_or_replaced(field, flag):
    option = mujoco.MjSpec().option
    setattr(option, field, flag.value)
    if flag_name(flag) in REPLACED_FLAGS:
        check_options(Path("world.xml"), option)
    else:
        with pytest.raises(WorldError, match=f"flag '{flag_name(flag)}' of <option> is not as usual"):
            check_options(Path("world.xml"), option)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ('gravity="0 0 -1.62"', "option gravity is 0 0 -1.62; planner and simulation know only 0 0 -9.81; remove it"),
        ('gravity="0 0 0"', "option gravity is 0 0 0"),
        ('gravity="1 0 -9.7"', "option gravity is 1 0 -9.7"),
        ('wind="5 0 0" density="1.2"', "option density is 1.2; planner and simulation know only 0"),
    ],
)
def test_physics_of_another_place_is_refused(option, message, tmp_path):
    path = tmp_path / "moon.xml"
    path.write_text(mjcf_of(FLOOR, more=f"<option {option}/>"))
    with pytest.raises(WorldError, match=message):
        load_world(path)
