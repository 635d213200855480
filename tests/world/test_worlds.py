"""Every world in worlds/ loads, and its surfaces are where MuJoCo's rays and contacts find them."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.world.probe import area_of, ball_gap, random_points, ray_gap
from toolkit.geometry.pose import Pose
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world
from toolkit.world.scene import compose_scene
from toolkit.world.source import RAY_GROUPS

WORLDS = sorted((Path(__file__).resolve().parents[2] / "worlds").glob("*.xml"))

TOLERANCE = 1.6e-3  # m; triangles lie up to 1.5 mm off their facet's plane, and what is 1 mm high does not cover


@pytest.fixture(scope="module", params=WORLDS, ids=lambda path: path.stem)
def world(request):
    return load_world(request.param)


def test_viewer_opens_it(world):
    model = mujoco.MjModel.from_xml_path(str(world.path))
    assert model.nv == 0 and model.nlight > 0


def test_surfaces_are_well_formed(world):
    assert [surface.index for surface in world.surfaces] == list(range(len(world.surfaces)))
    for surface in world.surfaces:
        assert surface.serves_foot or surface.serves_palm
        assert surface.friction > 0
        rotation = surface.pose.rotation
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-9)
        assert np.linalg.det(rotation) > 0
        for ring, sign in zip(surface.boundary, [1.0, *[-1.0] * len(surface.boundary[1:])], strict=True):
            assert ring.shape[1] == 2 and len(ring) >= 3
            assert not np.allclose(ring[0], ring[-1], atol=1e-9)
            after = np.roll(ring, -1, axis=0)
            assert sign * np.sum(ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]) > 0
        covered = 0.0
        for piece in surface.pieces:
            edge = np.roll(piece, -1, axis=0) - piece
            turn = np.roll(edge, -1, axis=0)
            assert (edge[:, 0] * turn[:, 1] - edge[:, 1] * turn[:, 0] > -1e-9).all()
            after = np.roll(piece, -1, axis=0)
            covered += np.sum(piece[:, 0] * after[:, 1] - piece[:, 1] * after[:, 0]) / 2
        assert covered == pytest.approx(area_of(surface), rel=1e-6)


def test_random_points_are_touched_at_the_plane(world):
    rng = np.random.default_rng(0)
    for surface in world.surfaces:
        points = random_points(surface, rng, 20, inset=1e-4)
        assert len(points)
        # Rays start above the room that a surface must have, 15 cm, so that what covers a point is seen.
        gaps = ray_gap(world.mujoco_model, surface, points, height=0.149)
        np.testing.assert_allclose(gaps, 0.0, atol=TOLERANCE)


def test_a_ball_rests_on_the_plane(world):
    rng = np.random.default_rng(1)
    for surface in world.surfaces:
        points = random_points(surface, rng, 6, inset=0.012)
        gaps = ball_gap(world.mujoco_model, surface, points)
        np.testing.assert_allclose(gaps, 0.0, atol=TOLERANCE)


def test_goal_and_start_are_on_the_ground(world):
    data = mujoco.MjData(world.mujoco_model)
    mujoco.mj_kinematics(world.mujoco_model, data)
    down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    for position in (world.start.position, world.goal.position):
        above = position - 0.5 * down
        distance = mujoco.mj_ray(world.mujoco_model, data, above, down, RAY_GROUPS, True, -1, geom)
        assert abs(distance - 0.5) < 0.06


def test_composed_scene_has_the_same_collision_geometry(world, stool):
    scene = compose_scene(stool, world)
    robot = stool.mujoco_model
    static = np.flatnonzero((scene.body_weldid[scene.geom_bodyid] == 0) & (scene.geom_contype != 0))
    alone = np.flatnonzero(world.mujoco_model.geom_contype != 0)
    assert scene.ngeom == robot.ngeom + world.mujoco_model.ngeom
    together, apart = mujoco.MjData(scene), mujoco.MjData(world.mujoco_model)
    mujoco.mj_forward(scene, together)
    mujoco.mj_forward(world.mujoco_model, apart)
    order = np.argsort([scene.geom(i).name.removeprefix("world/") for i in static], kind="stable")
    other = np.argsort([world.mujoco_model.geom(i).name for i in alone], kind="stable")
    for name in ("geom_type", "geom_size", "geom_friction", "geom_rbound"):
        np.testing.assert_array_equal(
            getattr(scene, name)[static][order], getattr(world.mujoco_model, name)[alone][other]
        )
    np.testing.assert_allclose(together.geom_xpos[static][order], apart.geom_xpos[alone][other], atol=1e-12)
    np.testing.assert_allclose(together.geom_xmat[static][order], apart.geom_xmat[alone][other], atol=1e-12)


def test_stool_stands_on_the_start_with_the_friction_of_the_world(world, stool):
    scene = compose_scene(stool, world)
    data = mujoco.MjData(scene)
    data.qpos[:] = stool.home
    data.qpos[:3] += world.start.position - [0, 0, 5e-4]
    mujoco.mj_forward(scene, data)
    # Soles are 0.5 m below the base.
    touching = [contact for contact in data.contact if min(scene.geom_bodyid[contact.geom]) == 0]
    assert len(touching) >= 8
    frictions = {surface.friction for surface in world.surfaces}
    assert {contact.friction[0] for contact in touching} <= frictions


def test_the_probes_see_a_surface_that_is_off():
    world = load_world(WORLDS[0])
    surface = world.surfaces[0]
    raised = replace(surface, pose=Pose(surface.pose.rotation, surface.pose.position + 0.003 * surface.normal))
    points = random_points(surface, np.random.default_rng(0), 5, inset=0.02)
    np.testing.assert_allclose(ray_gap(world.mujoco_model, raised, points), -0.003, atol=TOLERANCE)
    np.testing.assert_allclose(ball_gap(world.mujoco_model, raised, points), 0.003, atol=TOLERANCE)


def test_readme_lists_every_world_and_says_how_it_is_made():
    text = (WORLDS[0].parent / "README.md").read_text()
    for path in WORLDS:
        row = next(line for line in text.splitlines() if line.startswith(f"| `{path.name}` "))
        command = row.split("|")[3].strip().strip("`").split()
        if command[0] == "by":
            continue
        seed = int(command[command.index("--seed") + 1]) if "--seed" in command else 0
        assert path.read_text() == KINDS[command[0]](np.random.default_rng(seed)), f"make {path.name} anew"


def test_world_of_the_readme_loads(tmp_path):
    text = (WORLDS[0].parent / "README.md").read_text()
    (tmp_path / "example.xml").write_text(text.split("```xml\n")[1].split("```")[0])
    world = load_world(tmp_path / "example.xml")
    assert {surface.geom for surface in world.surfaces} == {"floor", "ramp"}
