"""write_run writes what a run made, as far as it came."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from toolkit.errors import InputError
from toolkit.report import offscreen
from toolkit.report.files import read_json
from toolkit.report.plan_file import read_plan
from toolkit.report.run import RunOptions, write_run

ALL = {"report.json", "plan.json", "motion.npz", "execution.npz", "scene.mjb", "recording.rrd"}
PLAIN = RunOptions(recording=False)


def names(folder):
    return {path.name for path in folder.iterdir()}


def test_a_whole_run_is_written(run, tmp_path):
    report = write_run(tmp_path, run.result, RunOptions(surface_seconds=0.1, settings={"time_limit": 5.0}))
    assert names(tmp_path) == ALL
    again = read_json(tmp_path / "report.json")
    assert again["checks"][0] == report.as_dict()["checks"][0] and again["options"] == {"time_limit": 5.0}
    dynamics, cost = again["stages"]["dynamics"], run.result.cost
    assert again["schema"] == 3 and dynamics["true_cost"] == pytest.approx(sum(dynamics["cost_terms"].values()))
    assert dynamics["true_cost"] == pytest.approx(cost.total) and dynamics["plan_seconds"] == cost.seconds
    assert dynamics["walking_seconds"] == run.plan.sequence.duration and dynamics["paper_objective"] > 0.0
    planning = again["stages"]["planning"]
    assert planning["first_feasible_seconds"] == 0.6 and planning["sequences_tested"] == 1
    refused, chosen = planning["sequences"]
    assert (refused["number"], refused["feasible"], refused["true_cost"]) == (0, False, None)
    assert "it stretches" in refused["reason"] and not refused["chosen"]
    assert chosen["chosen"] and chosen["feasible"] and chosen["source"] == "search" and "slip" in chosen["reason"]
    assert chosen["true_cost"] == dynamics["true_cost"] and chosen["predicted_cost"] == run.solution.predicted
    assert (chosen["transitions"], chosen["palm_contacts"]) == (6, 1)
    assert again["seed"] == 3 and again["stages"]["surfaces"]["seconds"] == 0.1
    assert read_plan(tmp_path / "plan.json").duration == run.plan.sequence.duration
    assert read_json(tmp_path / "plan.json")["transitions"][0]["times"]["start"] == pytest.approx(0.2)  # initial rest
    scene = mujoco.MjModel.from_binary_path(str(tmp_path / "scene.mjb"))
    assert np.load(tmp_path / "execution.npz")["qpos"].shape[1] == scene.nq


def test_a_rejected_plan_is_written_as_far_as_it_came(run, tmp_path):
    write_run(tmp_path, run.only(run.motion_plan))
    assert names(tmp_path) == ALL - {"execution.npz", "scene.mjb"}
    stages = read_json(tmp_path / "report.json")["stages"]
    assert stages["dynamics"]["feasible"] is True and stages["wholebody"]["feasible"] is False


def test_a_run_without_a_plan_has_a_report_and_a_recording(run, tmp_path):
    assert replace(run.result, trial=None).cost is None
    write_run(
        tmp_path, replace(run.result, trial=None, candidates=(), trials=(), reason="no way"), RunOptions(pictures=True)
    )
    assert names(tmp_path) == {"report.json", "recording.rrd"}
    assert read_json(tmp_path / "report.json")["reason"] == "no way"


def test_pictures_are_written_where_asked_for(run, tmp_path):
    try:
        offscreen.require_rendering()
    except InputError as error:
        pytest.skip(str(error))
    write_run(tmp_path, run.result, replace(PLAIN, pictures=True))
    assert names(tmp_path) == ALL - {"recording.rrd"} | {"plan.png", "execution.png", "strip.png"}


def test_a_machine_that_cannot_render_still_runs_without_pictures(run, tmp_path, monkeypatch):
    def broken(*args, **kwargs):
        raise InputError("cannot render off screen")

    monkeypatch.setattr(offscreen, "open_context", broken)
    write_run(tmp_path, run.result, PLAIN)
    with pytest.raises(InputError, match="cannot render"):
        write_run(tmp_path, run.result, replace(PLAIN, pictures=True))
