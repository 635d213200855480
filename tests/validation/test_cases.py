"""Worlds of the experiments: each kind can be loaded, seeds make worlds where they should."""

import numpy as np
import pytest

from toolkit.errors import InputError
from validation.cases import AUTHORED_TRIALS, DRAWN, KINDS, SCALED, WORLDS, Case, kind_of, make_cases


@pytest.mark.parametrize("kind", sorted({*KINDS, *DRAWN, *SCALED}))
def test_every_kind_makes_a_world(kind):
    case = Case(kind, 3)
    world = case.world()
    assert world.name == case.name
    assert case.mjcf() == Case(kind, 3).mjcf()
    assert (case.mjcf() != Case(kind, 4).mjcf()) == kind_of(kind).random


def test_options_of_a_case_reach_the_generator():
    near, far = (Case("rubble_field", 0, (("rows", rows),)).world() for rows in (10, 20))
    ways = [float(np.linalg.norm(world.goal.position - world.start.position)) for world in (near, far)]
    assert ways[1] - ways[0] == pytest.approx(10 * 0.4)
    assert near.name != far.name


def test_cases_have_a_seed_each_and_few_where_nothing_is_random():
    cases = make_cases(["rubble_field", "wide_gap"], 7, 100)
    assert len({case.name for case in cases}) == len(cases) == 7 + AUTHORED_TRIALS
    assert [case.seed for case in cases[:7]] == list(range(100, 107))


def test_shipped_worlds_are_kinds_too_and_others_are_refused():
    for path in WORLDS.glob("*.xml"):
        kind_of(path.stem)
    with pytest.raises(InputError, match="no_such_world.*wide_gap"):
        kind_of("no_such_world")
