"""What the command writes can be read by others, and is the run."""

import json
import shutil

import mujoco
import numpy as np
import pytest
import trimesh

from toolkit.errors import InputError
from toolkit.exchange.folder import COMMON, FILES
from toolkit.exchange.formats import FORMATS
from toolkit.export import main
from toolkit.report.files import read_json
from toolkit.world.loader import load_world

CLOSE = 1e-6


@pytest.fixture(scope="session")
def exports(run_folder, tmp_path_factory):
    """The folder of each format."""
    made = {}
    for name in FORMATS:
        made[name] = tmp_path_factory.mktemp("exports") / name
        assert main([str(run_folder), "--to", name, "--out", str(made[name])]) == 0
    return made


def forward(model, qpos):
    """Positions and quaternions of the bodies in some states."""
    data = mujoco.MjData(model)
    poses = []
    for state in qpos:
        data.qpos[:] = state
        mujoco.mj_kinematics(model, data)
        poses.append((data.xpos[1:].copy(), data.xquat[1:].copy()))
    return tuple(np.array(part) for part in zip(*poses, strict=True))


def read_table(path):
    header, *rows = path.read_text().splitlines()
    return dict(zip(header.split(","), np.array([row.split(",") for row in rows], float).T, strict=True))


@pytest.mark.parametrize("name", FORMATS)
def test_every_export_has_what_its_readme_says(exports, name):
    folder = exports[name]
    assert {path.name for path in folder.iterdir()} == set(FORMATS[name].files) | set(COMMON)
    text, metadata = (folder / "README.txt").read_text(), read_json(folder / "metadata.json")
    assert all(file in text for file in (*FORMATS[name].files, *COMMON))
    assert metadata["format"] == name and metadata["verdict"] == "PASS" and metadata["fps"] == FORMATS[name].fps
    labels = read_table(folder / "labels.csv")
    assert len(labels["time"]) == metadata["frames"] and set(labels["left_foot_contact"]) == {0.0, 1.0}
    assert metadata["friction"] == {"floor": 0.7}


def test_mjlab_arrays_are_the_run(exports, robot, walked):
    with np.load(exports["mjlab"] / "motion.npz") as motion:
        rows = slice(None, None, 10)
        states = walked.samples.qpos[rows]
        assert motion["fps"].tolist() == [50.0]
        assert np.allclose(motion["joint_pos"], states[:, 7:], rtol=0, atol=CLOSE)
        assert np.allclose(motion["joint_vel"], walked.samples.qvel[rows, 6:], rtol=CLOSE, atol=CLOSE)
        position, quaternion = forward(robot.mujoco_model, states)
        assert np.allclose(motion["body_pos_w"], position, rtol=0, atol=CLOSE)
        assert np.allclose(motion["body_quat_w"], quaternion, rtol=0, atol=CLOSE)
        assert np.allclose(motion["body_lin_vel_w"][:, 0], walked.samples.qvel[rows, :3], rtol=CLOSE, atol=CLOSE)
        assert motion["body_ang_vel_w"].shape == motion["body_lin_vel_w"].shape == position.shape
    metadata = read_json(exports["mjlab"] / "metadata.json")
    alone = robot.mujoco_model
    assert metadata["body_names"] == [alone.body(b).name for b in range(1, alone.nbody)]
    assert metadata["joint_names"] == list(robot.joint_names)


def test_unitree_rows_put_the_bodies_where_they_were(run_folder, robot, walked, tmp_path):
    out = tmp_path / "rows"
    assert main([str(run_folder), "--to", "unitree-csv", "--fps", "50", "--out", str(out)]) == 0
    rows = np.loadtxt(out / "motion.csv", delimiter=",")
    qpos = np.hstack([rows[:, :3], rows[:, [6, 3, 4, 5]], rows[:, 7:]])
    model = mujoco.MjModel.from_xml_path(str(out / "robot.xml"))  # what a reader has
    found, meant = forward(model, qpos), forward(robot.mujoco_model, walked.samples.qpos[::10])
    assert len(found[0]) == len(meant[0])
    assert np.allclose(found[0], meant[0], rtol=0, atol=2 * CLOSE)
    assert np.allclose(found[1], meant[1], rtol=0, atol=2 * CLOSE)


def test_unitree_rows_come_at_30_per_second(exports, walked):
    rows = np.loadtxt(exports["unitree-csv"] / "motion.csv", delimiter=",")
    assert len(rows) == int(walked.samples.tick_times[-1] * 30 + 1e-6) + 1
    every = walked.samples.qpos[::50]  # 0.1 s: on samples of both
    assert np.allclose(rows[::3][:, 7:], every[: len(rows[::3]), 7:], rtol=0, atol=CLOSE)
    assert np.allclose(np.linalg.norm(rows[:, 3:7], axis=1), 1.0, rtol=0, atol=1e-8)


def test_named_columns_are_the_same_in_both_formats(exports, walked, robot):
    table = read_table(exports["csv"] / "trajectory.csv")
    with np.load(exports["npz"] / "trajectory.npz") as arrays:
        assert set(arrays) == set(table)
        for name in table:
            assert np.allclose(table[name], arrays[name], rtol=0, atol=1e-8), name
    samples = walked.samples
    for name, values in {
        "time": samples.tick_times,
        "root_quat_w": samples.qpos[:, 3],
        f"pos_{robot.joint_names[-1]}": samples.qpos[:, -1],
        f"torque_{robot.joint_names[0]}": samples.torque[:, 0],
        "com_z": samples.com[:, 2],
        "linear_momentum_x": samples.momentum[:, 0],
        "right_foot_force_z": samples.wrench[:, 1, 2],
        "left_foot_pos_x": samples.limb_pose[:, 0, 0],
    }.items():
        assert np.allclose(table[name], values[::10], rtol=CLOSE, atol=2 * CLOSE), name
    assert np.isfinite(np.array(list(table.values()))).all()


def test_contacts_are_the_plan(exports, walking):
    content = read_json(exports["contacts"] / "contacts.json")
    phases = walking.schedule.phases
    swings = [None if phase.swing is None else phase.swing.label for phase in phases]
    assert [entry["swing"] for entry in content["contactPhases"]] == swings
    for entry, phase in zip(content["contactPhases"], phases, strict=True):
        assert [entry["timeInitial"], entry["timeFinal"]] == pytest.approx([phase.start, phase.end], abs=CLOSE)
        assert list(entry["contactPatches"]) == [contact.limb.label for contact in phase.contacts]
        for contact in phase.contacts:
            patch = entry["contactPatches"][contact.limb.label]
            x, y, z, w = patch["placement"]["quaternion_xyzw"]
            assert np.allclose([w, x, y, z], contact.pose.quaternion_wxyz, rtol=0, atol=CLOSE)
            assert np.allclose(patch["placement"]["translation"], contact.pose.position, rtol=0, atol=CLOSE)
            assert patch["friction"] == patch["contact_model"]["mu"] == contact.friction
            corners = np.array(patch["contact_model"]["contact_points_positions"])
            assert np.allclose(np.abs(corners[:, :2]), walking.robot.half_sizes[contact.limb])
    for before, after in zip(content["contactPhases"], content["contactPhases"][1:], strict=False):
        assert before["timeFinal"] == after["timeInitial"] and before["c_final"] == after["c_init"]
    assert content["contactPhases"][0]["c_init"] == pytest.approx(walking.motion.com[0].tolist(), abs=CLOSE)
    assert json.dumps(content)  # strict


def test_the_terrain_can_be_used_again(exports, walking):
    world = load_world(exports["csv"] / "terrain.xml")
    assert len(world.surfaces) == len(walking.world.surfaces)
    assert np.allclose(world.goal.position, walking.world.goal.position) and world.goal.radius == 0.1
    mesh = trimesh.load_mesh(exports["csv"] / "terrain.obj")
    low, high = mesh.bounds
    assert np.allclose([low[2], high[2]], 0.0) and (high[:2] > 5.0).all() and (low[:2] < -4.0).all()


def test_an_export_can_be_made_again_but_nothing_else_is_replaced(run_folder, tmp_path):
    out = tmp_path / "out"
    assert main([str(run_folder), "--to", "contacts", "--out", str(out)]) == 0
    assert main([str(run_folder), "--to", "mjlab", "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {"motion.npz", *COMMON} <= FILES
    before = sorted(path.name for path in run_folder.iterdir())
    with pytest.raises(InputError, match="holds (execution|plan|scene).*, which no export has written"):
        main([str(run_folder), "--to", "mjlab", "--out", str(run_folder)])
    assert sorted(path.name for path in run_folder.iterdir()) == before
    with pytest.raises(InputError, match="out: has no plan.json; only a run that came to its execution"):
        main([str(out), "--to", "csv"])


def test_planned_states_are_exported_where_asked_for(run_folder, walking, tmp_path):
    out = tmp_path / "planned"
    assert main([str(run_folder), "--to", "npz", "--planned", "--fps", "10", "--out", str(out)]) == 0
    metadata = read_json(out / "metadata.json")
    assert metadata["states"] == "planned" and "States: planned." in (out / "README.txt").read_text()
    with np.load(out / "trajectory.npz") as arrays:
        assert arrays["root_pos_z"][0] == pytest.approx(walking.trajectory.qpos[0, 2], abs=CLOSE)


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("report.json", b"{}", "report.json: has no valid world; it is not the report of a run"),
        ("scene.mjb", b"12", "scene.mjb: is cut off, was changed"),
        ("execution.npz", b"12", "execution.npz: is cut off or broken"),
        ("motion.npz", None, "has no motion.npz; only a run that came to its execution"),
    ],
)
def test_broken_runs_are_refused_in_one_line(run_folder, tmp_path, file, content, message):
    broken = tmp_path / "broken"
    shutil.copytree(run_folder, broken)
    if content is None:
        (broken / file).unlink()
    else:
        (broken / file).write_bytes(content)
    with pytest.raises(InputError, match=message) as error:
        main([str(broken), "--to", "csv", "--out", str(tmp_path / "out")])
    assert "\n" not in str(error.value) and not (tmp_path / "out").exists()


def test_a_run_that_diverged_is_refused(run_folder, tmp_path):
    diverged = tmp_path / "diverged"
    shutil.copytree(run_folder, diverged)
    with np.load(diverged / "execution.npz") as content:
        arrays = dict(content)
    arrays["qpos"][5, 2] = np.nan
    np.savez(diverged / "execution.npz", **arrays)
    with pytest.raises(InputError, match="qpos is not finite everywhere"):
        main([str(diverged), "--to", "csv"])


def damaged(content, rng):
    """JSON in which something, somewhere, is missing or another thing."""
    place = content
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = keys[int(rng.integers(len(keys)))]
        inner = place[key]
        if not isinstance(inner, (dict, list)) or not inner or rng.random() < 0.3:
            break
        place = inner
    if rng.random() < 0.4:
        del place[key]
    else:
        place[key] = [None, -1, 1e300, "x", [], {}, True][int(rng.integers(7))]
    return content


@pytest.mark.parametrize("file", ["plan.json", "report.json"])
def test_damaged_runs_are_refused_in_one_line_or_exported(run_folder, tmp_path, file):
    rng, broken = np.random.default_rng(5), tmp_path / "broken"
    shutil.copytree(run_folder, broken)
    taken = 0
    for _ in range(25):
        content = damaged(json.loads((run_folder / file).read_text()), rng)
        (broken / file).write_text(json.dumps(content))
        try:
            taken += main([str(broken), "--to", "contacts", "--fps", "2", "--out", str(tmp_path / "out")]) == 0
        except InputError as error:
            assert "\n" not in str(error)
    assert 0 < taken < 25


def test_parts_of_two_runs_are_refused(run_folder, tmp_path):
    mixed = tmp_path / "mixed"
    shutil.copytree(run_folder, mixed)
    with np.load(mixed / "execution.npz") as content:
        arrays = dict(content)
    np.savez(mixed / "execution.npz", **(arrays | {"torque": arrays["torque"][:, 1:]}))
    with pytest.raises(InputError, match="torque does not belong to scene.mjb"):
        main([str(mixed), "--to", "csv"])


def test_meshes_of_the_robot_lie_beside_it(run_folder, robot, tmp_path):
    folder, out = tmp_path / "capped", tmp_path / "out"
    shutil.copytree(robot.folder, folder)
    trimesh.creation.box((0.1, 0.1, 0.02)).export(folder / "cap.stl")
    text = (folder / "robot.xml").read_text().replace("</mujoco>", '<asset><mesh file="cap.stl"/></asset></mujoco>')
    cap = '><geom type="mesh" mesh="cap" mass="0" contype="0" conaffinity="0"/>'
    before, head, after = text.partition('<body name="head"')
    (folder / "robot.xml").write_text(before + head + after.replace(">", cap, 1))
    for _ in range(2):
        assert main([str(run_folder), "--to", "contacts", "--robot", str(folder), "--out", str(out)]) == 0
    assert mujoco.MjModel.from_xml_path(str(out / "robot.xml")).nmesh == 1
    assert {path.name for path in out.iterdir()} == {"cap.stl", *COMMON}


def test_another_robot_is_refused(run_folder, robot, tmp_path):
    folder = tmp_path / "other"
    shutil.copytree(robot.folder, folder)
    for path in (folder / "robot.xml", folder / "robot.toml"):
        path.write_text(path.read_text().replace('name="head"', 'name="skull"').replace('"head"', '"skull"'))
    with pytest.raises(InputError, match="is not the robot of"):
        main([str(run_folder), "--to", "csv", "--robot", str(folder), "--out", str(tmp_path / "out")])
