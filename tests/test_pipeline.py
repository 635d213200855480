"""The pipeline's order of things: which sequences are tested, and what is searched again."""

from types import SimpleNamespace

import pytest

from toolkit import pipeline
from toolkit.contacts.failure import Failure
from toolkit.geometry.limb import Limb
from toolkit.pipeline import loop


def solution(name, *limbs, start=()):
    """A solution whose transitions make contacts with limbs, or break them where a palm is in contact."""
    palms = [set(start)]
    for limb in limbs:
        palms.append(palms[-1] if limb.is_foot else palms[-1] ^ {limb})
    stances = [SimpleNamespace(palms=tuple(each), contacts=()) for each in palms]
    transitions = [SimpleNamespace(limb=limb, contact=None) for limb in limbs]
    return SimpleNamespace(
        name=name, sequence=SimpleNamespace(transitions=transitions, stances=stances, start=stances[0])
    )


class Planner:
    """Finds what it is given: with palms, and for the feet alone."""

    hasty = 0

    def __init__(self, with_palms, without):
        self.found, self.calls = {True: with_palms, False: without}, []

    def search(self, rng, time_limit, observer=None, exclusions=(), palms=True):
        self.calls.append(palms)
        return SimpleNamespace(
            solutions=self.found[palms],
            reason="",
            warning="",
            seconds=0.0,
            heuristic_seconds=0.0,
            expansions=1,
            hasty=self.hasty,
        )


def run(planner, passing, monkeypatch, candidates=6):
    tested = []

    class Tester:
        def __init__(self, *parts):
            pass

        def test(self, item):
            tested.append(item.name)
            failure = None if item.name in passing else Failure("it fell")
            return SimpleNamespace(passed=failure is None, merit=(len(tested),), failure=failure)

    monkeypatch.setattr(loop, "Tester", Tester)
    config = pipeline.PipelineConfig(candidates=candidates)
    return pipeline.run(None, None, planner, config), tested  # pyright: ignore[reportArgumentType]


FOOT, PALM = Limb.LEFT_FOOT, Limb.RIGHT_PALM


def test_the_newest_sequence_comes_first_and_ends_the_run_where_it_passes(monkeypatch):
    planner = Planner([solution("old", FOOT), solution("new", FOOT, PALM)], [])
    result, tested = run(planner, {"new", "old"}, monkeypatch)
    assert tested == ["new"] and planner.calls == [True]
    assert result.passed and result.tested == 1


def test_what_was_only_to_come_soon_is_not_tested(monkeypatch):
    planner = Planner([solution("soon", FOOT), solution("old", FOOT), solution("new", FOOT)], [])
    planner.hasty = 1
    result, tested = run(planner, {"soon"}, monkeypatch)
    assert tested == ["new", "old"] and not result.passed


def test_where_palms_fail_the_feet_are_searched_alone(monkeypatch):
    palms = [solution(f"palms {number}", FOOT, PALM) for number in range(5)]
    planner = Planner(palms, [solution("feet", FOOT)])
    result, tested = run(planner, {"feet"}, monkeypatch)
    assert tested == ["palms 4", "palms 3", "palms 2", "feet"]  # palms get half of the six
    assert planner.calls == [True, False] and result.passed


def test_feet_that_first_let_go_of_the_wall_are_tested_as_feet_alone(monkeypatch):
    palms = [solution(f"palms {number}", FOOT, FOOT, start=[PALM]) for number in range(5)]
    planner = Planner(palms, [solution("feet", PALM, FOOT, start=[PALM])])
    result, tested = run(planner, {"feet"}, monkeypatch)
    assert tested == ["palms 4", "palms 3", "palms 2", "feet"] and result.passed


@pytest.mark.parametrize("count", [1, 4])
def test_no_more_than_the_candidates_are_tested(monkeypatch, count):
    planner = Planner([solution("palms", PALM)], [solution(f"feet {number}", FOOT) for number in range(9)])
    result, tested = run(planner, set(), monkeypatch, candidates=count)
    assert len(tested) <= count and not result.passed
    assert result.reason == "it fell"
