"""The command: a world that the others accept, two files, and one line for what is wrong."""

import os
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from rerun.chunk import RrdReader

from tests.scanning.conftest import noisy, sheet
from toolkit import scan as command
from toolkit import surfaces
from toolkit.errors import InputError
from toolkit.geometry.pose import Pose
from toolkit.scanning.building import read_scene
from toolkit.scanning.samples import Scan
from toolkit.world.clearance import BoxCollider
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world
from validation.virtual_scan import virtual_scan


def export(scan: Scan, path) -> None:
    trimesh.Trimesh(scan.vertices, scan.triangles, process=False).export(path)


def test_an_exact_mesh_keeps_its_surfaces(steps, tmp_path, capsys):
    steps.export(tmp_path / "steps.obj")
    out = tmp_path / "look"
    options = ["--start", "0.2,0", "--goal", "1,0", "--friction", "0.6", "--timing", "0.3,0.5", "--out", str(out)]
    assert command.main([str(tmp_path / "steps.obj"), *options]) == 0
    printed = capsys.readouterr().out
    assert "3 solids, 0 obstacles" in printed and "100.0%" in printed and str(out) in printed
    assert sorted(os.listdir(out)) == ["steps.rrd", "steps.xml"]
    world = load_world(out / "steps.xml")
    treads = [surface for surface in world.surfaces if surface.serves_foot]
    assert [surface.region.area for surface in treads] == pytest.approx([0.4, 0.4, 0.4], abs=2e-3)
    assert all(surface.friction == 0.6 for surface in world.surfaces)
    assert (world.timing.shift, world.timing.swing) == (0.3, 0.5)
    np.testing.assert_allclose(world.start.position, [0.2, 0, 0.15], atol=1e-6)
    np.testing.assert_allclose(world.goal.position, [1, 0, 0.45], atol=1e-6)
    assert surfaces.main([str(out / "steps.xml")]) == 0


def test_the_recording_shows_the_input_over_the_surfaces(tmp_path):
    export(noisy(sheet(Pose.from_yaw(np.zeros(3), 0.0), (1.5, 1.0)), 0.01), tmp_path / "ground.stl")
    assert command.main([str(tmp_path / "ground.stl"), "--out", str(tmp_path / "look")]) == 0
    reader = RrdReader(tmp_path / "look" / "ground.rrd")
    (store,) = reader.recordings()
    names = {chunk.entity_path for chunk in reader.stream(store=store)}
    assert {"/world/input/0", "/world/surfaces/foot/fill", "/world/start", "/world/goal"} <= names


def test_a_map_with_rough_ground_between_two_plates(tmp_path):
    rng = np.random.default_rng(0)
    heights = np.zeros((50, 120))
    heights[:, 40:80] = rng.uniform(0.0, 0.12, (50, 40))
    np.save(tmp_path / "map.npy", heights)
    assert command.main([str(tmp_path / "map.npy"), "--cell", "0.02", "--out", str(tmp_path / "o")]) == 0
    world = load_world(tmp_path / "o" / "map.xml")
    feet = [surface for surface in world.surfaces if surface.serves_foot]
    assert len(feet) == 2
    assert world.start.position[0] < 0.8 and world.goal.position[0] > 1.6
    # Nothing goes through the rough ground, and nothing is in the way over it.
    x, y = np.meshgrid(np.linspace(0.9, 1.5, 7), np.linspace(0.2, 0.8, 5))
    poses = np.tile(np.eye(4), (2 * x.size, 1, 1))
    poses[:, :2, 3] = np.tile(np.column_stack([x.ravel(), y.ravel()]), (2, 1))
    poses[:, 2, 3] = np.repeat([0.06, 0.4], x.size)
    hit = BoxCollider(world).collide(poses, np.array([0.05, 0.05, 0.04])).reshape(2, -1)
    assert hit[0].all() and not hit[1].any()


def test_two_files_are_one_scene(tmp_path):
    for number in range(2):
        export(
            noisy(sheet(Pose.from_yaw(np.array([0.9 * number, 0, 0]), 0.0), (0.8, 0.8)), 0.01),
            tmp_path / f"{number}.ply",
        )
    files = [str(tmp_path / "0.ply"), str(tmp_path / "1.ply")]
    assert command.main([*files, "--out", str(tmp_path / "o")]) == 0
    world = load_world(tmp_path / "o" / "0.xml")
    assert len(world.surfaces) == 2


def test_a_noisy_rubble_field_keeps_its_tiles():
    from validation.scan_trial import compared, made_of

    world = load_world("field.xml", mjcf=KINDS["rubble_field"](np.random.default_rng(3), rows=2))
    scan = virtual_scan(world, np.random.default_rng(3))
    found = compared(world, made_of(world, read_scene([scan]), "field").world)
    assert found["surfaces"] == 8 and found["found"] >= 7
    assert max(found["angles"]) < 3.0 and max(found["offsets"]) < 5e-3


@pytest.mark.slow
def test_two_hundred_thousand_triangles(tmp_path):
    world = load_world("field.xml", mjcf=KINDS["rubble_field"](np.random.default_rng(0)))
    scan = virtual_scan(world, np.random.default_rng(0), spacing=0.0071)
    assert len(scan.triangles) > 190_000
    export(scan, tmp_path / "field.ply")
    options = ["--start", "0,0", "--goal", "3.42,0", "--out", str(tmp_path / "o")]
    assert command.main([str(tmp_path / "field.ply"), *options]) == 0
    made = load_world(tmp_path / "o" / "field.xml")
    assert 13 <= sum(surface.serves_foot for surface in made.surfaces) <= 18


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["none.obj"], "error: none.obj: cannot be read (No such file or directory)"),
        (["bad.ply"], "error: bad.ply: is damaged, or not what its ending says"),
        (["wall.stl"], "error: no flat place of at least 0.01 m^2 for a foot was found"),
        (["steps.stl", "--start", "9,9"], "error: --start 9,9: no surface for feet there; the nearest has a corner at"),
        (["steps.stl", "--start", "1"], "error: argument --start: '1' is not 2 or 3 numbers with commas"),
        (
            ["steps.stl", "--goal", "1,1e300"],
            "error: argument --goal: '1,1e300' is not 2 numbers with commas, each at most",
        ),
        (["steps.stl", "--goal", "1,x"], "error: argument --goal: '1,x' is not 2 numbers with commas"),
        (["steps.stl", "--friction", "0"], "error: argument --friction: 0 is not above zero"),
        (["steps.stl", "--out", "bad.ply"], "error: bad.ply/steps.xml: cannot be written"),
        (["map.npy"], "error: map.npy: does not say how far apart its heights are; give --cell"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(options, line, steps, tmp_path):
    steps.export(tmp_path / "steps.stl")
    (tmp_path / "bad.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nend_header\n")
    trimesh.creation.box([0.02, 1, 1]).export(tmp_path / "wall.stl")
    np.save(tmp_path / "map.npy", np.zeros((5, 5)))
    before = sorted(os.listdir(tmp_path))
    done = subprocess.run(
        [sys.executable, "-m", "toolkit.scan", *options], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith(line) and done.stderr.count("\n") == 1
    assert sorted(os.listdir(tmp_path)) == before


def test_nothing_but_points_in_a_line_is_no_scene():
    with pytest.raises(InputError):
        read_scene([Scan(np.zeros((0, 3)), np.zeros((0, 3), int))])
