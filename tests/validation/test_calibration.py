"""Calibration: ranks, lines and regrets of made-up worlds; the networks' second judgement; the bound on paths."""

import numpy as np
import pytest

from toolkit.errors import InputError
from toolkit.robot.loader import load_robot
from validation import options
from validation.calibration import goals_of, main, summarise
from validation.calibration_figures import rank_correlation, regret, world_figures
from validation.cases import Case
from validation.goals import MET, NOT_MET
from validation.judged_again import Judge
from validation.path_bounds import BoundCheck, PathBounds
from validation.searched import search, with_expansions
from validation.truth import Truth

OURS = "learned"


def entry(judged: float | None, objective: float, **more) -> dict:
    """A feasible sequence that the networks accept, unless told otherwise."""
    usual = {"feasible": True, "search_cost": judged, "judged": judged, "objective": objective}
    usual |= {"true_cost": objective + 100.0, "transitions": 10, "walking_seconds": 14.0, "rejected": 0}
    usual |= {"com_error": 0.01, "states": 10, "h_violations": 0, "h_part": 0.5, "h_true_part": 0.5}
    return usual | more


def record(*entries: dict, planner: str = OURS, search: int = 0, seed: int = 0) -> dict:
    return {"planner": planner, "search": search, "seed": seed, "entries": list(entries)}


def test_ranks_are_within_a_world_and_over_all_planners():
    figures = world_figures(
        [
            record(entry(100.0, 90.0), entry(200.0, 190.0)),
            record(entry(300.0, 290.0), entry(None, 1.0), planner="kinematic"),
            record(entry(200.0, 190.0), search=1),  # the same sequence again
        ],
        OURS,
    )
    assert figures.sequences == 3
    assert figures.ranks["predicted"] == 1.0
    assert figures.ranks["contacts"] is None  # all have ten
    assert figures.ratios == pytest.approx([0.9, 0.95, 290 / 300])


def test_the_favourite_is_that_of_the_first_search_alone():
    searches = [
        record(entry(1.0, 200.0), entry(2.0, 100.0, transitions=9), entry(3.0, 0.0, feasible=False, true_cost=None)),
        record(entry(0.5, 1.0), search=1),
        record(entry(0.5, 1.0), planner="kinematic"),
    ]
    figures = world_figures(searches, OURS)
    assert figures.regret == pytest.approx(300.0 / 200.0 - 1.0)
    assert figures.regrets["contacts"] == 0.0
    assert world_figures([record()], OURS).regret is None


def test_ranks_and_regrets_of_nothing_are_unknown():
    assert rank_correlation([1.0], [2.0]) is None
    assert rank_correlation([1.0, 2.0, 3.0], [3.0, 2.0, 1.0]) == -1.0
    assert regret([], "search_cost") is None


def test_a_row_counts_what_is_rejected_infeasible_and_above_the_cost_to_go():
    good = [entry(100.0 * i, 100.0 * i) for i in range(1, 4)]
    bad = entry(1.0, 0.0, feasible=False, h_violations=2)
    for name in ("rejected", "judged", "com_error"):
        del bad[name]
    row = summarise("flat", [record(*good, bad), record(entry(None, 9.0, rejected=2), planner="k")], 3)
    assert (row["judged"], row["rejected"]) == (40, 2)
    assert (row["returned"], row["infeasible"], row["states"], row["h_violations"]) == (4, 1, 40, 2)
    assert (row["ranks_predicted"], row["line"], row["regret"]) == (1.0, 1.0, 0.0)
    results = {goal.name: goal.result for goal in goals_of([row])}
    assert results["transitions of feasible sequences that are rejected"] == MET
    assert results["returned sequences that are infeasible"] == NOT_MET
    assert results["states whose h is at most the cost to go"] == NOT_MET
    assert summarise("flat", [record(*good)], 4)["ranks_predicted"] is None


def test_a_bound_above_either_cost_to_go_is_told():
    to_go = np.array([3.0, 2.0, 1.0])
    good = PathBounds(to_go, to_go, to_go / 2, to_go)
    assert (good.violations, good.largest_part, good.largest_true_part) == (0, 1.0, 0.5)
    assert PathBounds(to_go * [1.0, 1.02, 1.0], to_go, to_go, to_go).violations == 1
    assert PathBounds(to_go, to_go, to_go * [1.02, 1.0, 1.02], to_go).violations == 2
    assert PathBounds(to_go, to_go, to_go, np.full(3, np.inf)).violations == 0


@pytest.mark.parametrize("text", ["[]", "{}", '{"table": [{"kind": "flat"}]}'])
def test_another_file_cannot_stand_beside(tmp_path, text):
    path = tmp_path / "calibration.json"
    path.write_text(text)
    with pytest.raises(InputError, match="is no calibration.json"):
        main(["--kinds", "flat", "--beside", str(path), "--out", str(tmp_path), "--results", str(tmp_path)])


@pytest.fixture(scope="module")
def searched():
    """A short search with the networks, its world and its settings."""
    settings = options.settings_of(options.parser("calibration", "", ["flat"], 1).parse_args(["--planner", OURS]))
    robot, world = load_robot(None), Case("any_gap", 5).world()
    return robot, world, search(with_expansions(settings, 60), world, OURS, [5, 0], Truth(robot, world, ()))


def test_judging_a_path_again_gives_what_the_search_predicted(searched):
    robot, world, found = searched
    judge = Judge(robot, world)
    assert found.first_feasible is not None
    for tested in found.tested:
        if tested.outcome.feasible:
            judged = judge(tested.solution.sequence, tested.outcome.plan)
            assert judged.rejected == 0
            assert judged.objective == pytest.approx(tested.solution.objective.sum(), rel=1e-4)  # contacts are rounded


def test_the_cost_to_go_at_the_start_is_the_cost_of_the_path_and_of_the_plan(searched):
    _, _, found = searched
    check = BoundCheck(found.planner)
    for tested in found.tested:
        bounds = check(tested)
        assert bounds.predicted[0] == pytest.approx(tested.solution.predicted, rel=1e-6)
        if tested.outcome.feasible:
            # The rest before the first transition is the plan's alone.
            rest = found.planner.config.cost.time * tested.outcome.plan.schedule.duration
            walking = found.planner.config.cost.time * tested.solution.sequence.duration
            difference = tested.outcome.cost.total - bounds.true[0]
            assert 0.0 <= difference <= rest - walking
        assert bounds.violations == 0
        assert (np.diff(bounds.predicted) <= 0.0).all()


def test_sequences_are_ready_when_they_and_all_before_them_are_optimised(searched):
    _, _, found = searched
    spent = 0.0
    for tested in found.tested:
        spent += tested.outcome.seconds
        assert tested.ready == pytest.approx(tested.solution.seconds + spent)
    first = next(tested for tested in found.tested if tested.outcome.feasible)
    assert found.summary()["first_feasible_seconds"] == first.ready
