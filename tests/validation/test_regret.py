"""Regret: how made-up plans stand beside the best known ones."""

import pytest

from validation import regret
from validation.goals import MET, NOT_MET
from validation.regret import goals_of, summarise


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
    more = ["--workers", "0", "--expansions", "100", "--out", str(tmp_path / "out"), "--results", str(tmp_path)]
    assert regret.main([*options, *more]) in (0, 1)  # goals are not the point of so small an effort
    assert len(list((tmp_path / "out" / "known").iterdir())) == 2 and (tmp_path / "regret.md").is_file()
