"""Budgets: costs of made-up searches beside each other."""

import pytest

from validation.budgets import goals_of, summarise
from validation.goals import MET, NOT_MET

BUDGETS = (100, 1000)


def record(small: float | None, large: float | None, bound: float = 3.0) -> dict:
    def found(cost: float | None) -> dict:
        return {"feasible": cost is not None, "favourite": cost, "choice": cost, "bound": bound}

    budgets = {"100": found(small), "1000": found(large) | {"first_feasible_seconds": 0.1}}
    return {"kind": "rubble_field", "budgets": budgets, "states": 10, "h_violations": 0}


def test_budgets_are_compared_in_the_worlds_that_have_both():
    records = [record(100.0, 90.0), record(100.0, 103.0), record(None, 50.0), record(10.0, 8.0)]
    small, large = (summarise("rubble_field", budget, records, BUDGETS) for budget in BUDGETS)
    assert (small["feasible"], large["feasible"]) == (3, 4)
    assert small["favourite_over_smallest"] == 1.0
    assert small["favourite_worst"] is None
    assert large["favourite_over_smallest"] == pytest.approx(0.9)
    assert large["favourite_worst"] == pytest.approx(1.03)
    results = {goal.name: goal.result for goal in goals_of([small, large], records)}
    assert results["favourite: true cost at 1000 expansions over that at 100, median"] == MET
    assert results["favourite: true cost over that of any smaller budget, worst world"] == NOT_MET
    assert results["bound of ANA* at 1000 expansions, median of all worlds"] == MET
    assert results["rubble_field: first feasible sequence, median"] == MET
    assert results["states on paths whose h is at most the cost to go"] == MET
