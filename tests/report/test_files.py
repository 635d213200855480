"""The folder of a run appears whole or not at all, and every file in it reads back."""

import errno
import json
import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from toolkit.centroidal.problem import Margins
from toolkit.contacts.failure import Failure
from toolkit.drafts import clear_drafts, draft_in, write_whole
from toolkit.errors import InputError
from toolkit.execution.check import Result
from toolkit.geometry.pose import Pose
from toolkit.report.arrays import write_execution, write_motion
from toolkit.report.files import REPORT, RunFolder, read_json, write_json, write_scene
from toolkit.report.plan_file import read_plan, read_proposal, write_plan
from toolkit.report.run_report import STAGES, RunReport, write_report

ROOT = Path(__file__).resolve().parents[2]
CLOCKED = ("seconds", "tick_seconds", "replan_seconds", "real_time_factor")


EARLIER = '{"schema": 2, "verdict": "PASS", "stages": {}}'


def finish(folder):
    (folder.path / REPORT).write_text(EARLIER)


def names(folder):
    return sorted(os.listdir(folder))


def earlier_run(folder, text=EARLIER):
    folder.mkdir()
    (folder / REPORT).write_text(text)
    return folder


def left_by_a_killed_run(target):
    """Start a run in another process and kill it."""
    text = (
        "import os, pathlib, sys, time; from toolkit.report.files import RunFolder\n"
        "with RunFolder(pathlib.Path(sys.argv[1]), 'w', 'r') as folder:\n"
        "    (folder.path / 'plan.json').write_text('half'); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", text, str(target)], cwd=ROOT, check=False)
    assert done.returncode == -9
    assert len(names(target)) == 1 and names(target)[0].endswith(".tmp")


def test_the_folder_appears_whole(tmp_path):
    with RunFolder(tmp_path / "a" / "run", "w", "r") as folder:
        (folder.path / "plan.json").write_text("{}")
        finish(folder)
        assert all(name.startswith(".") for name in names(tmp_path / "a" / "run"))
    assert names(tmp_path / "a") == ["run"] and names(tmp_path / "a" / "run") == ["plan.json", REPORT]


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
    target = earlier_run(tmp_path / "run")
    with pytest.raises(ValueError), RunFolder(target, "w", "r") as folder:
        (folder.path / REPORT).write_text("new")
        raise ValueError
    assert (target / REPORT).read_text() == EARLIER
    assert names(tmp_path) == ["run"] and names(target) == [REPORT]


def test_an_earlier_run_is_replaced_as_a_whole_and_its_folder_stays(tmp_path):
    target = earlier_run(tmp_path / "run")
    (target / "strip.png").write_text("old")
    before = target.stat().st_ino
    with RunFolder(target, "w", "r") as folder:
        (folder.path / REPORT).write_text("new")
        assert names(target)[1:] == [REPORT, "strip.png"]
    assert names(target) == [REPORT] and (target / REPORT).read_text() == "new"
    assert names(tmp_path) == ["run"] and target.stat().st_ino == before


def test_files_that_cannot_all_be_moved_stay_as_they_were(tmp_path, monkeypatch):
    target = earlier_run(tmp_path / "run")
    (target / "plan.json").write_text("old")
    rename = Path.rename

    def failing(self, place):
        if self.name == "motion.npz":
            raise OSError(errno.EIO, "Input/output error")
        return rename(self, place)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(InputError, match="Input/output error"), RunFolder(target, "w", "r") as folder:
        for name in ("plan.json", "motion.npz", REPORT):
            (folder.path / name).write_text("new")
    assert names(target) == ["plan.json", REPORT]
    assert (target / "plan.json").read_text() == "old" and (target / REPORT).read_text() == EARLIER


@pytest.mark.parametrize("strange", ["thesis.txt", "data/", "plan.json/", "recording.rrd@"])
def test_what_no_run_has_written_is_never_removed(tmp_path, strange):
    target = earlier_run(tmp_path / "run")
    path = target / strange.rstrip("/@")
    if strange.endswith("/"):
        path.mkdir()
    elif strange.endswith("@"):
        path.symlink_to("/etc/hostname")
    else:
        path.write_text("precious")
    with pytest.raises(InputError, match=f"holds {path.name}, which no run has written"):
        RunFolder(target, "w", "r")
    assert names(target) == sorted([path.name, REPORT])


def test_a_report_of_another_program_is_no_earlier_run(tmp_path):
    for text in ("{}", "[1]", "report", '{"schema": 2}'):
        target = earlier_run(tmp_path / "run", text)
        with pytest.raises(InputError, match="not an earlier run"):
            RunFolder(target, "w", "r")
        shutil.rmtree(target)


def test_a_foreign_folder_is_refused_before_anything_is_done(tmp_path):
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(InputError, match="not an earlier run"):
        RunFolder(tmp_path, "w", "r")
    with pytest.raises(InputError, match="not an earlier run"):
        RunFolder(Path("/"), "w", "r")
    with pytest.raises(InputError, match="is a file"):
        RunFolder(tmp_path / "thesis.txt", "w", "r")
    with pytest.raises(InputError, match="cannot write into .*thesis.txt; give --out another folder"):
        RunFolder(tmp_path / "thesis.txt" / "a" / "run", "w", "r")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("name", ["x" * 300, "a/" + "ö" * 200, "/proc/none/run", "y" * 5000])
def test_a_folder_that_cannot_be_made_is_found_out_at_the_start(tmp_path, name):
    with pytest.raises(InputError, match="cannot write"), RunFolder(tmp_path / name, "w", "r"):
        pytest.fail("the run began")
    assert names(tmp_path) == []


def test_a_file_that_comes_into_the_folder_meanwhile_is_kept(tmp_path):
    with pytest.raises(InputError, match="plan.json has come into it"), RunFolder(tmp_path / "run", "w", "r") as folder:
        finish(folder)
        (tmp_path / "run" / "plan.json").write_text("precious")
    assert names(tmp_path / "run") == ["plan.json"]


def test_an_empty_folder_is_used_and_the_default_one_is_named_after_world_and_robot(tmp_path, monkeypatch):
    (tmp_path / "run").mkdir()
    with RunFolder(tmp_path / "run", "w", "r") as folder:
        finish(folder)
    assert (tmp_path / "run" / REPORT).exists()
    monkeypatch.chdir(tmp_path)
    with RunFolder(None, "stairs", "walker") as folder, RunFolder(None, "stairs", "walker") as other:
        finish(other)
        finish(folder)
    assert folder.target.parent == tmp_path / "runs" and folder.target.name.startswith("stairs-walker-2")
    assert folder.target != other.target and names(folder.target) == names(other.target) == [REPORT]
    with RunFolder(None, "w" * 300, "r\udcff") as folder:
        finish(folder)
    assert len(names(tmp_path / "runs")) == 3


def test_two_runs_never_share_a_folder(tmp_path):
    with RunFolder(tmp_path / "run", "w", "r") as folder:
        with pytest.raises(InputError, match="another run is writing there"):
            RunFolder(tmp_path / "run", "w", "r")
        finish(folder)
    late = RunFolder(tmp_path / "run", "w", "r")
    with RunFolder(tmp_path / "run", "w", "r") as folder:
        with pytest.raises(InputError, match="cannot write there|another run is writing there"), late:
            pass
        finish(folder)
    assert names(tmp_path / "run") == [REPORT]


def test_what_a_killed_run_left_is_cleared_by_a_later_one(tmp_path, monkeypatch):
    left_by_a_killed_run(tmp_path / "run")
    with RunFolder(tmp_path / "run", "w", "r") as folder:
        finish(folder)
    assert names(tmp_path / "run") == [REPORT]
    left_by_a_killed_run(tmp_path / "runs" / "killed")
    monkeypatch.chdir(tmp_path)
    with RunFolder(None, "w", "r") as folder:
        finish(folder)
    assert names(tmp_path / "runs") == [folder.target.name]


def test_a_run_killed_while_its_files_were_moved_is_known_as_one(tmp_path):
    left_by_a_killed_run(tmp_path / "run")
    (tmp_path / "run" / "plan.json").write_text("moved already")
    with RunFolder(tmp_path / "run", "w", "r") as folder:
        finish(folder)
    assert names(tmp_path / "run") == [REPORT]


def test_drafts_of_processes_that_go_on_or_cannot_be_seen_are_left(tmp_path):
    (tmp_path / ".elsewhere-0.99999999-5.tmp").mkdir()
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    other = draft_in(tmp_path).name.rpartition(".tmp")[0].rpartition(".")[0]
    started = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[19]
    (tmp_path / f"{other}.{process.pid}-{started}.tmp").mkdir()
    draft_in(tmp_path).mkdir()
    assert not clear_drafts(tmp_path) and len(names(tmp_path)) == 3
    process.communicate(b"\n")
    assert clear_drafts(tmp_path) and len(names(tmp_path)) == 2
    (tmp_path / f"{other}.{os.getpid()}-1.tmp").mkdir()  # the number was another process's before
    assert clear_drafts(tmp_path) and len(names(tmp_path)) == 2


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    write_whole(tmp_path / "a" / "x.txt", b"text")
    (tmp_path / "link").symlink_to(tmp_path / "a" / "x.txt")
    write_whole(tmp_path / "link", b"through it")
    assert (tmp_path / "a" / "x.txt").read_text() == "through it" and (tmp_path / "link").is_symlink()
    write_whole(Path("/dev/null"), b"nowhere")
    assert Path("/dev/null").is_char_device()
    os.mkfifo(tmp_path / "pipe")
    for bad in ("pipe", "a", "link/deeper/y", "new/" + "z" * 300):
        with pytest.raises(InputError, match="choose another --picture"):
            write_whole(tmp_path / bad, b"", "--picture")
    assert names(tmp_path) == ["a", "link", "pipe"] and names(tmp_path / "a") == ["x.txt"]


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
    write_json(path, {"name\udcff": Path("\udcff.xml")})  # a file's name that is no UTF-8
    assert json.loads(path.read_text()) == {"name\\udcff": "\\udcff.xml"}
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
    results = [check["result"] for check in content["checks"]]
    assert results == ["PASS", "FAIL", "FAIL", "NOT_CHECKED"]
    assert content["stages"]["execution"]["tick_seconds"] == pytest.approx({"median": 1e-3, "p99": 1e-3, "max": 1e-3})
    entry = {"transition": 0, "limb": "left_foot", "time": 0.5, "duration": 0.004, "peak": 80.0, "impulse": 0.2}
    assert content["stages"]["execution"]["scuffs"] == [entry]
    assert content["stages"]["execution"]["max_scuff_impulse"] == 0.2


def test_a_report_of_a_run_without_a_search_has_every_figure(run):
    report = RunReport.without_search(run.plan.world, "r", 0, "nothing leads there", {})
    for stage, names in STAGES.items():
        assert list(report.stages[stage]) == list(names)
    assert report.stages["surfaces"]["count"] == 3 and report.verdict == "FAIL"
    assert report.stages["planning"]["found"] is False and report.stages["execution"]["completed"] is False
    assert report.stages["execution"]["max_slip"] is None


def test_a_proposal_has_its_contacts_where_the_search_had_put_them(run, tmp_path):
    """The optimiser moved the first one, and the ground turned it."""
    first, *others = run.plan.sequence.transitions
    pose = first.contact.pose @ Pose.from_yaw(np.array([0.02, 0.01, 0.003]), 0.1)
    moved = replace(first, contact=replace(first.contact, pose=pose))
    sequence = replace(run.plan.sequence, transitions=(moved, *others))
    write_plan(tmp_path / "plan.json", replace(run.plan, sequence=sequence), run.solution)
    read = read_plan(tmp_path / "plan.json"), read_proposal(tmp_path / "plan.json").sequence
    for found, wanted in zip(read, (sequence, run.solution.sequence), strict=True):
        ours, theirs = (each.transitions[0].contact.pose for each in (found, wanted))
        np.testing.assert_array_equal(ours.position, theirs.position)
        np.testing.assert_allclose(ours.rotation, theirs.rotation, rtol=0, atol=1e-14)


def test_the_plan_round_trips(run, tmp_path):
    path = tmp_path / "plan.json"
    sequence = run.plan.sequence
    first, *others = sequence.transitions
    curved = replace(first, contact=replace(first.contact, bearing=0.05))
    plan = replace(run.plan, sequence=replace(sequence, transitions=(curved, *others)))
    write_plan(path, plan, run.solution)
    again = read_plan(path)
    assert len(again.transitions) == len(plan.sequence.transitions)
    for old, new in zip(plan.sequence.transitions, again.transitions, strict=True):
        assert old.limb == new.limb and old.timing == new.timing and (old.contact is None) == (new.contact is None)
    for old, new in zip(plan.sequence.stances, again.stances, strict=True):
        for a, b in zip(old.contacts, new.contacts, strict=True):
            assert (a.limb, a.friction, a.surface, a.bearing) == (b.limb, b.friction, b.surface, b.bearing)
            np.testing.assert_allclose(a.pose.matrix, b.pose.matrix, rtol=0, atol=1e-14)  # rotation via quaternion
    first = read_json(path)["transitions"][0]["times"]
    assert first == {"shift": 0.3, "swing": 0.2, "start": 0.2, "lift_off": 0.5, "touchdown": 0.7}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "too deep"),
        ('{"a":' * 100_000, "too deep"),
        ('{"schema": ' + "9" * 5000 + "}", "not a JSON file"),
        ('{"schema": 1, "start": [{"position": [NaN, 0, 0]}], "transitions": []}', "start has no valid"),
        ("[]", "schema is broken"),
        ("null", "schema is broken"),
    ],
)
def test_a_plan_that_is_no_plan_gets_one_line(tmp_path, text, message):
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(InputError, match=message):
        read_plan(tmp_path / "plan.json")
    (tmp_path / "plan.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a JSON file"):
        read_plan(tmp_path / "plan.json")


def test_equal_arrays_make_equal_files_whatever_the_clock_said(run, tmp_path):
    motion, trajectory, execution = run.plan.motion, run.plan.trajectory, run.execution
    write_motion(tmp_path / "motion.npz", motion, trajectory)
    write_execution(tmp_path / "execution.npz", execution)
    before = [(tmp_path / name).read_bytes() for name in ("motion.npz", "execution.npz")]
    samples = replace(execution.samples, tick_seconds=2 * execution.samples.tick_seconds)
    counts = replace(execution.replanning, replan_seconds=9.0)
    slower = replace(execution, samples=samples, replanning=counts, real_time_factor=0.1)
    write_motion(tmp_path / "motion.npz", replace(motion, seconds=9.0), replace(trajectory, seconds=9.0))
    write_execution(tmp_path / "execution.npz", slower)
    assert before == [(tmp_path / name).read_bytes() for name in ("motion.npz", "execution.npz")]
    with zipfile.ZipFile(tmp_path / "motion.npz") as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


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
        (lambda plan: plan["start"][0].update(position=[0, 0, 10**400]), "start is broken: int too large"),
        (lambda plan: plan["start"][0].update(surface=10**40), "no index of a surface"),
        (lambda plan: plan["start"][0].update(surface=1e400), "start is broken"),
        (lambda plan: plan["start"][0].update(friction=10**400), "start is broken"),
        (lambda plan: plan["start"][0].update(friction=-1), "friction above zero"),
        (lambda plan: plan["start"][0].update(bearing=-0.1), "bearing is a distance above 0"),
        (lambda plan: plan["start"][0].update(position=[1e308, 0, 0]), "numbers within 10000"),
        (lambda plan: plan["start"][0].update(quaternion_wxyz=[1e-300, 0, 0, 0]), "not all zero"),
        (lambda plan: plan["transitions"][0]["times"].update(swing=1e9), "at most 10 s"),
        (lambda plan: plan["transitions"][0]["times"].update(shift=10**400), "is broken: int too large"),
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
    assert [entry["peak"] for entry in json.loads(arrays["scuffs"].item())] == [80.0]
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
