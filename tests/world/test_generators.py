"""Random terrain: reproducible, loadable, and with the figures of the paper."""

import inspect

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit.world.authoring import WorldText
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world

RANDOM = [kind for kind in KINDS if "rng: Not used" not in inspect.getdoc(KINDS[kind])]


def made(kind, seed, path, **options):
    return load_world(path / f"{kind}.xml", mjcf=KINDS[kind](np.random.default_rng(seed), **options))


@pytest.mark.parametrize("kind", KINDS)
def test_same_seed_same_text(kind):
    first, again, other = (KINDS[kind](np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert first == again
    assert (first != other) == (kind in RANDOM)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_loads_without_a_robot(kind, seed, tmp_path):
    world = made(kind, seed, tmp_path)
    assert world.surfaces
    mujoco.MjModel.from_xml_string(world.scenery.to_xml())


def tilts(world, prefix):
    """(n, 3) deg: roll, pitch and whole tilt of boxes by the prefix of their names."""
    model = world.mujoco_model
    rows = []
    for index in range(model.ngeom):
        if model.geom(index).name.startswith(prefix):
            w, x, y, z = model.geom_quat[index]
            turn = Rotation.from_quat([x, y, z, w])
            roll, pitch, yaw = turn.as_euler("xyz", degrees=True)
            assert abs(yaw) < 1e-3
            rows.append((roll, pitch, np.degrees(np.arccos(turn.as_matrix()[2, 2]))))
    return np.array(rows)


@pytest.mark.parametrize("seed", range(20))
def test_rubble_field_is_the_paper_s(seed, tmp_path):
    world = made("rubble_field", seed, tmp_path)
    assert len(world.surfaces) == 14 and all(surface.serves_foot for surface in world.surfaces)
    assert np.linalg.norm(world.goal.position - world.start.position) == pytest.approx(3.42)
    angles = tilts(world, "tile")
    assert len(angles) == 12 and np.abs(angles[:, :2]).max() <= 20
    assert {surface.friction for surface in world.surfaces} == {0.5}


def test_roll_and_pitch_are_independent(tmp_path):
    angles = np.concatenate([tilts(made("rubble_field", seed, tmp_path), "tile") for seed in range(12)])
    assert np.abs(np.corrcoef(angles[:, 0], angles[:, 1])[0, 1]) < 0.25
    assert angles[:, 2].max() > 22  # beyond either alone


def test_rubble_corridor_has_walls_for_palms(tmp_path):
    world = made("rubble_corridor", 2, tmp_path)
    assert sum(surface.serves_foot for surface in world.surfaces) == 17
    panels = [s for s in world.surfaces if s.geom.startswith("panel") and s.normal[1] * s.pose.position[1] < 0]
    assert len(panels) == 2 * 3 * 7 and all(panel.serves_palm for panel in panels)
    for panel in panels:
        assert abs(abs(panel.pose.position[1]) - 0.7) < 1e-5
        assert panel.pose.position[2] + 0.2 <= 1.5 + 1e-5


def test_stepping_stones_tilt_up_to_twelve_degrees(tmp_path):
    angles = np.concatenate(
        [[s.normal[2] for s in made("stepping_stones", seed, tmp_path).surfaces] for seed in range(5)]
    )
    tilt = np.degrees(np.arccos(np.clip(angles, -1, 1)))
    assert 10 < tilt.max() <= 12.0001


def test_stairs_rise_by_their_steps(tmp_path):
    for steps, height in ((4, 0.12), (3, -0.1)):
        world = made("stairs", 0, tmp_path, steps=steps, step_height=height)
        levels = sorted({round(s.pose.position[2], 6) for s in world.surfaces if s.serves_foot})
        np.testing.assert_allclose(levels, sorted(height * np.arange(steps + 1)), atol=1e-9)
        assert world.goal.position[2] == pytest.approx(steps * height)


def test_gap_and_slope_have_their_size(tmp_path):
    near, far = sorted(made("gap", 0, tmp_path, width=0.4).surfaces, key=lambda s: s.pose.position[0])
    edge = near.pose.position[0] + near.boundary[0][:, 0].max()
    assert far.pose.position[0] + far.boundary[0][:, 0].min() - edge == pytest.approx(0.4)
    for length, angle in ((2.0, 25.0), (1.0, -15.0)):
        world = made("slope", 0, tmp_path, length=length, angle=angle)
        (slope,) = [s for s in world.surfaces if s.geom == "slope"]
        assert np.degrees(np.arcsin(slope.normal[0])) == pytest.approx(angle, abs=1e-3)
        assert np.ptp(slope.boundary[0][:, 0]) == pytest.approx(length, abs=5e-3)
        assert len(world.surfaces) == 3


def test_mesh_terrain_is_one_mesh_of_about_a_thousand_triangles(tmp_path):
    text = KINDS["mesh_patches"](np.random.default_rng(0))
    model = mujoco.MjModel.from_xml_string(text)
    assert model.nmesh == 1 and 800 < model.mesh_facenum[0] < 1200
    world = load_world(tmp_path / "mesh.xml", mjcf=text)
    assert sum(surface.serves_foot for surface in world.surfaces) >= 20


@pytest.mark.parametrize("seed", range(10))
def test_training_terrain_starts_on_the_middle_tile_beside_a_wall(seed, tmp_path):
    world = made("training", seed, tmp_path)
    assert len(tilts(world, "tile")) == 9
    faces = [s for s in world.surfaces if s.geom == "wall" and s.normal[:2] @ s.pose.position[:2] < 0]
    assert len(faces) == 1
    wall = faces[0]
    tilt = abs(np.degrees(np.arcsin(wall.normal[2])))
    assert tilt <= 20.001
    # The distance is that of the panel's middle, where it is as high as the chest.
    level = wall.normal[:2] / np.linalg.norm(wall.normal[:2])
    offset = (wall.pose.position - [0, 0, 1.0]) @ wall.normal / np.linalg.norm(wall.normal[:2])
    assert 0.39 <= -offset <= 0.91
    assert abs(level[1]) > 0.7


def test_a_height_field_has_its_heights_where_they_are_meant(tmp_path):
    heights = np.add.outer(0.05 * np.arange(9), 0.02 * np.arange(6)) - 0.1  # a plane, (x, y)
    text = WorldText("field", "", 0.5, (0.6, 0.8), (0.6, 0.0, 0.0), start=(0.0, 0.0, -0.05))
    text.height_field("ground", heights, 0.2, (-0.3, -0.5))
    (surface,) = load_world(tmp_path / "field.xml", mjcf=text.render()).surfaces
    points = np.array([[-0.2, -0.4], [1.2, -0.4], [-0.2, 0.4], [0.5, 0.1]])
    expected = 0.25 * (points[:, 0] + 0.3) + 0.1 * (points[:, 1] + 0.5) - 0.1
    np.testing.assert_allclose(surface.height(points), expected, atol=1e-6)
