"""Solver against reference: agreement and ratios of made-up solutions, and a walk solved by both."""

import pytest

from validation import options
from validation.sequences import GROWTH, by_contacts, by_kind, growth_trial, summarise


def solution(objective: float | None, seconds: float = 1.0, friction: float = 0.66) -> dict:
    found = {"feasible": objective is not None, "objective": objective, "seconds": seconds}
    return found | {"iterations": 10, "friction": friction, "outcome": ""}


def compared(solver: float | None, reference: float | None, **more) -> dict:
    return {"solver": solution(solver, 0.1, **more), "reference": solution(reference)}


def test_what_one_of_them_finds_alone_is_missed_or_gained():
    row = summarise("", [compared(100.0, 100.0), compared(None, 1.0), compared(1.0, None), {"solver": solution(1.0)}])
    assert (row["count"], row["asked"], row["reference_feasible"], row["missed"], row["gained"]) == (4, 3, 2, 1, 1)
    assert (row["ratio"], row["same_or_better"]) == (1.0, 1.0)
    assert row["speed"] == pytest.approx(10.0)


def test_objectives_and_margins_are_compared_where_both_are_feasible():
    row = summarise("", [compared(100.5, 100.0), compared(90.0, 100.0, friction=0.7), compared(102.0, 100.0)])
    assert row["same_or_better"] == pytest.approx(2 / 3)
    assert row["margins_kept"] == pytest.approx(2 / 3)
    assert row["ratio"] == pytest.approx(1.005)


def test_rows_by_origin_leave_the_long_walks_out_and_those_by_length_do_not():
    records = [
        {"kind": "flat", "contacts": 5, "compared": {"fixed": compared(1.0, 1.0), "free": compared(1.0, 1.0)}},
        {"kind": GROWTH, "contacts": 20, "compared": {"fixed": compared(1.0, 1.0)}},
    ]
    assert [row["title"] for row in by_kind(records)] == [
        "flat, fixed contacts",
        "flat, free landing points",
        "all",
    ]
    assert [(row["title"], row["count"]) for row in by_contacts(records)] == [
        ("1 to 10 contacts", 2),
        ("11 to 20 contacts", 1),
    ]


def test_a_walk_is_solved_by_both():
    settings = options.settings_of(options.parser("sequences", "", ["flat"], 1).parse_args([]))
    found = growth_trial(settings, 0, 2, True)
    pair = found["compared"]["fixed"]
    assert found["passed"]
    assert pair["solver"]["objective"] == pytest.approx(pair["reference"]["objective"], rel=0.01)
