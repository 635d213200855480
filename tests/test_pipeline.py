"""The pipeline's order of things: what is optimised, which sequence is chosen, and what is searched again."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from toolkit import pipeline
from toolkit.contacts.failure import Failure
from toolkit.execution.check import Check
from toolkit.geometry.limb import Limb
from toolkit.pipeline import Source, loop, trial
from toolkit.refine import RefineConfig
from toolkit.robot.scale import USUAL
from toolkit.search.moves.limits import MOST_CARE
from toolkit.wholebody.plan import LEVEL, WIDE, Manner
from toolkit.world.timing import Timing


def solution(name, *limbs, start=(), seconds=0.0):
    """A solution whose transitions make contacts with limbs, or break them where a palm is in contact."""
    palms = [set(start)]
    for limb in limbs:
        palms.append(palms[-1] if limb.is_foot else palms[-1] ^ {limb})
    stances = [SimpleNamespace(palms=tuple(each), contacts=()) for each in palms]
    transitions = [SimpleNamespace(limb=limb, contact=None, timing=Timing(swing=0.5)) for limb in limbs]
    sequence = SimpleNamespace(
        name=name, identity=name.encode(), transitions=transitions, stances=stances, start=stances[0]
    )

    def timed(timing, only=None):
        return SimpleNamespace(name=f"{name} at {timing.swing:g}" + ("" if only is None else f" in {only}"))

    sequence.timed = timed
    return SimpleNamespace(name=name, sequence=sequence, seconds=seconds, plan=None)


class Planner:
    """Finds what it is given: with palms, and for the feet alone."""

    paces, brisk = 1, False
    calm: list | None = None  # what the searches after the first find; None for the same again

    def __init__(self, with_palms, without):
        self.found, self.calls, self.exclusions, self.care = {True: with_palms, False: without}, [], [], []

    def search(self, rng, time_limit, observer=None, exclusions=(), palms=True, calmer=0, care=0):
        self.calls.append(palms)
        self.pace = calmer
        self.care.append(care)
        self.exclusions.append(len(exclusions))
        return SimpleNamespace(
            solutions=self.found[palms] if len(self.calls) == 1 or self.calm is None else self.calm,
            reason="",
            warning="",
            seconds=1.0,
            heuristic_seconds=0.0,
            expansions=1,
            slides=False,
            paced=False,
            calmer=tuple(Timing(swing=float(pace)) for pace in range(calmer + 1, self.paces)),
            brisker=self.brisk and calmer == 0,
            screen=SimpleNamespace(),
        )


class Restless(Planner):
    """Finds sequences of other names, a letter each, with every search, and keeps the paces that were asked for."""

    def __init__(self, *names):
        super().__init__([], [])
        self.names, self.asked = names, []

    def search(self, *args, calmer=0, **settings):
        self.found[True] = [solution(name, FOOT) for name in self.names[len(self.calls)]]
        self.asked.append(calmer)
        return super().search(*args, calmer=calmer, **settings)


class Run:
    """A run with made-up costs; infinite ones have no motion, and only sequences in `passing` pass.

    The local search turns a sequence into what `better` has for its name; those in `hurrying` ask too much of joints.
    What has no motion lacks it from `since` s on, those in `stretching` for the legs. What does not pass fails in the
    transition `failed_at`; for those in `touching` no pace is to blame.
    """

    def __init__(
        self,
        planner,
        passing,
        monkeypatch,
        cost=None,
        better=None,
        hurrying=None,
        since=None,
        failed_at=None,
        still=True,
        touching=None,
        stretching=(),
        **settings,
    ):
        self.optimised, self.tested, self.improved = [], [], []
        optimised, tested, asked, cost, better = self.optimised, self.tested, self.improved, cost or {}, better or {}

        class Tester:
            slide = part = None

            def __init__(self, *parts):
                pass

            def optimise(self, sequence, known=None):
                optimised.append(sequence.name)
                failure = Failure("no motion", since, 0, stretched=sequence.name in stretching)
                failure = failure if cost.get(sequence.name, 0.0) == np.inf else None
                return SimpleNamespace(name=sequence.name, sequence=sequence), failure

            def motion_of(self, sequence):
                motion = SimpleNamespace(feasible=sequence.name in cost)
                return SimpleNamespace(name=sequence.name, sequence=sequence, motion=motion)

            def settled(self, plan):
                return plan

            def test(self, candidate):
                if candidate.failure is None:
                    tested.append(candidate.plan.name)
                passed = candidate.plan.name in passing
                hurried, touches = (candidate.plan.name in (names or ()) for names in (hurrying, touching))
                failed = Failure("it fell", transition=failed_at, too_fast=hurried, at_any_pace=touches)
                failure = candidate.failure or (None if passed else failed)
                return SimpleNamespace(candidate=candidate, passed=passed, merit=(passed,), failure=failure)

        def plan_cost(plan, config):
            return SimpleNamespace(total=cost.get(plan.name, 0.0))

        class LocalSearch:
            spent = 0

            def __init__(self, *parts):
                pass

            def improved(self, plan, origin, screen, allowed):
                asked.append(plan.name)
                if plan.name not in better:
                    return plan
                made = solution(better[plan.name], FOOT).sequence
                return SimpleNamespace(name=made.name, sequence=made)

        monkeypatch.setattr(loop, "LocalSearch", LocalSearch)
        monkeypatch.setattr(
            loop, "refined_solution", lambda plan, cost, seconds: solution(plan.name, FOOT, seconds=seconds)
        )
        monkeypatch.setattr(loop, "Tester", Tester)
        monkeypatch.setattr(loop, "plan_cost", plan_cost)
        config = pipeline.PipelineConfig(**{"candidates": 6} | settings)
        robot = SimpleNamespace(scale=USUAL, stands_on_one_foot=still)
        self.result = pipeline.run(robot, None, planner, config)  # pyright: ignore[reportArgumentType]


FOOT, PALM = Limb.LEFT_FOOT, Limb.RIGHT_PALM


def test_all_are_optimised_and_the_truly_cheapest_is_chosen(monkeypatch):
    planner = Planner([solution("old", FOOT), solution("cheap", FOOT), solution("new", FOOT, PALM)], [])
    run = Run(planner, {"new", "cheap", "old"}, monkeypatch, {"old": 3.0, "cheap": 1.0, "new": 2.0})
    assert run.optimised == ["new", "cheap", "old"]  # the newest is predicted to be the cheapest
    assert run.tested == ["cheap"] and planner.calls == [True]
    result = run.result
    assert result.passed and [item.number for item in result.candidates] == [0, 1, 2]
    assert [result.is_chosen(item) for item in result.candidates] == [False, True, False]


def test_what_fails_later_makes_room_for_the_next_cheapest(monkeypatch):
    planner = Planner([solution("old", FOOT), solution("cheap", FOOT), solution("new", FOOT)], [])
    run = Run(planner, {"old"}, monkeypatch, {"old": 3.0, "cheap": 1.0, "new": 2.0})
    assert run.tested == ["cheap", "new", "old"] and run.result.passed
    assert [run.result.reason_against(item) for item in run.result.candidates] == ["it fell", "it fell", ""]


def test_where_nothing_is_found_the_pace_yields_as_long_as_it_may(monkeypatch):
    planner = Planner([], [])
    planner.paces = 3
    result = Run(planner, set(), monkeypatch).result
    assert planner.calls == [True, True, True] and planner.pace == 2 and not result.passed


def test_the_pace_yields_at_once_where_joints_cannot_keep_it(monkeypatch):
    found = [solution("hurried", FOOT, PALM), solution("other", FOOT)]
    planner = Planner(found, [])
    planner.paces = 2
    run = Run(planner, set(), monkeypatch, {"hurried": 1.0, "other": 2.0}, hurrying={"hurried"})
    # the other sequence of the same pace is not tested, no transition is excluded, and palms stay
    assert run.tested == ["hurried"] and planner.pace == 1
    assert planner.calls[:2] == [True, True] and planner.exclusions[:2] == [0, 0]


def test_the_pace_yields_where_a_calmer_one_costs_clearly_less(monkeypatch):
    planner = Planner([solution("fast", FOOT)], [])
    planner.paces, planner.calm = 2, [solution("slow", FOOT)]
    run = Run(planner, {"fast", "slow"}, monkeypatch, {"fast": 10.0, "fast at 1": 8.0, "slow": 7.0})
    assert run.tested == ["slow"] and planner.pace == 1 and planner.calls == [True, True]
    for cost in (9.5, np.inf):  # no more than a local search saves, and no motion at all
        planner = Planner([solution("fast", FOOT)], [])
        planner.paces, planner.calm = 2, [solution("slow", FOOT)]
        assert Run(planner, {"fast"}, monkeypatch, {"fast": 10.0, "fast at 1": cost}).tested == ["fast"]


def test_the_pace_yields_by_as_much_as_pays(monkeypatch):
    """By two paces at once, of which each is clearly cheaper, and not to a third one that is hardly so."""
    planner = Planner([solution("fast", FOOT)], [])
    planner.paces, planner.calm = 4, [solution("slow", FOOT)]
    cost = {"fast": 10.0, "fast at 1": 8.0, "fast at 2": 6.0, "fast at 3": 5.8, "slow": 5.0, "slow at 3": 4.8}
    assert Run(planner, {"slow"}, monkeypatch, cost).tested == ["slow"]
    assert planner.pace == 2 and planner.calls == [True, True]


def test_the_pace_yields_where_that_pays_for_what_the_local_search_made(monkeypatch):
    planner = Planner([solution("fast", FOOT)], [])
    planner.paces, planner.calm = 2, [solution("slow", FOOT)]
    cost = {"fast": 10.0, "fast at 1": 9.5, "better": 9.0, "better at 1": 7.0, "slow": 6.0}
    run = Run(planner, {"slow", "better"}, monkeypatch, cost, {"fast": "better"})
    assert run.tested == ["slow"] and planner.pace == 1


def test_the_pace_yields_after_a_few_failures(monkeypatch):
    """Two of three are tested, then a calmer pace is searched; where there is none, all three are."""
    for paces, tested in ((2, ["a", "b", "slow"]), (1, ["a", "b", "c"])):
        planner = Planner([solution(name, FOOT) for name in "abc"], [])
        planner.paces, planner.calm = paces, [solution("slow", FOOT)]
        cost = {"a": 1.0, "b": 2.0, "c": 3.0, "slow": 9.0}
        assert Run(planner, {"slow"}, monkeypatch, cost).tested == tested


@pytest.mark.parametrize("calm", [[], [solution("slow", FOOT)]])
def test_what_a_faster_pace_found_counts_at_both_timings_where_a_calmer_one_finds_nothing_cheaper(calm, monkeypatch):
    planner = Planner([solution("fast", FOOT)], [])
    planner.paces, planner.calm = 2, calm
    run = Run(planner, {"fast", "slow"}, monkeypatch, {"fast": 10.0, "fast at 1": 8.0, "slow": 11.0})
    assert run.tested == ["fast at 1", "fast"] and planner.pace == 1 and run.result.passed
    timed = run.result.candidates[1]
    assert timed.source == Source.TIMED and timed.search == 0 and timed.cost.total == 8.0


@pytest.mark.parametrize("failed_at", [0, 1], ids=["transition", "final rest"])
def test_where_a_transition_fails_it_alone_is_slowed_down_at_first(monkeypatch, failed_at):
    """With the next calmer timing; where that has no motion or there is none, the next search follows as ever.

    The last transition is to blame for what fails in the final rest.
    """
    for paces, cost, tested in (
        (2, {"fast": 10.0, "fast at 1": 10.0, "fast at 1 in 0": 10.5}, ["fast", "fast at 1 in 0"]),
        (2, {"fast": 10.0, "fast at 1": 10.0}, ["fast", "slow"]),
        (1, {"fast": 10.0, "fast at 1 in 0": 10.5}, ["fast", "slow"]),
    ):
        planner = Planner([solution("fast", FOOT)], [])
        planner.paces, planner.calm = paces, [solution("slow", FOOT)]
        run = Run(planner, {"fast at 1 in 0", "slow"}, monkeypatch, cost, failed_at=failed_at)
        assert run.tested == tested and run.result.passed


@pytest.mark.parametrize("stretching", ["ab", ""])
def test_where_legs_are_asked_too_much_the_margins_of_the_next_search_grow(monkeypatch, stretching):
    """Before the pace yields, which it does at once where other limits are broken."""
    planner = Planner([solution("a", FOOT), solution("b", FOOT)], [])
    planner.paces, planner.calm = 2, [solution("other", FOOT)]
    run = Run(planner, {"other"}, monkeypatch, {"a": np.inf, "b": np.inf, "other": 1.0}, stretching=stretching)
    assert run.result.passed
    assert (planner.care, planner.pace) == (([0, 1], 0) if stretching else ([0, 0], 1))


def test_margins_that_leave_nothing_shrink_for_good(monkeypatch):
    planner = Planner([solution("a", FOOT)], [])
    planner.paces, planner.calm = 2, []
    run = Run(planner, set(), monkeypatch, {"a": np.inf}, stretching="a")
    assert planner.care == [0, 1, 0, 0, 0] and not run.result.passed


@pytest.mark.parametrize("brisk", [False, True])
def test_the_margins_grow_as_often_as_they_may_and_then_the_pace_is_brisker_once(monkeypatch, brisk):
    names = "abcdefghi"
    planner = Restless(*names)
    planner.brisk, planner.paces = brisk, 2
    Run(planner, set(), monkeypatch, dict.fromkeys(names, np.inf), stretching=names, optimisations=7)
    assert planner.care[:4] == [0, 1, 2, MOST_CARE]
    assert planner.asked == ([0, 0, 0, 0, -1, 0, 1] if brisk else [0, 0, 0, 0, 1, 1, 1])


def test_a_pace_that_spares_the_legs_does_not_yield_after_a_few_failures(monkeypatch):
    planner = Restless("a", "", "bcd", "e")
    planner.brisk, planner.paces = True, 2
    cost = {"a": np.inf, "b": 1.0, "c": 2.0, "d": 3.0, "e": 4.0}
    run = Run(planner, {"e"}, monkeypatch, cost, stretching="a", candidates=8)
    assert run.tested == ["b", "c", "d", "e"] and planner.asked == [0, 0, -1, -1] and run.result.passed


def test_where_links_touch_the_world_the_pace_does_not_yield(monkeypatch):
    """Nor is the transition to blame slowed down; the next search does without it."""
    planner = Planner([solution("fast", FOOT)], [])
    planner.paces, planner.calm = 2, [solution("other", FOOT)]
    cost = {"fast": 10.0, "fast at 1": 10.0, "fast at 1 in 0": 10.5, "other": 11.0}
    run = Run(planner, {"fast at 1 in 0", "other"}, monkeypatch, cost, failed_at=0, touching={"fast"})
    assert run.tested == ["fast", "other"] and run.result.passed
    assert planner.pace == 0 and planner.exclusions == [0, 1]


def test_where_a_slowed_transition_leaves_links_that_touch_the_world_both_are_blamed(monkeypatch):
    planner = Planner([solution("fast", FOOT)], [])
    planner.paces, planner.calm = 2, [solution("other", FOOT)]
    cost = {"fast": 10.0, "fast at 1": 10.0, "fast at 1 in 0": 10.5, "other": 11.0}
    run = Run(planner, {"other"}, monkeypatch, cost, failed_at=0, touching={"fast at 1 in 0"})
    assert run.tested == ["fast", "fast at 1 in 0", "other"] and run.result.passed
    assert planner.pace == 0 and planner.exclusions == [0, 2]


def test_where_a_calmer_pace_finds_nothing_the_one_before_is_searched_again(monkeypatch):
    """What had not been tested there is, and the pace yields no more; where it found nothing either, that is all."""
    planner = Planner([solution(name, FOOT) for name in "abcd"], [])
    planner.paces, planner.calm = 3, []
    cost = {"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0, "c at 1": 1.0}
    run = Run(planner, {"d"}, monkeypatch, cost)
    assert run.tested == ["a", "b", "c", "d"] and run.result.passed
    assert planner.calls == [True] * 4 and planner.pace == 0
    planner = Planner([solution(name, FOOT) for name in "abcd"], [])
    planner.paces, planner.calm = 3, []
    run = Run(planner, set(), monkeypatch, cost)
    assert run.tested == ["a", "b", "c", "d"] and not run.result.passed
    assert planner.calls == [True] * 4 and planner.pace == 0


def test_on_soles_that_roll_failures_ask_for_no_calmer_pace(monkeypatch):
    planner = Planner([solution(name, FOOT) for name in "abc"], [])
    planner.paces, planner.calm = 2, [solution("slow", FOOT)]
    cost = {"a": 1.0, "b": 2.0, "c": 3.0, "slow": 9.0}
    run = Run(planner, {"c"}, monkeypatch, cost, still=False)
    assert run.tested == ["a", "b", "c"] and planner.pace == 0 and run.result.passed


def test_a_pace_that_may_not_yield_is_kept(monkeypatch):
    planner = Planner([solution("hurried", FOOT), solution("other", FOOT)], [])
    run = Run(planner, {"other"}, monkeypatch, {"hurried": 1.0, "other": 2.0}, hurrying={"hurried"})
    assert run.tested == ["hurried", "other"] and planner.calls == [True] and run.result.passed


def test_the_first_feasible_sequence_counts_and_not_the_first_one(monkeypatch):
    found = [solution(name, FOOT, seconds=seconds) for name, seconds in (("first", 0.1), ("second", 0.4), ("c", 0.9))]
    run = Run(Planner(found, []), {"c"}, monkeypatch, {"first": np.inf})
    first = run.result.first_feasible
    assert first is not None and first.seconds == 0.4
    nothing = Run(Planner(found[:1], []), set(), monkeypatch, {"first": np.inf}).result
    assert nothing.first_feasible is None and not nothing.passed and nothing.reason == "no motion"
    assert nothing.trial is not None and not nothing.trials


def test_the_time_of_a_later_search_includes_those_before_it(monkeypatch):
    planner = Planner([solution("palms", PALM, seconds=0.3)], [solution("feet", FOOT, seconds=0.2)])
    run = Run(planner, {"feet"}, monkeypatch, {"palms": np.inf})
    assert run.result.first_feasible is not None and run.result.first_feasible.seconds == pytest.approx(1.2)


def test_equal_sequences_are_optimised_once(monkeypatch):
    planner = Planner([solution("same", FOOT), solution("other", PALM), solution("same", FOOT)], [])
    planner.found[False] = planner.found[True]
    run = Run(planner, set(), monkeypatch)
    assert sorted(run.optimised) == ["other", "same"]
    assert planner.calls == [True, False]  # the second search brings nothing new, so there is no third


def test_infeasible_sequences_are_excluded_from_the_next_search(monkeypatch):
    planner = Planner([solution("a", FOOT), solution("b", FOOT), solution("palms", PALM)], [solution("feet", FOOT)])
    monkeypatch.setattr(loop.Blame, "first_in", lambda self, sequence, since=0: None)
    run = Run(planner, {"feet"}, monkeypatch, {"a": np.inf, "b": np.inf, "palms": np.inf})
    assert planner.exclusions == [0, 3] and run.result.passed


def test_where_palms_fail_the_feet_are_searched_alone(monkeypatch):
    palms = [solution(f"palms {number}", FOOT, PALM) for number in range(5)]
    planner = Planner(palms, [solution("feet", FOOT)])
    run = Run(planner, {"feet"}, monkeypatch)
    assert run.tested == ["palms 4", "palms 3", "palms 2", "feet"]  # palms get half of the six
    assert planner.calls == [True, False] and run.result.passed


def test_feet_that_first_let_go_of_the_wall_are_tested_as_feet_alone(monkeypatch):
    palms = [solution(f"palms {number}", FOOT, FOOT, start=[PALM]) for number in range(5)]
    planner = Planner(palms, [solution("feet", PALM, FOOT, start=[PALM])])
    run = Run(planner, {"feet"}, monkeypatch)
    assert run.tested == ["palms 4", "palms 3", "palms 2", "feet"] and run.result.passed


@pytest.mark.parametrize("count", [1, 4])
def test_no_more_than_the_candidates_are_tested(monkeypatch, count):
    planner = Planner([solution("palms", PALM)], [solution(f"feet {number}", FOOT) for number in range(9)])
    run = Run(planner, set(), monkeypatch, candidates=count)
    assert len(run.tested) <= count and not run.result.passed
    assert run.result.reason == "it fell"


def test_a_search_gets_half_of_the_optimisations_that_are_left(monkeypatch):
    planner = Planner([solution(f"palms {number}", PALM) for number in range(9)], [])
    planner.found[False] = [solution(f"feet {number}", FOOT) for number in range(9)]
    run = Run(planner, set(), monkeypatch, dict.fromkeys([f"palms {n}" for n in range(9)], np.inf), optimisations=7)
    assert run.optimised == ["palms 8", "palms 7", "palms 6", "palms 5", "feet 8", "feet 7", "feet 6"]
    assert planner.calls == [True, False, False] and not run.result.passed


def test_the_cheapest_are_improved_before_anything_is_tested(monkeypatch):
    planner = Planner([solution(name, FOOT, seconds=0.5) for name in "abcd"], [])
    cost = {"a": 4.0, "b": 3.0, "c": 2.0, "d": 1.0, "c+": 0.5}
    run = Run(planner, {"c+"}, monkeypatch, cost, {"c": "c+"}, refine=RefineConfig(starts=2))
    assert run.improved == ["d", "c"] and run.tested == ["c+"] and run.result.passed
    last = run.result.candidates[-1]
    assert (last.source, last.number, last.search) == (Source.LOCAL, 4, 0) and run.result.is_chosen(last)
    first = run.result.first_feasible
    assert first is not None and first.source == Source.SEARCH  # the search found it, not the local search


def test_where_an_improved_sequence_fails_the_next_ones_are_improved_and_tested(monkeypatch):
    planner = Planner([solution(name, FOOT) for name in "abc"], [])
    cost = {"a": 3.0, "b": 2.0, "c": 1.0, "c+": 0.5, "b+": 0.7}
    run = Run(planner, {"b+"}, monkeypatch, cost, {"c": "c+", "b": "b+"}, refine=RefineConfig(starts=1))
    assert run.improved == ["c", "b"] and run.tested == ["c+", "c", "b+"] and run.result.passed


def test_without_a_local_search_nothing_is_improved(monkeypatch):
    run = Run(Planner([solution("a", FOOT)], []), {"a"}, monkeypatch, better={"a": "a+"}, refine=None)
    assert not run.improved and run.tested == ["a"]


def test_equal_failures_before_anything_has_moved_end_the_run(monkeypatch):
    """Sequences have no part in them, so a third one is not optimised."""
    names = [f"{number}" for number in range(5)]
    planner = Planner([solution(name, FOOT) for name in names], [])
    run = Run(planner, set(), monkeypatch, dict.fromkeys(names, np.inf), since=0.0)
    assert run.optimised == ["4", "3"] and planner.calls == [True] and run.result.reason == "no motion"
    later = Run(planner, set(), monkeypatch, dict.fromkeys(names, np.inf), since=0.1)
    assert later.optimised == ["4", "3", "2", "1", "0"]


def test_a_transition_that_failed_is_not_tested_again(monkeypatch):
    """Of two sequences with the same first transition, the second is left out once the first failed there."""
    planner = Planner([solution("other", Limb.RIGHT_FOOT), solution("same", FOOT), solution("new", FOOT)], [])
    run = Run(planner, {"other"}, monkeypatch, {"new": 1.0, "same": 2.0, "other": 3.0}, failed_at=0)
    assert run.tested == ["new", "other"] and run.result.passed


@pytest.mark.parametrize(
    "check, fell, again",
    [
        ("unplanned_contacts", False, [WIDE]),
        ("scuff", False, [WIDE]),
        ("slip", False, [LEVEL]),
        ("goal_distance", False, []),
        ("unplanned_contacts", True, []),
    ],
)
def test_what_touches_or_slips_in_execution_is_tried_once_more_in_another_manner(monkeypatch, check, fell, again):
    manners = []

    def whole_body(plan, scene, manner):
        manners.append(manner)
        return SimpleNamespace(trajectory=SimpleNamespace(feasible=True, seconds=0.0, reason=""))

    def execute(plan, **settings):
        value = float(len(manners) == 1)  # the first run fails
        failure = Failure(check) if value else None
        return SimpleNamespace(
            checks=(Check(check, 0.0, "", value),), fell=fell, failure=failure, goal_reached=True, scuffs=()
        )

    monkeypatch.setattr(trial, "whole_body", whole_body)
    monkeypatch.setattr(trial, "execute", execute)
    monkeypatch.setattr(trial.Tester, "_scene", None)
    robot = SimpleNamespace(scale=USUAL)
    tester = trial.Tester(robot, None, pipeline.PipelineConfig(), pipeline.Observer())  # pyright: ignore
    tested = tester.test(SimpleNamespace(plan=None, failure=None))  # pyright: ignore
    assert manners == [Manner(), *again] and tested.passed == bool(again)


def test_a_motion_of_the_search_is_made_once_more_only_for_other_settings(monkeypatch):
    """It counts as the plan where a run would make the same one."""
    made = []

    def plan_motion(robot, world, sequence, config, surroundings):
        made.append(config)
        return SimpleNamespace(config=config, motion=SimpleNamespace(feasible=True))

    monkeypatch.setattr(trial, "plan_motion", plan_motion)
    monkeypatch.setattr(trial.Tester, "_surroundings", None)
    robot, config = SimpleNamespace(scale=USUAL), pipeline.PipelineConfig()
    tester = trial.Tester(robot, None, config, pipeline.Observer())  # pyright: ignore
    known, _ = tester.optimise(solution("any").sequence)
    other = trial.Tester(robot, None, replace(config, landing=None), pipeline.Observer())  # pyright: ignore
    assert tester.optimise(solution("any").sequence, known)[0] is known and len(made) == 1
    assert other.optimise(solution("any").sequence, known)[0] is not known and made[1].landing is None
