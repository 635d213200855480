"""write_run writes what a run made, as far as it came."""

from argparse import Namespace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from toolkit.errors import InputError
from toolkit.report import offscreen
from toolkit.report.files import read_json
from toolkit.report.plan_file import read_plan
from toolkit.report.run import write_run
from toolkit.report.run_report import read_report

ALL = {"report.json", "plan.json", "motion.npz", "execution.npz", "scene.mjb", "recording.rrd"}
PLAIN = dict(seed=3, no_recording=False, pictures=False, video=False, time_limit=5.0, robot=None)


def result_of(run, **changes):
    trial = dict(
        solution=run.search.solutions[-1],
        schedule=run.schedule,
        motion=run.motion,
        trajectory=run.trajectory,
        execution=run.execution,
    )
    common = dict(robot=run.robot, world=run.world, search=run.search, tested=1, reason="slip", passed=False)
    executed = changes.get("execution", run.execution)
    checks = executed.checks if executed is not None else ()
    return SimpleNamespace(**common, trial=SimpleNamespace(**(trial | changes)), checks=checks)


def names(folder):
    return {path.name for path in folder.iterdir()}


def test_a_whole_run_is_written(run, tmp_path):
    report = write_run(tmp_path, result_of(run), Namespace(**PLAIN), 0.1)
    assert names(tmp_path) == ALL
    again = read_report(tmp_path / "report.json")
    assert again.as_dict()["checks"][0] == report.as_dict()["checks"][0] and again.options == {
        "no_recording": False, "pictures": False, "video": False, "time_limit": 5.0,
    }  # fmt: skip
    assert read_plan(tmp_path / "plan.json").duration == run.sequence.duration
    assert read_json(tmp_path / "plan.json")["transitions"][0]["times"]["start"] == pytest.approx(0.2)  # initial rest
    scene = mujoco.MjModel.from_binary_path(str(tmp_path / "scene.mjb"))
    assert np.load(tmp_path / "execution.npz")["qpos"].shape[1] == scene.nq


def test_a_rejected_plan_is_written_as_far_as_it_came(run, tmp_path):
    write_run(tmp_path, result_of(run, execution=None, trajectory=None), Namespace(**PLAIN), 0.1)
    assert names(tmp_path) == ALL - {"execution.npz", "scene.mjb"}
    stages = read_report(tmp_path / "report.json").stages
    assert stages["dynamics"]["feasible"] is True and stages["wholebody"]["feasible"] is False


def test_a_run_without_a_plan_has_a_report_and_a_recording(run, tmp_path):
    nothing = SimpleNamespace(**(vars(result_of(run)) | dict(trial=None, tested=0, checks=(), reason="no way")))
    write_run(tmp_path, nothing, Namespace(**(PLAIN | dict(pictures=True))), 0.1)
    assert names(tmp_path) == {"report.json", "recording.rrd"}
    assert read_report(tmp_path / "report.json").reason == "no way"


def test_pictures_are_written_where_asked_for(run, tmp_path):
    options = Namespace(**(PLAIN | dict(pictures=True, no_recording=True)))
    try:
        offscreen.require_rendering()
    except InputError as error:
        pytest.skip(str(error))
    write_run(tmp_path, result_of(run), options, 0.1)
    assert names(tmp_path) == ALL - {"recording.rrd"} | {"plan.png", "execution.png", "strip.png"}


def test_a_machine_that_cannot_render_still_runs_without_pictures(run, tmp_path, monkeypatch):
    def broken(*args, **kwargs):
        raise InputError("cannot render off screen")

    monkeypatch.setattr(offscreen, "open_context", broken)
    write_run(tmp_path, result_of(run), Namespace(**(PLAIN | dict(no_recording=True))), 0.1)
    with pytest.raises(InputError, match="cannot render"):
        write_run(tmp_path, result_of(run), Namespace(**(PLAIN | dict(no_recording=True, pictures=True))), 0.1)
