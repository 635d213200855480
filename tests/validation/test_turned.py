"""Copies of a world elsewhere: what is compared with what."""

import pytest

from validation import turned
from validation.goals import MET, NOT_MET
from validation.turned import deviations, goals_of, summarise


def record(copy, cost, seed=0, passed=True):
    return {"kind": "rubble_field", "seed": seed, "copy": copy, "passed": passed, "cost": cost}


def test_copies_are_compared_with_the_world_itself():
    records = [record(0, 100.0), record(1, 103.0), record(2, 90.0), record(0, 50.0, seed=1), record(1, 51.0, seed=1)]
    assert deviations(records) == pytest.approx([0.03, 0.1, 0.02])
    row = summarise("rubble_field", records)
    assert (row["worlds"], row["copies"], row["alike"]) == (2, 3, 3)
    assert [goal.result for goal in goals_of([row], records)] == [MET, MET, MET]


def test_a_copy_that_ends_differently_counts_whatever_it_costs():
    records = [record(0, 100.0), record(1, 150.0, passed=False), record(2, 120.0)]
    row = summarise("rubble_field", records)
    assert row["alike"] == 1 and deviations(records) == pytest.approx([0.2])
    assert [goal.result for goal in goals_of([row], records)] == [NOT_MET, NOT_MET, NOT_MET]


@pytest.mark.slow
def test_a_copy_of_level_ground_passes(tmp_path):
    options = ["--kinds", "flat", "--trials", "1", "--copies", "1", "--workers", "0", "--seed-offset", "0"]
    assert turned.main([*options, "--out", str(tmp_path / "out"), "--results", str(tmp_path)]) == 0
    assert "1/1" in (tmp_path / "turned.md").read_text()
