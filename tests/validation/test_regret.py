"""Regret: how made-up plans stand beside the best known ones."""

import json

import pytest

from toolkit.errors import InputError
from validation import regret
from validation.cases import make_cases
from validation.goals import MET, NOT_MET
from validation.regret import check_known, goals_of, summarise


def record(ratio, fewer):
    return {"kind": "rubble_field", "passed": True, "returned": 100.0 * ratio, "known": 100.0, "regret": ratio} | {
        "fewer": fewer
    }


def test_the_median_and_the_worst_world_count():
    records = [record(1.0, 1.01), record(1.04, None), record(1.19, 0.99)]
    row = summarise("rubble_field", [*records, {"kind": "rubble_field", "passed": False}])
    assert (row["worlds"], row["feasible"], row["known"]) == (4, 3, 100.0)
    assert row["regret"] == 1.04 and row["worst"] == 1.19 and row["fewer"] == 0.99
    assert [goal.result for goal in goals_of(records)] == [MET, MET, MET]
    worse = [record(1.06, 0.97), record(1.3, 1.0), record(1.06, 1.0)]
    assert [goal.result for goal in goals_of(worse)] == [NOT_MET, NOT_MET, NOT_MET]


@pytest.mark.slow
def test_a_small_effort_keeps_the_best_plan_as_a_file(tmp_path):
    options = ["--kinds", "any_gap", "--trials", "1", "--seeds", "1", "--starts", "1", "--motions", "10"]
    options += ["--workers", "0", "--expansions", "100", "--results", str(tmp_path)]
    assert regret.main([*options, "--out", str(tmp_path / "out")]) in (0, 1)  # goals are not the point of so little
    known = tmp_path / "out" / "known"
    assert len(list(known.iterdir())) == 2 and (tmp_path / "regret.md").is_file()
    regret.main([*options, "--out", str(tmp_path / "again"), "--known", str(known)])
    trial = json.loads((tmp_path / "regret.json").read_text())["trials"][0]
    assert trial["finder"] in ("the run itself", "an earlier run") and trial["regret"] < 1.01


def test_known_plans_have_to_be_of_the_same_worlds(tmp_path):
    case, other = make_cases(["any_gap"], 2, 5)
    with pytest.raises(InputError, match="holds no plan"):
        check_known(tmp_path, [case, other])
    (tmp_path / f"{case.name}.xml").write_text(case.mjcf())
    check_known(tmp_path, [case, other])
    (tmp_path / f"{other.name}.xml").write_text(case.mjcf())
    with pytest.raises(InputError, match="another world"):
        check_known(tmp_path, [case, other])
