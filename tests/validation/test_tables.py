"""The arithmetic of the tables, and goals that can be missed."""

import json
import math

import pytest

from toolkit.errors import InputError
from validation import execution, goals, growth, planning, robustness
from validation.tables import failure_counts, failure_section, markdown_table, mean, median, values, write_results


def executed(name: str, **changes) -> dict:
    record = {
        "name": name,
        "planned": True,
        "feasible": True,
        "wholebody": True,
        "arrived": True,
        "held": True,
        "passed": True,
        "stage": "done",
        "reason": "",
        "max_slip": 0.01,
        "max_torque_ratio": 0.5,
        "max_velocity_ratio": 0.6,
        "unplanned_contacts": 0,
        "palm_force_error": None,
        "com_rms_error": 0.002,
        "pace": 0.3,
        "planning_seconds": 20.0,
        "real_time_factor": 2.0,
        "tick_median": 3e-4,
        "tick_99": 9e-4,
    }
    return record | changes


def test_every_trial_counts_also_one_without_a_plan():
    records = [
        executed("a", palm_force_error=0.1),
        executed("b", max_slip=0.02, com_rms_error=0.004, real_time_factor=4.0),
        executed("c", arrived=False, held=False, passed=False, max_slip=0.9, unplanned_contacts=2),
        {"name": "d", "planned": False, "passed": False, "stage": "planning", "reason": "no way"},
        {"name": "e", "passed": False, "stage": "error", "reason": "its process died"},
    ]
    row = execution.summarise("rubble_field", records)
    assert [row[name] for name in ("trials", "planned", "feasible", "arrived", "held")] == [5, 3, 3, 2, 2]
    assert row["max_slip"] == 0.02  # of what arrived: a fall slips anyhow
    assert row["unplanned_contacts"] == 2  # of all that ran
    assert row["com_rms_error"] == pytest.approx(0.003)
    assert row["palm_force_error"] == 0.1
    assert row["palm_runs"] == 1
    assert row["real_time_factor"] == 2.0
    lines = execution.table([row]).splitlines()
    assert {line.count("|") for line in lines} == {len(execution.COLUMNS) + 1}


def test_goals_are_met_missed_or_not_checked():
    assert goals.count("x", 50, 50, 45, 50).result == goals.MET
    assert goals.count("x", 45, 50, 45, 50).result == goals.MET
    assert goals.count("x", 44, 50, 45, 50).result == goals.NOT_MET
    assert goals.count("x", 5, 5, 45, 50).result == goals.NOT_CHECKED  # too few to say
    assert goals.count("x", 4, 10, 45, 50).result == goals.NOT_MET  # six failures are too many whatever comes
    assert goals.count("x", 89, 100, 45, 50).result == goals.NOT_MET
    assert goals.count("x", 0, 0, 45, 50).result == goals.NOT_CHECKED
    assert goals.at_most("x", 1.0, 1.0).result == goals.MET
    assert goals.at_most("x", math.nan, 1.0).result == goals.NOT_MET
    assert goals.at_most("x", None, 1.0).result == goals.NOT_CHECKED
    assert goals.at_least("x", 0.9, 1.0).result == goals.NOT_MET
    assert goals.every("x", 2, 3).result == goals.NOT_MET
    assert goals.every("x", 0, 0).result == goals.NOT_CHECKED


def test_goals_of_an_execution_miss_what_is_missed():
    kinds = {"rubble_field": 50, "wide_gap": 5}
    good = [execution.summarise(kind, [executed(str(i)) for i in range(n)]) for kind, n in kinds.items()]
    results = {goal.name: goal.result for goal in execution.goals_of(good)}
    assert results.pop("palm force error, worst kind of world") == goals.NOT_CHECKED
    assert set(results.values()) == {goals.MET}
    bad = [executed(str(i), max_slip=0.04, tick_median=6e-4, real_time_factor=0.9, held=False) for i in range(50)]
    missed = execution.goals_of([execution.summarise("rubble_field", bad)])
    names = {goal.name.split(",")[0] for goal in missed if goal.result == goals.NOT_MET}
    assert names == {"rubble_field: holds", "slip of any one stance", "controller tick", "real-time factor"}


def test_pace_and_planning_are_asked_of_worlds_that_leave_the_timing_to_the_planner():
    rows = [execution.summarise(kind, [executed("a", pace=0.35)]) for kind in ("flat", "rubble_field")]
    rows.append(execution.summarise("steep_slope_3m", [executed("a"), executed("b", planning_seconds=61.0)]))
    names = ["flat: pace, median", "rubble_field: pace, median", "steep_slope_3m: planning, longest"]
    found = {goal.name: goal.result for goal in execution.goals_of(rows, auto=True)}
    assert [found[name] for name in names] == [goals.NOT_MET, goals.MET, goals.NOT_MET]
    assert not {goal.name for goal in execution.goals_of(rows)} & set(names)


def test_reasons_that_differ_in_numbers_only_are_counted_together():
    records = [
        {"name": "a", "passed": False, "stage": "execution", "reason": "slip is 0.03 m, left_foot"},
        {"name": "b", "passed": False, "stage": "execution", "reason": "slip is -1.2e-3 m, right_foot"},
        {"name": "c", "passed": False, "stage": "dynamics", "reason": "slip is 1 m, left_foot"},
        {"name": "d", "passed": True, "stage": "done", "reason": ""},
    ]
    counts = failure_counts(records)
    assert counts[0] == (2, "execution", "slip is # m, foot", ["a", "b"])
    assert counts[1][0] == 1
    text = failure_section(records)
    assert "- a, execution: slip is 0.03 m, left_foot" in text
    assert "- d" not in text
    assert failure_section(records[3:]) == "No trial failed."


def test_figures_that_are_missing_are_left_out():
    records = [{"x": {"y": 1.0}}, {"x": {"y": None}}, {}, {"x": {"y": 4.0}}]
    assert values(records, "x", "y") == [1.0, 4.0]
    assert median([1.0, 4.0]) == 2.5
    assert mean([1.0, 4.0], [3.0, 1.0]) == 1.75
    assert median([]) is None
    assert mean([]) is None
    assert markdown_table(("a", "b"), [("x|y", "1")]).splitlines()[-1] == "| x/y | 1 |"


def test_the_exponent_of_a_power_law_is_found():
    assert growth.exponent([4, 8, 16, 32], [3 * x**1.5 for x in (4, 8, 16, 32)]) == pytest.approx(1.5)
    assert growth.exponent([4, 4], [1.0, 2.0]) is None
    assert growth.exponent([4, 8], [1.0, 0.0]) is None
    rows = [
        {
            "length": x,
            "way": x + 1.8,
            "found": True,
            "first_processor_seconds": x**2,
            "first_memory_gain": x,
            "first_expansions": x,
        }
        for x in (4.0, 8.0)
    ]
    results = {goal.name: goal.result for goal in growth.goals_of(growth.summarise(rows), 30.0)}
    assert results["growth: exponent of time to first sequence"] == goals.NOT_MET
    assert results["growth: first sequence found"] == goals.MET
    assert results["time limit exceeded by"] == goals.NOT_CHECKED


def plan(**changes) -> dict:
    figures = dict.fromkeys(planning._QUANTITIES, 1.0) | {"duration": 2.0}
    record = {"found": True, "feasible": True, "tested": 1, "objective": 10.0, "figures": figures}
    record |= {"palm_contacts": 2, "first_seconds": 0.04, "heuristic_seconds": 0.1, "repeatable": True}
    return record | changes


def test_the_papers_table_has_its_twelve_columns_and_both_planners():
    heavy = dict.fromkeys(planning._QUANTITIES, 3.0) | {"duration": 6.0}
    ours = [plan(), plan(figures=heavy, tested=2), plan(found=False, feasible=False, figures=None)]
    row = planning.summarise("rubble_corridor", "learned", ours)
    assert (row["found"], row["feasible"], row["tested"]) == (2, 2, 1.5)
    assert row["figures"]["linear_momentum"] == pytest.approx(2.5)  # by duration
    baseline = planning.summarise("rubble_corridor", "quasi-static", [plan()])
    lines = planning.paper_table([row, baseline]).splitlines()
    assert len(lines) == 2 + 2 + 2
    assert {line.count("|") for line in lines} == {len(planning.HEADER) + 1}
    results = {goal.name: goal.result for goal in planning.goals_of([row, baseline])}
    assert results["rubble_corridor: mean linear momentum against quasi-static"] == goals.NOT_MET
    assert results["rubble_corridor: mean CoP distance to the edge against quasi-static"] == goals.MET
    assert results["rubble_corridor: time to first feasible sequence, median"] == goals.MET


def test_a_field_without_a_plan_survives_nothing():
    run = {"survived": True, "held": True, "passed": False, "reason": "", "max_slip": 0.01, "com_rms_error": 0.002}
    fallen = run | {"survived": False, "held": False, "reason": "the robot fell", "folder": "runs/x"}
    push = next(iter(robustness.DISTURBANCES))
    records = [
        {"name": "a", "reason": "", "runs": {push: run}},
        {"name": "b", "reason": "", "runs": {push: fallen}},
        {"name": "c", "reason": "nothing leads to the goal", "runs": {}},
    ]
    (row,) = robustness.summarise([push], records)
    assert (row["trials"], row["survived"], row["held"], row["passed"]) == (3, 1, 1, 0)
    assert sorted(row["reasons"]) == ["1 x no plan: nothing leads to the goal", "1 x the robot fell"]
    assert row["folders"] == ["runs/x"]
    assert robustness.goals_of([row])[0].result == goals.NOT_CHECKED  # 2 of 10 may fail
    assert robustness.table([row]).count("1 of 3") == 2


def test_a_disturbance_scales_in_magnitude_not_in_duration():
    swept = robustness.sweep([1.0, 2.0])
    assert len(swept) == 1 + 2 * len(robustness.DISTURBANCES)
    assert swept["push of 60 N for 0.2 s, x 2"].push == 120.0
    assert swept["push of 60 N for 0.2 s, x 2"].push_duration == 0.2
    assert swept["friction -10 %"].friction_error == -0.1


def test_results_are_strict_json_with_versions_and_machine(tmp_path):
    goal = goals.at_most("x", math.inf, 1.0)
    path = write_results(
        tmp_path / "results",
        "study",
        title="A study",
        sections=[("Part", "text")],
        content={"trials": [{"value": math.nan}]},
        goals=[goal],
        settings={"seed": 1},
    )
    content = json.loads(path.with_suffix(".json").read_text())
    assert content["trials"] == [{"value": None}]
    assert content["versions"]["mujoco"]
    assert content["machine"]["cores"] >= 1
    assert content["goals"][0]["result"] == goals.NOT_MET
    assert "| x | at most 1 | inf | not met |" in path.read_text()
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="--results"):
        write_results(tmp_path / "file", "x", title="", sections=[], content={}, goals=[], settings={})
