"""Contact states: early, in time, late, palms; force bounds without jumps."""

import numpy as np
import pytest

from toolkit.contacts.stance import Contact
from toolkit.control import touchdown
from toolkit.control.sampled_plan import Reference, Swing
from toolkit.control.touchdown import ContactTracker, LimbState
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose

PERIOD, WEIGHT = 0.002, 700.0
HERE = np.zeros((4, 3))  # m; limbs at their contacts


def tracker(swings, resting=(0, 1)):
    contact = np.zeros((1, 4), bool)
    contact[0, list(resting)] = True
    empty = dict.fromkeys(Reference.__dataclass_fields__)
    reference = Reference(**(empty | {"in_contact": contact, "swings": tuple(swings)}))
    limits = np.array([np.inf, np.inf, 150.0, 150.0])
    return ContactTracker(reference, tuple(Limb), WEIGHT, limits)


def swing(limb, start=1.0, end=2.0, makes=True, breaks=True):
    contact = Contact(limb, Pose.identity(), 0.5, 0) if makes else None
    return Swing(limb, start, end, 0, contact, breaks)


def follow(state, limb, force, until, start=0.0, height=0.0, way=0.0):
    """Run ticks with a force as a function of time, above the contact and before it; returns when contact was made."""
    made, position = [], np.full((4, 3), [-way, 0.0, height])
    for time in np.arange(start, until, PERIOD):
        measured = np.zeros(4)
        measured[limb] = force(time)
        state.update(time, PERIOD, measured, position)
        if state.made[limb]:
            made.append(time)
    return made


def test_a_foot_that_meets_the_ground_early_rests_there():
    state = tracker([swing(Limb.LEFT_FOOT)])
    made = follow(state, 0, lambda t: 30.0 if t > 1.8 else 0.0, 2.5)
    assert len(made) == 1 and made[0] == pytest.approx(1.8, abs=2 * PERIOD)
    assert state.in_contact[0]


def test_forces_before_the_fraction_of_the_swing_are_ignored():
    state = tracker([swing(Limb.LEFT_FOOT)])
    made = follow(state, 0, lambda t: 300.0 if 1.0 < t < 1.5 else 0.0, 1.9)
    assert made == [] and not state.in_contact[0]


@pytest.mark.parametrize("end", [{"height": touchdown.EARLY_HEIGHT}, {"way": touchdown.EARLY_WAY}])
def test_a_foot_that_grazes_an_edge_far_from_its_contact_goes_on(end):
    state = tracker([swing(Limb.LEFT_FOOT)])
    far, near = ({name: share * value for name, value in end.items()} for share in (1.1, 0.9))
    assert follow(state, 0, lambda t: 300.0 if t > 1.8 else 0.0, 1.9, **far) == []
    made = follow(state, 0, lambda t: 30.0, 2.0, start=1.9, **near)
    assert made[:1] == [pytest.approx(1.9, abs=2 * PERIOD)]


def test_ground_that_is_too_high_bears_in_the_end():
    state = tracker([swing(Limb.LEFT_FOOT)])
    made = follow(state, 0, lambda t: 300.0 if t > 1.8 else 0.0, 2.1, height=1.1 * touchdown.EARLY_HEIGHT)
    assert made == [pytest.approx(2.0, abs=2 * PERIOD)]


def test_a_foot_that_finds_no_ground_goes_on_but_not_for_ever():
    state = tracker([swing(Limb.LEFT_FOOT)])
    follow(state, 0, lambda t: 0.0, 2.1)
    assert state.state[Limb.LEFT_FOOT] is LimbState.SEARCH
    assert state.depth[0] == pytest.approx(0.1 * touchdown.LATE_FOOT_SPEED, rel=0.05)
    follow(state, 0, lambda t: 0.0, 5.0, start=2.1)
    assert state.depth[0] == touchdown.MAX_DEPTH and state.search_speed(Limb.LEFT_FOOT) == 0.0
    assert follow(state, 0, lambda t: 16.0, 5.1, start=5.0) and state.in_contact[0]


def test_a_palm_needs_two_ticks_of_force():
    state = tracker([swing(Limb.LEFT_PALM, breaks=False)], resting=(0, 1))
    assert not state.in_contact[2]
    ticks = iter([5.0, 0.0] * 400)
    assert follow(state, 2, lambda t: next(ticks), 2.2, start=1.0) == []
    assert len(follow(state, 2, lambda t: 5.0, 2.3, start=2.2)) == 1


def test_a_broken_palm_hangs_free():
    state = tracker([swing(Limb.LEFT_PALM, makes=False)], resting=(0, 1, 2))
    follow(state, 2, lambda t: 50.0, 1.5)
    assert state.state[Limb.LEFT_PALM] is LimbState.SWING and not state.in_contact[2]
    follow(state, 2, lambda t: 0.0, 2.1, start=1.5)
    assert state.state[Limb.LEFT_PALM] is LimbState.FREE


def test_the_bound_on_the_normal_force_falls_before_the_swing_and_rises_after_it():
    state = tracker([swing(Limb.LEFT_FOOT)])
    bounds = {}
    for k in range(1200):
        time = k * PERIOD
        state.update(time, PERIOD, np.array([100.0 if time >= 2.0 else 0.0, 0, 0, 0]), HERE)
        assert 0.0 <= state.min_force[0] <= state.max_force[0]
        bounds[k] = state.max_force[0]
    full = bounds[0]
    assert full > 2.0 * WEIGHT
    assert bounds[499] < touchdown.RELEASE_FORCE + 0.05 * full and bounds[450] == full
    assert bounds[700] == 0.0
    assert bounds[1001] <= touchdown.SETTLE_FORCE + 1.01 * full * PERIOD / touchdown.FOOT_RAMP
    assert bounds[1005] == full  # plans brake with all of a foot's force from its touchdown on
    # From one tick to the next while in contact: never more than the ramp's slope.
    steps = [abs(bounds[k + 1] - bounds[k]) for k in range(499)]
    assert max(steps) <= 1.01 * full * PERIOD / touchdown.RELEASE_RAMP


def test_palms_keep_their_own_limit():
    state = tracker([], resting=(0, 1, 2))
    state.update(0.0, PERIOD, np.zeros(4), HERE)
    assert state.max_force[2] == 150.0


@pytest.mark.parametrize("limb", [Limb.LEFT_FOOT, Limb.LEFT_PALM])
def test_a_limb_that_bears_what_it_is_asked_for_is_not_loose(limb):
    """One that is pressed on for it would be asked for less at the next tick, and so on: its force would alternate."""
    state = tracker([swing(limb)], resting=())
    follow(state, limb, lambda t: 300.0 if t > 1.9 else 0.0, 2.5)
    asked, loose = state.min_force[limb], []
    for share in (1.2, 1.0, 0.6, 0.4, 0.0):
        follow(state, limb, lambda t, force=share * asked: force, 2.501, start=2.5)
        loose.append(bool(state.loose[limb]))
    assert asked > 0.0 and loose == [False, False, False, True, True]


def test_a_limb_in_the_air_or_about_to_leave_is_not_loose():
    state = tracker([swing(Limb.LEFT_FOOT)])
    follow(state, 0, lambda t: 100.0, 0.9995)
    state.update(0.9998, PERIOD, np.ones(4), HERE)
    assert state.in_contact[0] and not state.loose[0]
    follow(state, 0, lambda t: 0.0, 1.5, start=1.0)
    assert not state.in_contact[0] and not state.loose[0]
