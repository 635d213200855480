"""Static balance against what is known in closed form."""

import numpy as np
import pytest

from tests.centroidal.walks import foot
from tests.shipped_robots import OWN
from toolkit.centroidal.balance import statically_balanced
from toolkit.centroidal.problem import GRAVITY, Margins
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="module", params=OWN)
def walker(request):
    return load_robot(request.param)


def feet(robot, slope=0.0, friction=0.5, limbs=FEET):
    return [foot(robot, limb, 0.0, friction=friction, slope=np.deg2rad(slope)) for limb in limbs]


@pytest.mark.parametrize("limbs", [FEET, FEET[:1], FEET[1:]])
def test_the_friction_angle_decides_on_a_slope(walker, limbs):
    """With mu = 0.5 feet hold up to atan 0.5 = 26.57 degrees; downhill is a vertex of the inscribed polygon."""
    for slope, holds in [(0, True), (20, True), (26.5, True), (26.6, False), (30, False)]:
        result = statically_balanced(walker, feet(walker, slope, limbs=limbs))
        assert result.balanced is holds and (result.margin >= 0.0) is holds, slope


def test_a_given_com_must_be_above_the_support(walker):
    contacts = feet(walker)
    half = walker.limbs[Limb.LEFT_FOOT].half_size
    y = contacts[0].pose.position[1]
    for x, dy, holds in [(0, 0, True), (0.99, 0, True), (1.01, 0, False), (0, 0.99, True), (0, 1.01, False)]:
        com = np.array([x * half[0], dy * (y + half[1]), walker.com_height])
        assert statically_balanced(walker, contacts, com).balanced is holds
        assert statically_balanced(walker, contacts, com + [0, 0, 0.3]).balanced is holds, "height does not matter"
    one = statically_balanced(walker, contacts[:1], np.array([0.0, -0.1 * y, walker.com_height]))
    assert one.balanced is bool(1.1 * y <= half[1])


def test_margins_shrink_patch_and_cone(walker):
    half = walker.limbs[Limb.LEFT_FOOT].half_size
    com = np.array([0.8 * half[0], 0.0, walker.com_height])
    cop = (0.3 * half[0], 0.0)
    assert statically_balanced(walker, feet(walker), com).balanced
    assert not statically_balanced(walker, feet(walker), com, margins=Margins(cop=cop)).balanced
    assert statically_balanced(walker, feet(walker, 20)).balanced
    assert not statically_balanced(walker, feet(walker, 20), margins=Margins(friction=0.66)).balanced


def test_best_com_is_within_reach(walker):
    leg = walker.legs[Limb.LEFT_FOOT]
    for x in np.linspace(0.0, 2.0, 9) * leg.max_length:
        contacts = [foot(walker, Limb.LEFT_FOOT, x), foot(walker, Limb.RIGHT_FOOT, 0.0)]
        result = statically_balanced(walker, contacts)
        if result.balanced:
            for contact in contacts:
                geometry = walker.legs[contact.limb]
                ankle = contact.pose @ geometry.ankle_in_sole
                assert np.linalg.norm(result.com + geometry.hip_in_com - ankle) <= leg.max_length + 1e-5
    assert statically_balanced(walker, [foot(walker, limb, 0.0) for limb in FEET]).balanced
    assert not result.balanced and result.margin == -np.inf, "a split of two leg lengths is out of reach"


def test_a_palm_on_a_wall_carries(walker):
    """Leaning at a wall in front of the feet: the CoM may be ahead of the toes only with the palm."""
    palm = next((limb for limb in PALMS if limb in walker.arms), None)
    if palm is None:
        pytest.skip("no palm")
    contacts = feet(walker)
    toes = walker.limbs[Limb.LEFT_FOOT].half_size[0]
    com = np.array([1.3 * toes, 0.0, walker.com_height])
    shoulder = com + walker.arms[palm].shoulder_in_com
    reach = (walker.arms[palm].min_reach + walker.arms[palm].max_reach) / 2
    wall = Pose(np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), shoulder + [reach, 0, 0])
    assert not statically_balanced(walker, contacts, com).balanced
    assert statically_balanced(walker, [*contacts, Contact(palm, wall, 0.5)], com).balanced


def test_verdict_agrees_with_a_hand_made_wrench(walker):
    """Random loads inside the cones are balanced by construction: one foot, the CoM above the CoP."""
    rng = np.random.default_rng(4)
    half = walker.limbs[Limb.LEFT_FOOT].half_size
    for _ in range(20):
        contact = feet(walker, rng.uniform(0, 24), limbs=FEET[:1])[0]
        # the vertical reaction passes through a point of the tilted sole
        point = contact.pose @ np.append(rng.uniform(-0.95, 0.95, 2) * half, 0.0)
        com = point - 0.9 * GRAVITY / np.linalg.norm(GRAVITY)
        assert statically_balanced(walker, [contact], com).balanced
        beyond = contact.pose @ np.append(rng.choice([-1.05, 1.05], 2) * half, 0.0)
        assert not statically_balanced(walker, [contact], beyond - 0.09 * GRAVITY).balanced


def test_no_contacts(walker):
    with pytest.raises(ValueError, match="at least one contact"):
        statically_balanced(walker, [])
