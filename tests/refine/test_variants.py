"""Variants of a sequence: all of them pass the screens, none is missed, and they lead where the sequence leads."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import pytest

from tests.refine.conftest import PALM
from toolkit.contacts.sequence import ContactSequence
from toolkit.geometry.limb import Limb
from toolkit.refine.chains import FootChains
from toolkit.refine.foresight import travel
from toolkit.refine.variants import left_out, relinked, swapped, without_palms


class Anything:
    """Screens that let everything pass in which a palm breaks only what it made."""

    def passes(self, sequence, moved_last=None):
        held = False
        for item in sequence.transitions:
            if item.limb == PALM:
                if item.contact is None and not held:
                    return False
                held = item.contact is not None
        return True


def limbs(sequence):
    return [(item.limb, item.contact is not None) for item in sequence.transitions]


def test_every_one_and_two_that_can_be_left_out_are(walk):
    n = len(walk.sequence.transitions)
    expected = set()
    for size in (1, 2):
        for dropped in combinations(range(n), size):
            kept = tuple(item for index, item in enumerate(walk.sequence.transitions) if index not in dropped)
            variant = replace(walk.sequence, transitions=kept)
            if walk.screen.passes(variant):
                expected.add(variant.identity)
    found = [variant.identity for variant in left_out(walk.sequence, walk.screen)]
    assert set(found) == expected and len(found) == len(expected) > 3


def test_a_palm_is_left_out_from_its_first_contact_to_its_break(leaning):
    found = [limbs(variant) for variant in without_palms(leaning, Anything())]  # pyright: ignore[reportArgumentType]
    left, right, palm = (Limb.LEFT_FOOT, True), (Limb.RIGHT_FOOT, True), (PALM, True)
    assert found == [
        [left, right, left, palm, right],
        [palm, left, palm, right, (PALM, False), left, right],
        [left, right, left, right],
    ]


def test_without_palms_there_is_nothing_to_leave_out(walk):
    assert not list(without_palms(walk.sequence, walk.screen))


def test_neighbours_change_places(leaning, walk):
    found = list(swapped(leaning, Anything()))  # pyright: ignore[reportArgumentType]
    assert len(found) == len(leaning.transitions) - 1
    for index, variant in enumerate(found):
        expected = list(leaning.transitions)
        expected[index], expected[index + 1] = expected[index + 1], expected[index]
        assert list(variant.transitions) == expected
    assert all(walk.screen.passes(variant) for variant in swapped(walk.sequence, walk.screen))


def test_other_steps_lead_to_the_same_stance(walk):
    groups = [list(group) for group in relinked(walk.sequence, FootChains(walk.screen))]
    variants = [variant for group in groups for variant in group]
    counts = {len(variant.transitions) - len(walk.sequence.transitions) for variant in variants}
    assert {-2, 0, 2} <= counts and min(counts) >= -3 and max(counts) <= 2
    for variant in variants:
        assert walk.screen.passes(variant)
        assert isinstance(variant, ContactSequence) and variant.start is walk.sequence.start
        for foot in (Limb.LEFT_FOOT, Limb.RIGHT_FOOT):
            ends = [sequence.stances[-1][foot].pose.position for sequence in (variant, walk.sequence)]
            assert (ends[0] == ends[1]).all()
    for group in groups:
        assert len({len(variant.transitions) for variant in group}) <= 1
        ways = [travel(variant) for variant in group]
        assert ways == pytest.approx(sorted(ways), abs=2e-3)  # the search knows places to 1 mm


def test_palms_are_never_in_what_is_replaced(leaning, walk):
    own = walk.screen
    known = {"numbers": own.numbers, "steps": own.steps, "table": own.table, "scale": own.scale}
    screen = SimpleNamespace(passes=lambda sequence, last=None: True, code=lambda *_: 0, **known)
    for group in relinked(leaning, FootChains(screen)):  # pyright: ignore[reportArgumentType]
        for variant in group:
            palms = [[item for item in each.transitions if item.limb == PALM] for each in (variant, leaning)]
            assert palms[0] == palms[1]
