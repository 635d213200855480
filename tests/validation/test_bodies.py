"""The table of one robot."""

from validation.bodies import goals_of, summarise, table
from validation.goals import MET, NOT_MET


def record(passed: bool, palms: int = 0, reason: str = "") -> dict:
    figures = {"max_slip": 0.001, "max_torque_ratio": 0.5, "max_velocity_ratio": 0.4, "com_rms_error": 0.002}
    trial = {"passed": passed, "planned": True, "reason": reason, "transitions": 9, "palm_contacts": palms}
    return trial | figures | {"stages": [{"seconds": 2.0}, {"seconds": 1.0}]}


def test_every_trial_counts_and_palms_are_counted_where_it_passed():
    row = summarise("rubble_corridor", [record(True, 3), record(True), record(False, 5, "it fell")])
    assert (row["trials"], row["passed"], row["palm_contacts"], row["runs_with_palms"]) == (3, 2, 3, 1)
    assert row["seconds"] == 3.0 and row["reason"] == "it fell"
    assert "it fell" in table([row])


def test_a_kind_on_which_nothing_passed_has_no_figures():
    row = summarise("wide_gap", [record(False, reason="too weak")] * 5)
    assert row["max_slip"] is None and "too weak" in table([row])
    (goal,) = goals_of([row])
    assert goal.result == NOT_MET


def test_the_tilts_of_the_paper_stand_beside_the_goals():
    rows = [summarise(kind, [record(True)] * 5) for kind in ("generated_stairs", "rubble_field_20")]
    assert [goal.result for goal in goals_of(rows)] == [MET]
