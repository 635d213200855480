"""The folder of a run appears whole or not at all, and every file in it reads back."""

import errno
import json
from dataclasses import fields, replace

import mujoco
import numpy as np
import pytest

from toolkit.errors import InputError
from toolkit.execution.check import Result
from toolkit.report.arrays import read_execution, read_motion, write_execution, write_motion
from toolkit.report.files import REPORT, RunFolder, read_json, read_scene, write_json, write_scene
from toolkit.report.plan_file import read_plan, write_plan
from toolkit.report.run_report import STAGES, RunReport, read_report, write_report


def assert_same_fields(a, b, *, rtol=0.0, skip=()):
    for item in fields(a):
        if item.name in skip:
            continue
        x, y = getattr(a, item.name), getattr(b, item.name)
        if isinstance(x, np.ndarray):
            np.testing.assert_allclose(y, x, rtol=rtol, atol=rtol, err_msg=item.name)
        elif isinstance(x, (float, int, bool, str, tuple)):
            assert x == y, item.name


def finish(folder):
    (folder.path / REPORT).write_text("{}")


def test_the_folder_appears_whole(tmp_path):
    with RunFolder(tmp_path / "a" / "run", "w", "r") as folder:
        finish(folder)
        assert not (tmp_path / "a" / "run").exists()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["run"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_nothing(tmp_path, error):
    with pytest.raises(error), RunFolder(tmp_path / "a" / "b" / "run", "w", "r") as folder:
        finish(folder)
        raise error
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    with pytest.raises(InputError, match="run: cannot be written"), RunFolder(tmp_path / "run", "w", "r"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_an_exception_keeps_the_earlier_run(tmp_path):
    target = tmp_path / "run"
    target.mkdir()
    (target / REPORT).write_text("old")
    with pytest.raises(ValueError), RunFolder(target, "w", "r") as folder:
        finish(folder)
        raise ValueError
    assert (target / REPORT).read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_an_earlier_run_is_replaced_as_a_whole(tmp_path):
    target = tmp_path / "run"
    target.mkdir()
    (target / REPORT).write_text("old")
    (target / "left over").write_text("old")
    with RunFolder(target, "w", "r") as folder:
        finish(folder)
    assert [path.name for path in target.iterdir()] == [REPORT]
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_foreign_folder_is_refused_before_anything_is_done(tmp_path):
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(InputError, match="not an earlier run"):
        RunFolder(tmp_path, "w", "r")
    with pytest.raises(InputError, match="is a file"):
        RunFolder(tmp_path / "thesis.txt", "w", "r")
    with pytest.raises(InputError, match="cannot write into .*thesis.txt; give --out another folder"):
        RunFolder(tmp_path / "thesis.txt" / "a" / "run", "w", "r")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_an_empty_folder_is_used_and_the_default_one_is_named_after_world_and_robot(tmp_path, monkeypatch):
    (tmp_path / "run").mkdir()
    with RunFolder(tmp_path / "run", "w", "r") as folder:
        finish(folder)
    assert (tmp_path / "run" / REPORT).exists()
    monkeypatch.chdir(tmp_path)
    with RunFolder(None, "stairs", "walker") as folder:
        finish(folder)
    with RunFolder(None, "stairs", "walker") as other:
        finish(other)
    assert folder.target.parent == tmp_path / "runs" and folder.target.name.startswith("stairs-walker-2")
    assert folder.target != other.target


def test_json_is_strict(tmp_path):
    path = tmp_path / "x.json"
    write_json(
        path, {"a": np.array([1.0, np.nan]), "b": np.float64(np.inf), "c": (True, np.int64(3)), "d": Result.PASS}
    )
    assert json.loads(path.read_text(), parse_constant=pytest.fail) == {
        "a": [1, None],
        "b": None,
        "c": [True, 3],
        "d": "PASS",
    }
    tricky = {"text [1,\n 2]": ["a, 1", "[ 2 ]"], "empty": [], "nested": [[1, 2], [None, 4e-9]], "one": [-1.5]}
    write_json(path, tricky)
    assert (
        json.loads(path.read_text()) == tricky and "[-1.5]" in path.read_text() and "[null, 4e-09]" in path.read_text()
    )
    path.write_text("{")
    with pytest.raises(InputError, match="not a JSON file"):
        read_json(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_json(tmp_path / "none.json")


def test_the_report_round_trips_and_keeps_every_result(run, tmp_path):
    write_report(tmp_path / REPORT, run.report)
    content = json.loads((tmp_path / REPORT).read_text(), parse_constant=pytest.fail)
    assert content["verdict"] == "FAIL" and content["seed"] == 3
    for stage, names in STAGES.items():
        assert set(names) <= set(content["stages"][stage]), stage
    results = [check["result"] for check in content["checks"]]
    assert results == ["PASS", "FAIL", "FAIL", "NOT_CHECKED"]
    again = read_report(tmp_path / REPORT)
    assert [check.result for check in again.checks] == results
    assert again.reason == run.report.reason and again.versions == run.report.versions
    write_json(tmp_path / REPORT, {"schema": 1})
    with pytest.raises(InputError, match="not a run report"):
        read_report(tmp_path / REPORT)


def test_a_report_of_a_run_without_a_plan_has_every_figure():
    report = RunReport.of(world="w", robot="r", seed=0, passed=False, reason="nothing leads there", surfaces=())
    for stage, names in STAGES.items():
        assert list(report.stages[stage]) == list(names)
    assert report.stages["planning"]["found"] is False and report.stages["execution"]["completed"] is False
    assert report.stages["execution"]["max_slip"] is None


def test_the_plan_round_trips(run, tmp_path):
    path = tmp_path / "plan.json"
    write_plan(path, run.sequence, world="w", robot="r", initial_rest=0.2, solution=run.search.solutions[0])
    again = read_plan(path)
    assert len(again.transitions) == len(run.sequence.transitions)
    for old, new in zip(run.sequence.transitions, again.transitions, strict=True):
        assert old.limb == new.limb and old.timing == new.timing and (old.contact is None) == (new.contact is None)
    for old, new in zip(run.sequence.stances, again.stances, strict=True):
        for a, b in zip(old.contacts, new.contacts, strict=True):
            assert (a.limb, a.friction, a.surface) == (b.limb, b.friction, b.surface)
            np.testing.assert_allclose(a.pose.matrix, b.pose.matrix, rtol=0, atol=1e-14)  # rotation via quaternion
    first = read_json(path)["transitions"][0]["times"]
    assert first == {"shift": 0.3, "swing": 0.2, "start": 0.2, "lift_off": 0.5, "touchdown": 0.7}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda plan: plan["transitions"][1].pop("limb"), r"transitions\[1\] has no valid 'limb'"),
        (lambda plan: plan["transitions"][0].update(limb="left_fot"), r"transitions\[0\] has no valid 'LEFT_FOT'"),
        (lambda plan: plan["transitions"][0].update(action="hop"), 'action is "hop"'),
        (lambda plan: plan["transitions"][0].update(position=[1, 2]), "position needs 3 numbers"),
        (lambda plan: plan["start"].pop(), "a stance needs both feet"),
        (lambda plan: plan["transitions"].insert(0, plan["transitions"][-1]), "not in contact and cannot be broken"),
        (lambda plan: plan.update(schema=99), "has schema 99"),
    ],
)
def test_a_broken_plan_is_named(run, tmp_path, change, message):
    path = tmp_path / "plan.json"
    write_plan(path, run.sequence, world="w", robot="r")
    plan = read_json(path)
    change(plan)
    write_json(path, plan)
    with pytest.raises(InputError, match=message):
        read_plan(path)


def test_the_motion_round_trips(run, tmp_path):
    write_motion(tmp_path / "motion.npz", run.motion, run.trajectory)
    motion, trajectory = read_motion(tmp_path / "motion.npz")
    assert_same_fields(run.motion, motion)
    assert_same_fields(run.motion.problem, motion.problem)
    assert motion.problem.weights == run.motion.problem.weights and motion.problem.margins == run.motion.problem.margins
    assert_same_fields(run.trajectory, trajectory)
    write_motion(tmp_path / "motion.npz", run.motion, None)
    assert read_motion(tmp_path / "motion.npz")[1] is None


def test_the_execution_round_trips_with_its_scene(run, tmp_path):
    write_execution(tmp_path / "execution.npz", run.execution)
    write_scene(tmp_path / "scene.mjb", run.execution.scene)
    scene = read_scene(tmp_path / "scene.mjb")
    assert (scene.nq, scene.ngeom) == (run.execution.scene.nq, run.execution.scene.ngeom)
    again = read_execution(tmp_path / "execution.npz", scene)
    assert_same_fields(run.execution.controls, again.controls)
    for name in ("qpos", "tick_times"):
        np.testing.assert_array_equal(getattr(again.samples, name), getattr(run.execution.samples, name))
    assert_same_fields(run.execution.samples, again.samples, rtol=1e-6)  # measurements are kept in single precision
    assert_same_fields(run.execution, again, rtol=1e-6)
    assert again.replanning == run.execution.replanning
    assert again.touchdowns == run.execution.touchdowns


def test_execution_npz_replays_in_plain_mujoco(run, tmp_path):
    scene, data = run.execution.scene, mujoco.MjData(run.execution.scene)
    rng = np.random.default_rng(5)
    ctrl = rng.standard_normal((50, scene.nu))
    for row in ctrl:
        data.ctrl[:] = row
        mujoco.mj_step(scene, data)
    controls = replace(run.execution.controls, ctrl=ctrl, final_qpos=np.array(data.qpos))
    samples = replace(run.execution.samples, qpos=run.execution.samples.qpos[:25])
    execution = replace(run.execution, controls=controls, samples=samples)
    write_execution(tmp_path / "execution.npz", execution)
    write_scene(tmp_path / "scene.mjb", scene)

    model = mujoco.MjModel.from_binary_path(str(tmp_path / "scene.mjb"))
    data, arrays = mujoco.MjData(model), np.load(tmp_path / "execution.npz")
    data.qpos, data.qvel = arrays["qpos0"], arrays["qvel0"]
    assert model.opt.timestep == arrays["timestep"]
    for row in arrays["ctrl"]:
        data.ctrl[:] = row
        mujoco.mj_step(model, data)
    assert np.array_equal(data.qpos, arrays["qpos"][-1])


def test_broken_files_are_named(run, tmp_path):
    write_motion(tmp_path / "motion.npz", run.motion, None)
    whole = (tmp_path / "motion.npz").read_bytes()
    (tmp_path / "motion.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not a readable npz"):
        read_motion(tmp_path / "motion.npz")
    np.savez(tmp_path / "motion.npz", centroidal_com=np.zeros((2, 3)))
    with pytest.raises(InputError, match="has no array"):
        read_motion(tmp_path / "motion.npz")
    (tmp_path / "scene.mjb").write_bytes(b"\0" * 100)
    with pytest.raises(InputError, match="cannot load this compiled model"):
        read_scene(tmp_path / "scene.mjb")
