"""The ablation: equal efforts of made-up searches, and ratios world by world."""

from types import SimpleNamespace

import pytest

from validation.ablation import compare, goals_of, ratios, summarise
from validation.ablation_trial import BEST, LOCAL, RAW, Effort, accounts, spend
from validation.goals import MET, NOT_CHECKED
from validation.searched import Searched, cheapest, favourite

FEASIBLE_SECONDS = 1.0


def item(name: str, predicted: float, true: float, found: float = 0.0, feasible: bool = True):
    """A sequence that took a second to optimise."""
    solution = SimpleNamespace(sequence=SimpleNamespace(identity=name), predicted=predicted, seconds=found)
    outcome = SimpleNamespace(feasible=feasible, cost=SimpleNamespace(total=true), seconds=FEASIBLE_SECONDS)
    return SimpleNamespace(solution=solution, outcome=outcome)


def searched(*found, seconds: float = 2.0) -> Searched:
    result = SimpleNamespace(seconds=seconds, heuristic_seconds=0.1)
    return Searched(None, result, found)


def test_favourite_and_cheapest_leave_infeasible_sequences_out():
    found = [item("a", 3.0, 1.0), item("b", 2.0, 5.0), item("c", 1.0, 0.0, feasible=False)]
    assert favourite(found) is found[1]
    assert cheapest(found) is found[0]
    assert favourite(found[2:]) is cheapest([]) is None


def test_a_sequence_is_paid_for_once():
    a, b = item("a", 3.0, 1.0, found=0.5), item("b", 2.0, 2.0, found=1.5)
    ledger = accounts([searched(a, b), searched(a, item("c", 1.0, 1.0, found=1.0))])
    # heuristic 0.1, search until found, one second for each optimisation until then
    assert [spent.at for spent in ledger] == pytest.approx([0.1 + 0.5 + 1, 0.1 + 1.5 + 2, 2.1 + 0.1 + 1.0 + 3])


def test_efforts_are_spent_on_the_predicted_cheapest_or_as_sequences_are_found():
    dear, cheap = item("dear", 9.0, 1.0, found=0.1), item("cheap", 1.0, 7.0, found=1.9)
    late = item("late", 0.5, 0.5, found=1.0)
    searches = [searched(dear, cheap), searched(late)]
    by_count, by_time = spend(Effort(optimisations=1, seconds=1.3), searches)
    assert (by_count, by_time) == (cheap, dear)
    assert spend(Effort(optimisations=2, seconds=1.0), searches) == (dear, None)
    assert spend(Effort(optimisations=3, seconds=100.0), searches) == (late, late)


def record(planner: str, seed: int, cost: float | None) -> dict:
    plan = {"true_cost": cost, "objective": cost, "transitions": 5, "palm_contacts": 0, "executed": True}
    variants = {} if cost is None else {name: plan for name in (RAW, BEST)}
    return {"kind": "rubble_field", "planner": planner, "seed": seed, "found": True, "variants": variants}


def test_ratios_are_of_the_same_worlds():
    records = [record("learned", seed, 10.0 * seed) for seed in (1, 2, 3)]
    records += [record("quasi-static", seed, cost) for seed, cost in ((1, 20.0), (2, 20.0), (3, None), (4, 1.0))]
    found = ratios("rubble_field", RAW, records, "learned", "quasi-static")
    assert (found["worlds"], found["true cost"], found["seconds of walking"]) == (2, 0.75, None)
    results = {goal.name: goal.result for goal in goals_of([found])}
    assert results[f"rubble_field, {RAW}: true cost over quasi-static"] == MET
    assert results[f"rubble_field, {BEST}: true cost over quasi-static"] == NOT_CHECKED


def test_planners_are_compared_with_those_that_ran():
    records = [record(planner, 1, cost) for planner, cost in (("learned", 9.0), ("optimiser", 10.0))]
    found = compare("rubble_field", [RAW], records, ["learned", "optimiser", "kinematic"])
    costs = {(each["planner"], each["over"]): each["true cost"] for each in found}
    assert costs == {
        ("learned", "kinematic"): None,
        ("optimiser", "kinematic"): None,
        ("learned", "optimiser"): 0.9,
        ("kinematic", "optimiser"): None,
    }


def test_a_row_counts_worlds_without_a_plan():
    row = summarise("rubble_field", "learned", RAW, [record("learned", 1, 10.0), record("learned", 2, None)])
    assert (row["trials"], row["found"], row["feasible"], row["executed"]) == (2, 2, 1, 1)
    assert row["true cost"] == 10.0


def test_without_motions_there_is_no_local_search():
    assert set(Effort().variants) - set(Effort(motions=0).variants) == set(LOCAL.values())
