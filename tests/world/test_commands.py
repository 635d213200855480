"""The command lines for terrain and surfaces."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from toolkit import surfaces, terrain
from toolkit.errors import InputError, WorldError
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world
from toolkit.world.timing import Timing


@pytest.mark.parametrize("kind", KINDS)
def test_terrain_writes_a_world(kind, tmp_path):
    out = tmp_path / "made.xml"
    assert terrain.main([kind, "--seed", "2", "--out", str(out)]) == 0
    assert os.listdir(tmp_path) == ["made.xml"]
    assert load_world(out).surfaces


def test_terrain_goes_to_standard_output_and_takes_options(tmp_path, capsys):
    options = ["slope", "--length", "1.5", "--angle", "20", "--friction", "0.6"]
    for timing, named in (([], None), (["--shift", "0.3", "--swing", "0.5"], Timing(0.3, 0.5))):
        assert terrain.main([*options, *timing]) == 0
        world = load_world(tmp_path / "slope.xml", mjcf=capsys.readouterr().out)
        assert world.surfaces[0].friction == 0.6 and world.timing == named


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stairs", "--friction", "0"], "friction 0"),
        (["training", "--tilt", "-20"], "training: these options make no world"),
        (["stairs", "--shift", "-1"], "transition_timing"),
        (["slope", "--angle", "60"], "."),
        (["gap", "--out", "/proc/none/x.xml"], "cannot be written"),
    ],
)
def test_terrain_refuses_what_makes_no_world(arguments, message, tmp_path):
    out = [] if "--out" in arguments else ["--out", str(tmp_path / "x.xml")]
    if arguments[0] == "slope":  # a slope too steep for feet is a world all the same
        assert terrain.main([*arguments, *out]) == 0
        return
    with pytest.raises((InputError, WorldError), match=message):
        terrain.main([*arguments, *out])
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stairs", "--seed", "-1"], "-1: give a whole number from 0"),
        (["stairs", "--seed", "9" * 30], "give a whole number from 0"),
        (["rubble_field", "--rows", "100000"], "100000 is above 100, the most that is accepted"),
        (["stairs", "--steps", "0"], "0 is not above zero"),
        (["stairs", "--out", ""], "is empty; give a path"),
    ],
)
def test_terrain_names_the_bound_of_an_option_in_one_line(arguments, message, capsys):
    with pytest.raises(SystemExit, match="2"):
        terrain.main(arguments)
    line = capsys.readouterr().err
    assert message in line and line.count("\n") == 1 and line.startswith("error: ")


def test_terrain_writes_into_a_device_and_leaves_it_one(tmp_path):
    assert terrain.main(["gap", "--out", "/dev/null"]) == 0
    assert Path("/dev/null").is_char_device()
    with pytest.raises(InputError, match="No space left"):
        terrain.main(["gap", "--out", "/dev/full"])


def test_surfaces_prints_a_row_for_each(tmp_path, capsys):
    world = tmp_path / "stairs.xml"
    terrain.main(["stairs", "--out", str(world)])
    assert surfaces.main([str(world)]) == 0
    out = capsys.readouterr().out
    loaded = load_world(world)
    assert f"{len(loaded.surfaces)} surfaces, 5 for feet" in out
    assert "landing" in out and "0.7" in out
    assert os.listdir(tmp_path) == ["stairs.xml"]


def test_surfaces_writes_a_recording(tmp_path):
    world = tmp_path / "rubble.xml"
    terrain.main(["rubble_corridor", "--out", str(world)])
    assert surfaces.main([str(world), "--out", str(tmp_path / "look" / "here")]) == 0
    assert os.listdir(tmp_path / "look" / "here") == ["surfaces.rrd"]
    reader = RrdReader(tmp_path / "look" / "here" / "surfaces.rrd")
    (store,) = reader.recordings()
    names = {chunk.entity_path for chunk in reader.stream(store=store)}
    assert {"/world/surfaces/foot/fill", "/world/surfaces/palm/outline", "/world/surfaces/foot/normals"} <= names
    assert {"/world/scene/tile_0_0", "/world/start", "/world/goal"} <= names
    assert len(reader.blueprints()) == 1


def test_bad_input_leaves_one_line_and_nothing_else(tmp_path):
    (tmp_path / "bad.xml").write_text("<mujoco/>")
    (tmp_path / "file").write_text("")
    for command, line in (
        (["toolkit.surfaces", "bad.xml", "--out", "look"], "error: bad.xml: no site 'start'"),
        (["toolkit.surfaces", "none.xml"], "error: none.xml: no such world file"),
        (["toolkit.terrain", "stairs", "--out", "file/x.xml"], "error: file/x.xml: cannot be written"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", *command], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 2
        assert done.stderr.startswith(line) and done.stderr.count("\n") == 1
        assert sorted(os.listdir(tmp_path)) == ["bad.xml", "file"]


def test_surfaces_into_a_place_that_cannot_be_written(tmp_path):
    world = tmp_path / "gap.xml"
    terrain.main(["gap", "--out", str(world)])
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="taken.*cannot be written"):
        surfaces.main([str(world), "--out", str(tmp_path / "taken" / "deeper")])
    assert sorted(os.listdir(tmp_path)) == ["gap.xml", "taken"]


def test_a_name_with_brackets_is_shown_as_it_is(tmp_path, capsys):
    path = tmp_path / "[red]x.xml"
    path.write_text(KINDS["stairs"](None))
    assert surfaces.main([str(path)]) == 0
    assert "[red]x: 13 surfaces" in capsys.readouterr().out
