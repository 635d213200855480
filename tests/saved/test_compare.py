"""`python -m toolkit.compare`: figures side by side, the settings that differ, and one recording."""

import csv
import io
import shutil
from dataclasses import replace

import numpy as np
import pytest

from tests.saved import damage
from tests.saved.conftest import called
from toolkit import compare, execute
from toolkit.report.comparison import as_csv, as_markdown, momentum_rates, word
from toolkit.report.comparison import compare as set_side_by_side
from toolkit.report.comparison_recording import _places
from toolkit.report.saved_run import read_run


@pytest.fixture(scope="session")
def pushed_folder(walk_folder, tmp_path_factory):
    """The same plan under a push that makes the robot fall."""
    out = tmp_path_factory.mktemp("pushed") / "walk"
    assert called(execute.main, walk_folder, "--no-recording", "--push", "3000", "--out", out)[0] == 1
    return out


@pytest.fixture(scope="session")
def comparison(walk_folder, pushed_folder, planned_folder):
    return set_side_by_side([read_run(folder) for folder in (walk_folder, pushed_folder, planned_folder)])


def row(comparison, name):
    """The values of a figure."""
    return next(values for found, _, values in comparison.figures if found == name)


def test_figures_are_those_of_the_reports(comparison, walk_folder):
    report = read_run(walk_folder).report
    assert row(comparison, "verdict") == ("PASS", "FAIL", "PASS")
    assert row(comparison, "transitions") == (2, 2, 2)
    slip = row(comparison, "largest slip")
    assert slip[0] == 1e3 * report.stages["execution"]["max_slip"] and slip[2] is None
    assert row(comparison, "objective J")[0] == row(comparison, "objective J")[1]
    assert row(comparison, "reason")[1].startswith("the robot fell")


def test_only_settings_that_differ_are_listed(comparison):
    settings = dict(comparison.settings)
    assert settings["push"] == (0.0, 3000.0, 0.0)
    assert not {"mass_error", "terrain_error", "seed", "replanning", "world"} & set(settings)


def test_runs_of_one_name_are_told_apart(comparison, walk_folder, pushed_folder):
    assert len(set(comparison.labels)) == 3
    assert comparison.labels[0].endswith("/walk") and comparison.labels[1].endswith("/walk")
    run = read_run(walk_folder)
    assert set_side_by_side([run, run]).labels == ("walk (1)", "walk (2)")


def test_momentum_rates_are_the_derivatives_of_the_measured_momenta(walk_folder):
    """Newton and Euler: the contacts change the momenta by just what was measured."""
    execution = read_run(walk_folder).execution
    assert execution is not None
    rates, momentum = momentum_rates(execution), execution.samples.momentum
    gained = np.cumsum(rates[:-1], axis=0) * execution.standard.period
    change = momentum[1:] - momentum[0]
    np.testing.assert_allclose(change[:, :3], gained[:, :3], atol=1.0)  # N s; damping moves some between steps
    np.testing.assert_allclose(change[:, 3:], gained[:, 3:], atol=0.5)  # N m s


def test_tables_hold_every_figure(comparison):
    text = as_markdown(comparison)
    assert all(f"| {name} |" in text for name, _, _ in comparison.figures) and "Settings that differ" in text
    assert {line.count("|") for line in text.splitlines() if line.startswith("|")} == {6, 5}
    rows = list(csv.reader(io.StringIO(as_csv(comparison, ["a", "b", "c"]))))
    assert len(rows) == 4 and len({len(cells) for cells in rows}) == 1
    assert [cells[1] for cells in rows] == ["folder", "a", "b", "c"]
    column = rows[0].index("largest slip [mm]")
    assert float(rows[1][column]) == row(comparison, "largest slip")[0] and rows[3][column] == ""
    assert "setting push" in rows[0]


def test_a_reason_cannot_break_a_table(walk_folder):
    run = read_run(walk_folder)
    odd = replace(run, report=replace(run.report, reason="a | b\nc", verdict="FAIL"))
    text = as_markdown(set_side_by_side([run, odd]))
    assert "| a / b c |" in text and "The settings are the same." in text


@pytest.mark.parametrize(
    ("value", "text"), [(None, "-"), (float("nan"), "-"), (True, "yes"), (0.123456, "0.1235"), (7, "7"), ("x", "x")]
)
def test_words_of_values(value, text):
    assert word(value) == text


def test_the_command_prints_and_writes(walk_folder, pushed_folder, planned_folder, tmp_path, capsys):
    names = [tmp_path / "out" / f"table{ending}" for ending in compare.ENDINGS]
    options = [word for name in names for word in ("--out", name)]
    assert called(compare.main, walk_folder, pushed_folder, planned_folder, *options) == (0, "")
    text = capsys.readouterr().out
    assert "3 runs" in text and "push" in text and text.count("written to") == 3
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(path.name for path in names)
    assert names[0].read_text().startswith("| ") and names[1].read_text().startswith("run,folder,")
    assert names[2].stat().st_size > 100_000


def test_runs_with_the_same_settings_say_so(walk_folder, capsys):
    assert called(compare.main, walk_folder, walk_folder) == (0, "")
    assert "2 runs, all with the same settings" in capsys.readouterr().out


def test_runs_stand_side_by_side_without_overlap(walk_folder):
    execution = read_run(walk_folder).execution
    assert execution is not None
    places = _places([execution] * 3)
    moved = np.array([place.floor + place.shift[:2] for place in places])
    width = np.ptp(moved[..., 1], axis=1)
    assert (np.abs(np.diff(moved[..., 1].mean(1))) > width[0]).all()
    edges = np.diff(np.vstack([places[0].floor, places[0].floor[:1]]), axis=0)
    turns = edges[:, 0] * np.roll(edges[:, 1], -1) - edges[:, 1] * np.roll(edges[:, 0], -1)
    assert (turns > 0).all(), "counterclockwise from above, so that the floor is seen from above"


def test_one_run_alone_and_other_endings_are_refused(walk_folder, tmp_path):
    assert called(compare.main, walk_folder) == (2, f"{walk_folder}: one run alone; name two or more to compare")
    code, line = called(compare.main, walk_folder, walk_folder, "--out", tmp_path / "table.xls")
    assert code == 2 and "must end in one of .md, .csv, .rrd" in line


def test_runs_that_were_not_executed_have_no_recording(planned_folder, tmp_path):
    assert called(compare.main, planned_folder, planned_folder)[0] == 0
    code, line = called(compare.main, planned_folder, planned_folder, "--out", tmp_path / "a.rrd")
    assert code == 2 and "none of these runs was executed" in line and not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["no report", "a cut execution", "no scene", "an older report", "another robot"])
def test_a_damaged_folder_gets_one_line(copy, walk_folder, tmp_path, name):
    change, words = damage.DAMAGES[name]
    change(copy)
    code, line = called(compare.main, walk_folder, copy, "--out", tmp_path / "table.md")
    assert code == 2 and words in line and str(copy) in line and not (tmp_path / "table.md").exists()


@pytest.mark.parametrize("key", ["planning", "execution"])
def test_odd_figures_of_a_report_break_nothing(copy, walk_folder, key):
    stages = read_run(walk_folder).report.stages
    odd = {name: [{"cost": "x"}] if name == "solutions" else "odd" for name in stages[key]}
    damage.edited("report.json", stages=stages | {key: odd})(copy)
    assert called(compare.main, walk_folder, copy) == (0, "")
    shutil.rmtree(copy)
