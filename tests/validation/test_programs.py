"""Tiny runs of the experiments as a user starts them."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from validation import ablation, bodies, budgets, calibration, execution, options, planning, robustness, sequences
from validation.run_trial import shown


@pytest.fixture
def folders(tmp_path) -> list[str]:
    return ["--workers", "0", "--out", str(tmp_path / "out"), "--results", str(tmp_path / "results")]


def result(folders: list[str], name: str) -> dict:
    folder = Path(folders[-1])
    assert (folder / f"{name}.md").is_file()
    return json.loads((folder / f"{name}.json").read_text())


@pytest.mark.parametrize(
    "module",
    [ablation, bodies, budgets, calibration, execution, planning, robustness, sequences],
    ids=lambda module: module.__name__,
)
def test_an_unknown_kind_of_world_is_refused_before_anything_runs(module, folders):
    from toolkit.errors import InputError

    with pytest.raises(InputError, match="no_such_world"):
        module.main(["--kinds", "no_such_world", *folders])
    assert not Path(folders[-1]).exists()


def test_networks_that_are_missing_are_refused_before_anything_runs(folders, tmp_path):
    import shutil

    from toolkit.errors import NetworkError
    from toolkit.robot.loader import load_robot

    robot = load_robot(None).folder
    shutil.copytree(robot, tmp_path / "robots" / "bare", ignore=shutil.ignore_patterns("networks"))
    with pytest.raises(NetworkError):
        execution.main(["--robots", str(tmp_path / "robots"), "--robot", "bare", "--planner", "learned", *folders])
    parser = options.parser("execution", "", ["flat"], 1)
    args = parser.parse_args(["--robots", str(tmp_path / "robots"), "--robot", "bare", *folders])
    assert options.settings_of(args).planner == "kinematic"


@pytest.mark.slow
def test_execution_runs_keeps_its_failures_and_resumes(folders, capsys):
    assert execution.main(["--kinds", "flat", "--trials", "1", *folders]) == 0
    first = result(folders, "execution")
    (row,) = first["table"]
    assert (row["trials"], row["held"], row["passed"]) == (1, 1, 1)
    assert first["trials"][0]["replays"]
    capsys.readouterr()
    assert execution.main(["--kinds", "flat", "--trials", "1", *folders]) == 0
    assert "1 of 1 trials known from before" in capsys.readouterr().out
    assert result(folders, "execution")["trials"] == first["trials"]
    # One expansion finds no plan: the trial counts, with its reason and its folder.
    code = execution.main(["--kinds", "flat", "rubble_field", "--trials", "1", "--expansions", "1", *folders])
    assert code == 1
    failed = result(folders, "execution")["trials"][1]
    assert failed["stage"] == "planning"
    assert "expansion" in failed["reason"]
    names = {path.name for path in Path(failed["folder"].replace("OUT", folders[3], 1)).iterdir()}
    assert {"report.json", "recording.rrd", "world.xml"} <= names


@pytest.mark.slow
def test_planning_compares_both_planners_and_measures_growth(folders):
    command = ["--kinds", "flat", "--trials", "1", "--lengths", "2", "4", "--growth-trials", "1", "--time-limit", "3"]
    assert planning.main([*command, *folders]) == 0
    found = result(folders, "planning")
    ours, baseline = found["table"]
    assert baseline["planner"] == "quasi-static"
    assert ours["feasible"] == baseline["feasible"] == 1
    assert ours["figures"]["cop_distance"] > 0.0
    assert ours["repeatable"]
    assert len(found["growth"]["rows"]) == 2
    assert found["growth"]["exponents"]["first_expansions"] is not None


@pytest.mark.slow
def test_robustness_executes_under_each_disturbance(folders):
    robustness.main(["--kinds", "flat", "--trials", "1", *folders])
    rows = result(folders, "robustness")["table"]
    assert [row["disturbance"] for row in rows] == [robustness.NONE, *robustness.DISTURBANCES]
    assert rows[0]["survived"] == 1


@pytest.mark.slow
def test_calibration_prices_every_sequence_and_stands_beside_an_earlier_one(folders, tmp_path):
    command = ["--kinds", "any_gap", "--trials", "1", "--expansions", "100", "--more-expansions", "60"]
    command += ["--searches", "2", "--fewest", "2", "--seed-offset", "5"]
    calibration.main([*command, *folders])
    first = result(folders, "calibration")
    (row,) = first["table"]
    assert row["worlds"] == row["counted"] == 1
    assert row["returned"] >= 1
    assert row["states"] > 0
    assert row["h_violations"] == 0
    before = Path(folders[-1]) / "calibration.json"
    before.rename(tmp_path / "before.json")
    calibration.main([*command, "--beside", str(tmp_path / "before.json"), *folders])
    assert "The same, measured" in (Path(folders[-1]) / "calibration.md").read_text()
    again = result(folders, "calibration")["sequences"]
    assert again == first["sequences"]
    assert sum(len(group["true_cost"]) for group in again if group["planner"] == "learned") >= row["returned"]


@pytest.mark.slow
def test_ablation_gives_planners_the_same_effort_and_grows(folders, tmp_path, capsys):
    command = ["--kinds", "any_slope", "--other-trials", "1", "--expansions", "150", "--planners", "learned"]
    command += ["quasi-static", "--optimisations", "2", "--seconds", "1", "--local-search", "3"]
    ablation.main([*command, "--execute", *folders])
    found = result(folders, "ablation")
    assert [row["planner"] for row in found["table"]] == 5 * ["learned"] + 5 * ["quasi-static"]
    assert all(row["feasible"] == 1 for row in found["table"] if row["variant"] != ablation.BY_TIME)
    raw, improved = found["table"][:2]
    assert improved["true cost"] <= raw["true cost"]
    assert raw["executed"] is not None
    (pair,) = [row for row in found["ratios"] if (row["over"], row["variant"]) == ("quasi-static", ablation.RAW)]
    assert pair["worlds"] == 1
    assert pair["true cost"] > 0.0
    more = [*command, "--other-trials", "2", "--grow", "--minutes", "1e-9", *folders, "--out", str(tmp_path / "more")]
    ablation.main(more)
    assert "2 of 4 trials known from before" in capsys.readouterr().out
    grown = result(folders, "ablation")
    assert [trial["name"] for trial in grown["trials"]] == [trial["name"] for trial in found["trials"]]
    assert grown["table"] == found["table"]
    assert "2 of 4 trials have not been run yet" in (Path(folders[-1]) / "ablation.md").read_text()


@pytest.mark.slow
def test_budgets_compare_searches_of_the_same_world(folders):
    budgets.main(["--kinds", "flat", "--trials", "1", "--expansions", "20", "100", *folders])
    small, large = result(folders, "budgets")["table"]
    assert (small["budget"], large["budget"]) == (20, 100)
    assert large["choice"] <= small["choice"]
    assert large["first_feasible_seconds"] > 0.0


@pytest.mark.slow
def test_sequences_come_from_searches_and_at_random(folders):
    command = ["--kinds", "flat", "--trials", "1", "--walks", "1", "--lengths", "2", "4", "--growth-trials", "1"]
    sequences.main([*command, "--expansions", "50", *folders])
    found = result(folders, "sequences")
    assert [row["title"].split(",")[0] for row in found["by_kind"]] == ["flat", "flat", "random walk", "all"]
    assert found["by_kind"][-1]["reference_feasible"] >= 2
    assert found["exponent"] is not None


def test_results_name_no_folder_of_a_machine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert shown(tmp_path / "out" / "runs" / "one", tmp_path / "out") == "out/runs/one"
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert shown(tmp_path / "out" / "runs" / "one", tmp_path / "out") == "OUT/runs/one"


def test_results_bear_the_name_of_a_robot_that_is_not_the_default(tmp_path):
    from argparse import Namespace

    shipped, folder = Path("robots").resolve(), tmp_path / "robots"
    for name in ("one", "two"):  # a folder of several robots without a default
        (folder / name).mkdir(parents=True)
        (folder / name / "robot.toml").write_text("")
    default = (shipped / "default").read_text().strip()
    named = [(None, None, default), (default, None, default), ("one", None, "one"), ("one", folder, "one")]
    found = [
        options.results_name("map", SimpleNamespace(name=name), Namespace(robot=robot, robots=robots))
        for robot, robots, name in named
    ]
    assert found == ["map", "map", "map_one", "map_one"]
