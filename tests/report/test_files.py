"""The folder of a run appears whole or not at all, and every file in it reads back."""

import errno
import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from toolkit.centroidal.problem import Margins
from toolkit.contacts.failure import Failure
from toolkit.errors import InputError
from toolkit.execution.check import Result
from toolkit.report.arrays import write_execution, write_motion
from toolkit.report.files import REPORT, RunFolder, read_json, write_json, write_scene
from toolkit.report.plan_file import read_plan, write_plan
from toolkit.report.run_report import STAGES, RunReport, write_report


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


def test_the_report_keeps_every_figure_and_every_result(run, tmp_path):
    write_report(tmp_path / REPORT, run.report)
    content = json.loads((tmp_path / REPORT).read_text(), parse_constant=pytest.fail)
    assert content["verdict"] == "FAIL" and content["seed"] == 3 and content["reason"] == run.report.reason
    for stage, names in STAGES.items():
        assert set(names) <= set(content["stages"][stage]), stage
    assert [check["result"] for check in content["checks"]] == ["PASS", "FAIL", "FAIL", "NOT_CHECKED"]


def test_a_report_of_a_run_without_a_search_has_every_figure(run):
    report = RunReport.without_search(run.plan.world, "r", 0, "nothing leads there", {})
    for stage, names in STAGES.items():
        assert list(report.stages[stage]) == list(names)
    assert report.stages["surfaces"]["count"] == 3 and report.verdict == "FAIL"
    assert report.stages["planning"]["found"] is False and report.stages["execution"]["completed"] is False
    assert report.stages["execution"]["max_slip"] is None


def test_the_plan_round_trips(run, tmp_path):
    path = tmp_path / "plan.json"
    write_plan(path, run.plan, run.solution)
    again = read_plan(path)
    assert len(again.transitions) == len(run.plan.sequence.transitions)
    for old, new in zip(run.plan.sequence.transitions, again.transitions, strict=True):
        assert old.limb == new.limb and old.timing == new.timing and (old.contact is None) == (new.contact is None)
    for old, new in zip(run.plan.sequence.stances, again.stances, strict=True):
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
    write_plan(path, run.plan, run.solution)
    plan = read_json(path)
    change(plan)
    write_json(path, plan)
    with pytest.raises(InputError, match=message):
        read_plan(path)


def test_the_motion_is_written_with_the_problem_that_it_solves(run, tmp_path):
    """Margins kept and contacts moved by the optimiser are those of the file's problem."""
    landed = run.plan.motion.problem.position + [0.01, 0.0, 0.0]
    motion = replace(run.plan.motion, kept=Margins(friction=0.9), landed=landed)
    write_motion(tmp_path / "motion.npz", motion, run.plan.trajectory)
    arrays = dict(np.load(tmp_path / "motion.npz"))
    np.testing.assert_array_equal(arrays["centroidal_problem_position"], landed)
    center = run.plan.motion.problem.final_center + [0.01, 0.0, 0.0]
    np.testing.assert_allclose(arrays["centroidal_problem_final_center"], center, rtol=0, atol=1e-12)
    assert arrays["centroidal_problem_margins_friction"] == 0.9
    for name in ("com", "force", "feasible", "objective"):
        np.testing.assert_array_equal(arrays[f"centroidal_{name}"], getattr(motion, name))
    for name in ("qpos", "limb_pose", "feasible", "reason"):
        np.testing.assert_array_equal(arrays[f"wholebody_{name}"], getattr(run.plan.trajectory, name))
    assert not [name for name in arrays if "kept" in name or "landed" in name or "failure" in name]
    write_motion(tmp_path / "motion.npz", motion, None)
    assert not [name for name in np.load(tmp_path / "motion.npz").files if name.startswith("wholebody")]


def test_failures_are_written_in_words_and_with_their_time(run, tmp_path):
    motion = replace(run.plan.motion, feasible=False, failure=Failure("infeasible: too steep", 1.5, transition=2))
    trajectory = replace(run.plan.trajectory, failure=Failure("a joint is late", 0.5))
    write_motion(tmp_path / "motion.npz", motion, trajectory)
    arrays = dict(np.load(tmp_path / "motion.npz"))
    assert arrays["centroidal_status"] == "solved; infeasible: too steep" and arrays["centroidal_failure_time"] == 1.5
    assert arrays["wholebody_reason"] == "a joint is late" and arrays["wholebody_failure_time"] == 0.5
    assert not arrays["wholebody_feasible"]
    fell = replace(run.execution, fall=Failure("it sank", 2.0), failure=Failure("the robot fell: it sank", 2.0))
    write_execution(tmp_path / "execution.npz", fell)
    arrays = dict(np.load(tmp_path / "execution.npz"))
    assert arrays["fell"] and arrays["fall_reason"] == "it sank" and arrays["failure_time"] == 2.0
    assert "fall" not in arrays and "failure" not in arrays


def test_the_execution_is_written_with_its_scene(run, tmp_path):
    write_execution(tmp_path / "execution.npz", run.execution)
    write_scene(tmp_path / "scene.mjb", run.execution.scene)
    scene = mujoco.MjModel.from_binary_path(str(tmp_path / "scene.mjb"))
    assert (scene.nq, scene.ngeom) == (run.execution.scene.nq, run.execution.scene.ngeom)
    arrays = dict(np.load(tmp_path / "execution.npz"))
    for name in ("qpos0", "qvel0", "ctrl", "timestep"):
        np.testing.assert_array_equal(arrays[name], getattr(run.execution.controls, name))
    np.testing.assert_array_equal(arrays["tick_times"], run.execution.samples.tick_times)
    np.testing.assert_array_equal(arrays["qpos"], [*run.execution.samples.qpos, run.execution.controls.final_qpos])
    np.testing.assert_allclose(arrays["wrench"], run.execution.samples.wrench, rtol=1e-6)  # kept in single precision
    assert json.loads(arrays["touchdowns"].item()) == list(run.execution.touchdowns)
    assert not arrays["fell"] and arrays["fall_reason"] == "" and "failure_time" not in arrays


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
